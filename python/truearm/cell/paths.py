"""Whether arm and table keep apart on their ways, under nominal kinematics."""

import math
from itertools import accumulate, pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.cell.clearance import Clearance, Places

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

    def along(self, stops: list[Floats]) -> Places:
        """Places of the arm on straight lines between its joints, through readings (N,) one after another."""
        return self._clearance.places(_along(stops, ARM_STEP_RAD), self._frame)

    def margins(self, arm: Places, table: list[list[Floats]]) -> list[Floats]:
        """How much farther than they have to they keep apart, however fast one or the other goes.

        Args:
            arm: Where the arm is on its way (n).
            table: Ways of the carriage, each as places (3,) that it goes through.

        Returns:
            For each way of the carriage the margins (n, m) over its m places, m; apart where positive.
        """
        ways = [_along(stops, TABLE_STEP_M) for stops in table]
        carriages, clearance = np.concatenate(ways), self._clearance
        tool = clearance.tool_gaps(arm, carriages) - TOOL_MARGIN_M
        links = clearance.gaps(arm, carriages) - clearance.margin_m
        margins = np.minimum(tool, links) - self._uncertain_m
        ends = accumulate(len(way) for way in ways)
        return [margins[:, end - len(way) : end] for way, end in zip(ways, ends, strict=True)]


def _along(stops: list[Floats], step: float) -> Floats:
    """Places (n, k) along straight lines through stops (k,), none farther than `step` from the next."""
    # Few short rows: plain numbers are quicker than arrays.
    listed = [stop.tolist() for stop in stops]
    places = [listed[0]]
    for a, b in pairwise(listed):
        leg = [(x, y - x) for x, y in zip(a, b, strict=True)]
        count = math.ceil(max(abs(way) for _, way in leg) / step) + 1
        places += [[x + k / count * way for x, way in leg] for k in range(1, count + 1)]
    return np.array(places)
