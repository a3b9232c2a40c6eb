"""Joints that stood still in all measured poses, of which nothing is known elsewhere."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from truearm._core import STILL_M
from truearm.types import Floats
from truearm.units import MM_PER_METRE, RADIANS_PER_DEGREE

STILL_DEG: Final = 0.5
"""More than what a controller that stops where it is told to differs by, less than what anybody measures."""
STILL_MM: Final = MM_PER_METRE * STILL_M
CARRIED: Final = 1e-3
"""Degrees or millimetres by which readings differ that are one place."""


def still_joints(readings: Floats, joints: Sequence[str]) -> dict[int, float]:
    """Where joints stood still, deg or mm, by the number of the joint from 1.

    Args:
        readings: Joint readings (n, N), rad or m.
        joints: Kind of each joint.
    """
    slides = np.array([kind == "prismatic" for kind in joints])
    shown = readings * np.where(slides, MM_PER_METRE, 1.0 / RADIANS_PER_DEGREE)
    still = np.ptp(shown, axis=0) <= np.where(slides, STILL_MM, STILL_DEG)
    return {int(k) + 1: float(np.median(shown[:, k])) for k in np.flatnonzero(still)}


def moved_joints(known: Floats, readings: Floats, joints: Sequence[str]) -> dict[int, float]:
    """Of the joints that stood still in `known` (n, N) those that move from there in `readings` (t, N)."""
    there = readings[np.isfinite(readings).all(axis=1)]
    stay = still_joints(np.concatenate([np.median(known, axis=0)[None], there]), joints)
    return {joint: at for joint, at in still_joints(known, joints).items() if joint not in stay}


def carried_joints(known: Floats, readings: Floats, joints: Sequence[str]) -> dict[int, float]:
    """Of the joints that stood still in `known` (n, N), how far `readings` (t, N) take them beyond that.

    Returns:
        Farthest way beyond the lowest and highest of the known readings, deg or mm, by the number of the
        joint from 1; without those that controllers do not tell from standing still.
    """
    there = readings[np.isfinite(readings).all(axis=1)]
    if len(there) == 0:
        return {}
    beyond = np.maximum(known.min(axis=0) - there, there - known.max(axis=0)).max(axis=0)
    shown = beyond * np.where(np.array(joints) == "prismatic", MM_PER_METRE, 1.0 / RADIANS_PER_DEGREE)
    still = still_joints(known, joints)
    return {joint: float(shown[joint - 1]) for joint in still if shown[joint - 1] > CARRIED}


def still_words(still: Mapping[int, float], joints: Sequence[str], at: str = "at") -> str:
    """Joints that stood still, of which there must be one, in words: "joint 6 at 0 deg"."""
    units = ["mm" if kind == "prismatic" else "deg" for kind in joints]
    return ", ".join(f"joint {joint} {at} {value:.4g} {units[joint - 1]}" for joint, value in still.items())


def still_warning(readings: Floats, joints: Sequence[str]) -> str:
    """What is to be known where joints stood still in readings (n, N), and what to do; empty if none did."""
    still = still_joints(readings, joints)
    if not still:
        return ""
    change, move = ("it changes", "it moves") if len(still) == 1 else ("they change", "they move")
    return (
        f"All poses were measured with {still_words(still, joints)}. What {change} looks like the place of "
        "the target, or like another joint, and no standard deviation knows of it. Measure poses in which "
        f"{move}, over all of the range that the work needs."
    )
