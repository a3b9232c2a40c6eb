"""Joints that were measured at a few values alone, between which nothing is known of them."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from truearm.fits.stillness import still_joints
from truearm.rows.visits import pose_numbers
from truearm.types import Floats
from truearm.units import MM_PER_METRE, RADIANS_PER_DEGREE

FEWEST_POSES: Final = 12
POSES_A_VALUE: Final = 4
"""On average, at the least: where each value has fewer, it may have been drawn with the pose."""
MOST_VALUES: Final = 12
WITHIN: Final = 0.05
"""Part of a joint's range that all readings at its values may take up."""
MOST_AT_ONE: Final = 0.75
"""Of the poses that one value may hold: else the others may be slips of single rows."""
WIDEST_GAP: Final = 0.1
"""Part of a joint's range that, measured nowhere, is worth a word."""
LEAST_GAP: Final = 0.5
"""Its size at the least, deg or mm: finer ones may come of how readings are rounded."""
NAMED: Final = 6
BETWEEN_THEM: Final = (
    "Measure 20 to 30 poses in between and judge on them with truearm evaluate; calibrate from them too if "
    "errors are larger there. An arm that works at these values alone needs no others"
)
"""The way out."""


def few_values(readings: Floats, joints: Sequence[str]) -> dict[int, list[float]]:
    """Values that joints were measured at alone, deg or mm, ascending, by the number of the joint from 1.

    Several rows at one pose count once, and joints that stood still in all rows have no such values.

    Args:
        readings: Joint readings (n, N), rad or m.
        joints: Kind of each joint.
    """
    poses = readings[np.unique(pose_numbers(readings, np.zeros(len(readings), dtype=np.str_)))]
    if len(poses) < FEWEST_POSES:
        return {}
    slides = np.array([kind == "prismatic" for kind in joints])
    shown = poses * np.where(slides, MM_PER_METRE, 1.0 / RADIANS_PER_DEGREE)
    moved = [k for k in range(len(joints)) if k + 1 not in still_joints(readings, joints)]
    found = {k + 1: _values(np.sort(shown[:, k])) for k in moved}
    return {joint: values for joint, values in found.items() if values}


def values_words(values: Mapping[int, list[float]], joints: Sequence[str]) -> str:
    """Joints and values, of which there must be some, in words: "joint 1 at 3 values (0, 900, 2000 mm)"."""
    return ", ".join(_words(joint, own, joints[joint - 1]) for joint, own in values.items())


def _words(joint: int, values: Sequence[float], kind: str) -> str:
    named = ", ".join(f"{value:.4g}" for value in values[:NAMED])
    more = ", ..." if len(values) > NAMED else ""
    return f"joint {joint} at {len(values)} values ({named}{more} {'mm' if kind == 'prismatic' else 'deg'})"


def _values(ascending: Floats) -> list[float]:
    """The few values that readings (n,) of a joint stand at; none where they are spread."""
    gaps = np.diff(ascending)
    widest = np.argsort(-gaps, kind="stable")
    span = float(ascending[-1] - ascending[0])
    taken = span - np.cumsum(gaps[widest])
    count = int(np.argmax(taken <= WITHIN * span)) + 1
    most = min(MOST_VALUES, len(ascending) // POSES_A_VALUE)
    if count + 1 > most or gaps[widest[0]] < max(WIDEST_GAP * span, LEAST_GAP):
        return []
    parts = np.split(ascending, np.sort(widest[:count]) + 1)
    if max(map(len, parts)) > MOST_AT_ONE * len(ascending):
        return []
    return [float(np.median(part)) for part in parts]
