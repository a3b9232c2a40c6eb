"""Whether arm and table keep apart on their ways, under nominal kinematics."""

from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.cell.clearance import Clearance

Floats = NDArray[np.float64]

ARM_STEP_RAD: Final = 0.05
TABLE_STEP_M: Final = 0.05
# Less than what a panel that waits is farther from its point than the point is uncertain.
TOOL_MARGIN_M: Final = 0.002


class Paths:
    """Ways of the arm through readings, and of the table through places of its carriage."""

    def __init__(self, clearance: Clearance, world_from_base: Floats, uncertain_m: float) -> None:
        """Set up for a frame (4, 4) and how far predicted points may be off."""
        self._clearance, self._frame, self._uncertain_m = clearance, world_from_base, uncertain_m

    def free(self, arm: list[Floats], table: list[Floats]) -> bool:
        """Whether they keep apart at any moment, however fast one or the other goes.

        Args:
            arm: Readings (N,) that the arm goes through, in straight lines between the joints.
            table: Places (3,) that the carriage goes through.
        """
        places, carriages = _along(arm, ARM_STEP_RAD), _along(table, TABLE_STEP_M)
        if self._clearance.tool_gap(places, self._frame, carriages) <= TOOL_MARGIN_M + self._uncertain_m:
            return False
        gap = self._clearance.gap(places, self._frame, carriages)
        return gap > self._clearance.margin_m + self._uncertain_m


def _along(stops: list[Floats], step: float) -> Floats:
    """Places (n, k) along straight lines through stops (k,), none farther than `step` from the next."""
    places = [np.asarray(stops[0])[None]]
    for a, b in pairwise(stops):
        count = int(np.ceil(np.abs(b - a).max() / step)) + 1
        places.append(a + np.linspace(0.0, 1.0, count + 1)[1:, None] * (b - a))
    return np.vstack(places)
