"""Where joints start that are to come to a pose from one side, and for which of them there is no room."""

from dataclasses import dataclass

import numpy as np

from truearm.robot import Robot
from truearm.types import Floats, Mask
from truearm.units import to_si


@dataclass(frozen=True, eq=False)
class RunUp:
    """How far beside a pose joints start.

    Attributes:
        arm: The arm, within whose limits they stay.
        approach_deg: How far joints that turn start from it.
        approach_mm: How far joints that slide do.
    """

    arm: Robot
    approach_deg: float
    approach_mm: float

    @property
    def away(self) -> Floats:
        """How far each joint (N,) starts from a pose, rad and m."""
        turned, slid = to_si(self.approach_deg, "deg"), to_si(self.approach_mm, "mm")
        return np.where(self.arm.revolute, turned, slid)

    def beside(self, readings: Floats, side: int | Floats) -> Floats:
        """Where joints start that are to come to readings from one side, within the limits.

        Args:
            readings: Where they are to come to (N,) or (n, N).
            side: 1 from lower readings, -1 from higher ones; or of each row (n, 1).
        """
        return np.asarray(np.clip(readings - side * self.away, *self.arm.limits.T))

    def places(self, readings: Floats, side: int) -> list[Floats]:
        """Readings to go through to a pose, so that every joint comes from a side: 1, -1, or 0 for any."""
        return [readings] if side == 0 else [self.beside(readings, side), readings]

    def shortened(self, readings: Floats, side: int) -> Mask:
        """Which joints (N,) have a limit nearer than that on the side from which they are to come."""
        low, high = self.arm.limits.T
        start = readings - side * self.away
        return np.asarray((start < low) | (start > high))

    def room(self, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """The part of readings from low to high (N,) with room for it on both sides.

        Joints whose limits are too near one another for that keep all of theirs.
        """
        least, most = self.arm.limits.T + np.outer([1.0, -1.0], self.away)
        has_room = np.maximum(low, least) < np.minimum(high, most)
        return (
            np.where(has_room, np.maximum(low, least), low),
            np.where(has_room, np.minimum(high, most), high),
        )
