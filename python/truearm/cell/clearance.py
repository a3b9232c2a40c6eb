"""How far arm and table keep apart, at places and on their ways, under nominal kinematics.

Links are capsules between their origins, and so is the column behind the panel; the tool is a line from
flange to target that may not go through the plate around the panel.
"""

from typing import Final

import numpy as np

from truearm._core import Chain
from truearm._core import Clearance as Gaps
from truearm.cell.cell_file import ClearanceSection
from truearm.cell.panel import Panel
from truearm.fits.parameters import A, D
from truearm.planning.folding import SHORTEST_LINK_M
from truearm.robot import Robot
from truearm.types import Floats
from truearm.units import to_si

# How far the plate reaches beyond the effective area.
RIM_M: Final = 0.02
# Ends of the tool's line.
TOOL_SHARES: Final = (0.0, 1.0)
ARM_STEP_RAD: Final = 0.05
TABLE_STEP_M: Final = 0.05
# Less than what a panel that waits is farther from its point than the point is uncertain.
TOOL_MARGIN_M: Final = 0.002


class Clearance:
    """Gaps between an arm at readings (N,) and a table whose carriage is at places (3,)."""

    def __init__(self, arm: Robot, flange_from_target: Floats, panel: Panel, sizes: ClearanceSection) -> None:
        self._values_of = arm.values_of
        self._margin_m = to_si(sizes.margin_mm, "mm")
        radii = to_si(sizes.link_radius_mm + sizes.column_radius_mm, "mm")
        self._gaps = Gaps(
            _links(arm),
            [_tool(arm, share * flange_from_target[:3, 3]) for share in TOOL_SHARES],
            (panel.middle_m.tolist(), (-to_si(sizes.column_mm, "mm") * panel.normal).tolist(), radii),
            (panel.offset_m.tolist(), panel.axes.T.tolist(), panel.area_m.tolist(), RIM_M),
        )

    def gaps(self, readings: Floats, carriages: Floats, world_from_base: Floats) -> Floats:
        """Gaps (n, 2) between links and column and between tool and plate, m; negative where they meet.

        Args:
            readings: Where the arm is (n, N), one place after another.
            carriages: Where the carriage is at the same time (n, 3), m.
            world_from_base: Where the base stands (4, 4) in the frame of the table.
        """
        return self._gaps.gaps(self._values_of(readings), carriages, world_from_base)

    def margin(self, arm: Floats, table: Floats, world_from_base: Floats) -> float:
        """How much farther than they have to they keep apart, however fast one or the other goes; m.

        Args:
            arm: Readings (s, N) between which the joints go straight; one row where the arm stands.
            table: Places (p, 3) between which the carriage goes straight, m; likewise.
            world_from_base: Where the base stands (4, 4) in the frame of the table.
        """
        ways = (self._values_of(arm), ARM_STEP_RAD), (table, TABLE_STEP_M)
        links, tool = self._gaps.least(*ways, world_from_base)
        return min(links - self._margin_m, tool - TOOL_MARGIN_M)

    def meets(self, readings: Floats, carriage: Floats, world_from_base: Floats) -> float | None:
        """The gap between links and column, m, where it is less than it has to be; None where it is not."""
        gap = float(self.gaps(readings[None], carriage[None], world_from_base)[0, 0])
        return gap if gap < self._margin_m else None


def _links(arm: Robot) -> list[Chain]:
    """Chains to the ends of the links that have a length."""
    return [
        Chain(arm.convention, list(arm.joints[:k]), np.array(arm.table[:k]), arm.base, np.eye(4))
        for k in range(1, arm.joint_count + 1)
        if arm.joints[k - 1] == "prismatic" or np.abs(arm.table[k - 1, [D, A]]).max() > SHORTEST_LINK_M
    ]


def _tool(arm: Robot, point_in_flange: Floats) -> Chain:
    """Chain to a point (3,) of the tool."""
    flange_from_point = np.eye(4)
    flange_from_point[:3, 3] = point_in_flange
    return Chain(arm.convention, list(arm.joints), arm.table, arm.base, arm.flange @ flange_from_point)
