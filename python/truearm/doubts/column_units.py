"""One column that stands in another unit than the others: a coordinate of the points, or one joint."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from truearm.doubts.nominal_misfit import Seen
from truearm.robot import Robot
from truearm.units import MM_PER_INCH, MM_PER_METRE

DEG_PER_RAD: Final = 180.0 / np.pi
LENGTHS: Final = (
    (MM_PER_METRE, "metres taken for mm"),
    (1.0 / MM_PER_METRE, "mm taken for metres"),
    (MM_PER_INCH, "inches taken for mm"),
    (1.0 / MM_PER_INCH, "mm taken for inches"),
)
ANGLES: Final = ((DEG_PER_RAD, "radians taken for degrees"), (1.0 / DEG_PER_RAD, "degrees taken for radians"))
"""Factors that put a column right, and what was taken for what."""


@dataclass(frozen=True)
class ColumnUnit:
    """A column whose values are to be multiplied.

    Attributes:
        joint: Its joint, from 0; None of a coordinate.
        axis: Its coordinate, from 0; None of a joint.
        factor: What puts it right.
        taken: What was taken for what.
    """

    joint: int | None
    axis: int | None
    factor: float
    taken: str

    def measured(self, seen: Seen) -> Seen:
        """What was measured with the column put right."""
        if self.joint is not None:
            readings = seen.readings.copy()
            readings[:, self.joint] *= self.factor
            return replace(seen, readings=readings)
        points = seen.points.copy()
        points[:, self.axis] *= self.factor
        return replace(seen, points=points)

    @property
    def words(self) -> str:
        """What is otherwise."""
        what = f"the {'xyz'[self.axis]} coordinate" if self.axis is not None else "the reading"
        of = "" if self.joint is None else f" of joint {self.joint + 1}"
        return f"{what}{of} is {self.factor:.4g} times what was read ({self.taken})"


def column_units(robot: Robot) -> Iterator[ColumnUnit]:
    """What single columns may stand in."""
    for axis in range(3):
        yield from (ColumnUnit(None, axis, *unit) for unit in LENGTHS)
    for joint, kind in enumerate(robot.joints):
        yield from (ColumnUnit(joint, None, *unit) for unit in (ANGLES if kind == "revolute" else LENGTHS))
