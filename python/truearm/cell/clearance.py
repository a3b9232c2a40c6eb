"""How far the arm's links are from the column that carries the panel, under nominal kinematics."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import Chain
from truearm.cell.cell_file import ClearanceSection
from truearm.cell.panel import Panel
from truearm.parameters import A, D
from truearm.robot import Robot
from truearm.units import to_si

Floats = NDArray[np.float64]

SHORTEST_LINK_M: Final = 1e-6
# Square of what two segments span; of less they count as parallel.
PARALLEL_M4: Final = 1e-12
# How far the plate reaches beyond the effective area.
RIM_M: Final = 0.02


@dataclass(frozen=True, eq=False)
class Places:
    """Where an arm's links and tool are at places of the arm, in the table's frame, m.

    Attributes:
        links: Ends of the links that have a length (n, K + 1, 3), the base first.
        tool: Middle and end of the tool (n, 2, 3).
    """

    links: Floats
    tool: Floats


class Clearance:
    """Gaps between the links, as capsules between their origins, and the column behind the panel; and
    between the tool, as a line from flange to target, and the plate around the panel.
    """

    def __init__(self, arm: Robot, flange_from_target: Floats, panel: Panel, sizes: ClearanceSection) -> None:
        self._coupling, self._base, self._panel = arm.coupling.T, arm.base[:3, 3], panel
        tip = flange_from_target[:3, 3]
        self._tool = [Chain(*_rows(arm), arm.flange @ _at(share * tip)) for share in (0.5, 1.0)]
        self._radii = to_si(sizes.link_radius_mm + sizes.column_radius_mm, "mm")
        self._top = panel.offset_m + panel.axes[:, :2] @ (0.5 * panel.area_m)
        self._down = -to_si(sizes.column_mm, "mm") * panel.normal
        self._beyond_m = panel.area_m + RIM_M
        self.margin_m = to_si(sizes.margin_mm, "mm")
        self._chains = [
            Chain(arm.convention, list(arm.joints[:k]), np.array(arm.table[:k]), arm.base, np.eye(4))
            for k in range(1, arm.joint_count + 1)
            if arm.joints[k - 1] == "prismatic" or np.abs(arm.table[k - 1, [D, A]]).max() > SHORTEST_LINK_M
        ]

    def places(self, readings: Floats, world_from_base: Floats) -> Places:
        """Where links and tool are at readings (n, N) of an arm whose base stands at a frame (4, 4)."""
        values, chains = readings @ self._coupling, [*self._chains, *self._tool]
        in_base = np.empty((len(values), 1 + len(chains), 3))
        in_base[:, 0] = self._base
        for k, chain in enumerate(chains, 1):
            in_base[:, k] = chain.position(np.ascontiguousarray(values[:, : chain.joint_count]))
        placed = in_base @ world_from_base[:3, :3].T + world_from_base[:3, 3]
        return Places(placed[:, :-2], placed[:, -2:])

    def tool_gaps(self, places: Places, carriages: Floats) -> Floats:
        """Distances of the tool from the plate (n, m), m; negative below its face. As for gaps."""
        panel = self._panel
        seen = (places.tool[:, :, None] - (carriages + panel.offset_m)) @ panel.axes
        beside = np.maximum(-RIM_M - seen[..., :2], seen[..., :2] - self._beyond_m).max(axis=-1)
        return np.asarray(np.maximum(seen[..., 2], beside).min(axis=1))

    def gaps(self, places: Places, carriages: Floats) -> Floats:
        """Gaps between links and column (n, m), m; negative where they meet.

        Args:
            places: Where the arm is (n).
            carriages: Places of the carriage (m, 3), each combined with every place of the arm, m.
        """
        begin = places.links[:, :-1, None]
        along = places.links[:, 1:, None] - begin
        distances = _between(begin, along, carriages + self._top, self._down)
        return np.asarray(distances.min(axis=1) - self._radii)


def _between(begin: Floats, along: Floats, top: Floats, down: Floats) -> Floats:
    """Distances (n, K, m) between segments from `begin` (n, K, 1, 3) and from `top` (m, 3).

    Ericson, Real-Time Collision Detection, 2005, section 5.1.9.

    Args:
        begin: Where the first ones begin.
        along: From there to their ends (n, K, 1, 3).
        top: Where the second ones begin.
        down: From there to their ends, the same for all (3,).
    """
    apart = begin - top
    aa, bb, ab = _dot(along, along), float(down @ down), along @ down
    to_a, to_b = _dot(along, apart), apart @ down
    crossing = aa * bb - ab * ab
    # Of segments that are parallel any place of the first one will do to begin with.
    s = _share((ab * to_b - to_a * bb) / np.maximum(crossing, PARALLEL_M4))
    t = _share((ab * s + to_b) / bb)
    s = _share((ab * t - to_a) / np.maximum(aa, SHORTEST_LINK_M**2))
    nearest = apart + s[..., None] * along - t[..., None] * down
    return np.asarray(np.sqrt(_dot(nearest, nearest)))


def _share(values: Floats) -> Floats:
    """Values brought to between 0 and 1; np.clip takes several times as long for few."""
    return np.asarray(np.minimum(np.maximum(values, 0.0), 1.0))


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def _rows(arm: Robot) -> tuple[str, list[str], Floats, Floats]:
    return arm.convention, list(arm.joints), arm.table, arm.base


def _at(point: Floats) -> Floats:
    transform = np.eye(4)
    transform[:3, 3] = point
    return transform
