"""Points whose unit changes from some row on: a log that went on with the instrument's units switched."""

from typing import Final

import numpy as np

from truearm.errors import InputError
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.types import Floats
from truearm.units import MM_PER_INCH, MM_PER_METRE

FACTORS: Final = (
    (MM_PER_INCH, "millimetres and inches"),
    (MM_PER_METRE / MM_PER_INCH, "inches and metres"),
    (MM_PER_METRE, "millimetres and metres"),
)
"""How many times larger numbers are in the first of two units than in the second."""
FEWEST: Final = 5
"""Rows before the change and after it, at the least."""
APART: Final = 3.0
"""All points on one side are this many times farther from the origin than all on the other."""
FAR_ALIKE: Final = 1.3
SPREAD_ALIKE: Final = 1.6
"""Within these factors distances from the origin, and spreads, change by that of two units."""


def check_one_unit(measurements: Measurements, robot: Robot) -> None:
    """Raise InputError where the points of a set-up change their unit from some row on.

    Where an instrument was moved its points lie elsewhere, and spread as far as before: both have to change
    by the factor of two units, and not because the arm itself went less far.
    """
    for group in measurements.groups if measurements.target_count else []:
        own = measurements.select(measurements.group == group)
        seen = np.flatnonzero(own.seen(0))
        points = own.targets[seen, 0]
        first = _first_behind(np.linalg.norm(points, axis=1))
        units = None
        if first is not None:
            units = _units(points, robot.position(own.readings[seen]), first)
        if first is not None and units is not None:
            behind = np.zeros(len(own), dtype=bool)
            behind[seen[first:]] = True
            raise InputError(
                f"from {own.row_names(np.arange(len(own)) == seen[first])} on points look like another unit "
                f"than those before: {units}",
                where=", ".join(own.files),
                rule="All rows of a column have one unit",
                way_out="Convert these rows, or give them in a file of their own with its unit",
            )


def _first_behind(far: Floats) -> int | None:
    """The first of rows that are all nearer, or all farther, than those before (n,); None without any."""
    if len(far) < 2 * FEWEST or far.min() <= 0.0:
        return None
    logs = np.log(far)
    lowest, highest = np.minimum.accumulate(logs), np.maximum.accumulate(logs)
    least, most = np.minimum.accumulate(logs[::-1])[::-1], np.maximum.accumulate(logs[::-1])[::-1]
    gap = np.maximum(least[1:] - highest[:-1], lowest[:-1] - most[1:])[FEWEST - 1 : len(far) - FEWEST]
    place = int(np.argmax(gap))
    return None if gap[place] < np.log(APART) else FEWEST + place


def _units(points: Floats, nominal: Floats, first: int) -> str | None:
    """The two units whose factor is between points (n, 3) before and from `first` on, in words; else None."""
    far = np.log(_typical(points[first:]) / _typical(points[:first]))
    wide, by_arm = (_wider(each[:first], each[first:]) for each in (points, nominal))
    for factor, words in FACTORS:
        known = np.copysign(np.log(factor), far)
        if abs(far - known) < np.log(FAR_ALIKE) and abs(wide - by_arm - known) < np.log(SPREAD_ALIKE):
            return words
    return None


def _wider(before: Floats, behind: Floats) -> float:
    """Logarithm of how much farther points spread behind than before; NaN where they do not spread."""
    spread = [_typical(points - np.median(points, axis=0)) for points in (before, behind)]
    return float(np.log(spread[1] / spread[0])) if min(spread) > 0.0 else np.nan


def _typical(points: Floats) -> float:
    return float(np.median(np.linalg.norm(points, axis=1)))
