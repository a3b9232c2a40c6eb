"""Joints that stood still in all measured poses, of which nothing is known elsewhere."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.units import MM_PER_METRE, RADIANS_PER_DEGREE

Floats = NDArray[np.float64]

STILL_DEG: Final = 0.5
"""More than what a controller that stops where it is told to differs by, less than what anybody measures."""
STILL_MM: Final = 0.5
MOVE_IT: Final = (
    "What it changes looks like the place of the target, or like another joint, and no standard deviation "
    "knows of it. Measure poses in which it moves, over all of the range that the work needs"
)
"""Why that matters, and the way out."""


def still_joints(readings: Floats, joints: Sequence[str]) -> dict[int, float]:
    """Where joints stood still, deg or mm, by the number of the joint from 1.

    Args:
        readings: Joint readings (n, N), rad or m.
        joints: Kind of each joint.
    """
    turns = np.array([kind == "revolute" for kind in joints])
    shown = readings * np.where(turns, 1.0 / RADIANS_PER_DEGREE, MM_PER_METRE)
    still = np.ptp(shown, axis=0) <= np.where(turns, STILL_DEG, STILL_MM)
    return {int(k) + 1: float(np.median(shown[:, k])) for k in np.flatnonzero(still)}


def moved_joints(known: Floats, readings: Floats, joints: Sequence[str]) -> dict[int, float]:
    """Of the joints that stood still in `known` (n, N) those that move from there in `readings` (t, N)."""
    still = still_joints(known, joints)
    apart = np.abs(readings - np.median(known, axis=0))
    moved = still_joints(np.stack([np.zeros(len(joints)), np.nanmax(apart, axis=0, initial=0.0)]), joints)
    return {joint: value for joint, value in still.items() if joint not in moved}


def still_words(still: dict[int, float], joints: Sequence[str]) -> str:
    """Joints that stood still, of which there must be one, in words: "joint 6 at 0 deg"."""
    units = ["deg" if kind == "revolute" else "mm" for kind in joints]
    return ", ".join(f"joint {joint} at {value:.4g} {units[joint - 1]}" for joint, value in still.items())
