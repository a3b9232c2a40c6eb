"""How far the arm's links are from the column that carries the panel, under nominal kinematics."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import Chain
from truearm.cell.cell_file import ClearanceSection
from truearm.cell.panel import Panel
from truearm.robot import Robot
from truearm.units import to_si

Floats = NDArray[np.float64]

SHORTEST_LINK_M: Final = 1e-6
# How far the plate reaches beyond the effective area.
RIM_M: Final = 0.02


class Clearance:
    """Gaps between the links, as capsules between their origins, and the column behind the panel; and
    between the tool, as a line from flange to target, and the plate around the panel.
    """

    def __init__(self, arm: Robot, flange_from_target: Floats, panel: Panel, sizes: ClearanceSection) -> None:
        self._arm, self._panel = arm, panel
        tip = flange_from_target[:3, 3]
        self._tool = [Chain(*_rows(arm), arm.flange @ _at(share * tip)) for share in (0.5, 1.0)]
        self._radii = to_si(sizes.link_radius_mm + sizes.column_radius_mm, "mm")
        self._column = to_si(sizes.column_mm, "mm")
        self.margin_m = to_si(sizes.margin_mm, "mm")
        self._chains = [
            Chain(arm.convention, list(arm.joints[:k]), np.array(arm.table[:k]), arm.base, np.eye(4))
            for k in range(1, arm.joint_count + 1)
        ]

    def tool_gap(self, readings: Floats, world_from_base: Floats, carriage: Floats) -> float:
        """The smallest distance of the tool from the plate over n moments, m; negative below its face.

        Args:
            readings: Joint readings (n, N).
            world_from_base: Where the base stands in the table's frame (4, 4).
            carriage: Where the carriage is (n, 3), m.
        """
        values, panel, smallest = self._arm.joints_from_readings(readings), self._panel, np.inf
        for chain in self._tool:
            points = chain.position(values) @ world_from_base[:3, :3].T + world_from_base[:3, 3]
            seen = (points - carriage - panel.offset_m) @ panel.axes
            beside = np.maximum(-RIM_M - seen[:, :2], seen[:, :2] - panel.area_m - RIM_M).max(axis=1)
            smallest = min(smallest, float(np.maximum(seen[:, 2], beside).min()))
        return smallest

    def gap(self, readings: Floats, world_from_base: Floats, carriage: Floats) -> float:
        """The smallest gap over n moments, m; negative where link and column meet.

        Args:
            readings: Joint readings (n, N).
            world_from_base: Where the base stands in the table's frame (4, 4).
            carriage: Where the carriage is (n, 3), m.
        """
        links = self._links(readings) @ world_from_base[:3, :3].T + world_from_base[:3, 3]
        top = carriage + self._panel.offset_m + self._panel.axes[:, :2] @ (0.5 * self._panel.area_m)
        foot = top - self._column * self._panel.normal
        spans = np.linalg.norm(np.diff(links, axis=1), axis=2).max(axis=0) > SHORTEST_LINK_M
        smallest = np.inf
        for k in np.flatnonzero(spans):
            smallest = min(smallest, float(_between(links[:, k], links[:, k + 1], top, foot).min()))
        return smallest - self._radii

    def _links(self, readings: Floats) -> Floats:
        """Origins (n, N + 1, 3) of the base and of all links, in the base frame."""
        values = self._arm.joints_from_readings(readings)
        base = np.broadcast_to(self._arm.base[:3, 3], (len(values), 3))
        columns = [np.ascontiguousarray(values[:, : k + 1]) for k in range(len(self._chains))]
        ends = [chain.position(part) for chain, part in zip(self._chains, columns, strict=True)]
        return np.stack([base, *ends], axis=1)


def _between(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """Distances (n,) between segments a-b and c-d, all (n, 3). Ericson 2005, section 5.1.9."""
    along, across, apart = b - a, d - c, a - c
    aa, bb, ab = _dot(along, along), _dot(across, across), _dot(along, across)
    to_a, to_b = _dot(along, apart), _dot(across, apart)
    parallel = aa * bb - ab * ab
    s = np.where(parallel > 0.0, (ab * to_b - to_a * bb) / np.where(parallel > 0.0, parallel, 1.0), 0.0)
    t = (ab * np.clip(s, 0.0, 1.0) + to_b) / bb
    t = np.clip(t, 0.0, 1.0)
    s = np.clip((ab * t - to_a) / aa, 0.0, 1.0)
    return np.asarray(np.linalg.norm(apart + s[:, None] * along - t[:, None] * across, axis=1))


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("ni,ni->n", a, b))


def _rows(arm: Robot) -> tuple[str, list[str], Floats, Floats]:
    return arm.convention, list(arm.joints), arm.table, arm.base


def _at(point: Floats) -> Floats:
    transform = np.eye(4)
    transform[:3, 3] = point
    return transform
