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

    def tool_gap(self, readings: Floats, world_from_base: Floats, carriages: Floats) -> float:
        """The smallest distance of the tool from the plate, m; negative below its face. As for gap."""
        values, panel, smallest = self._arm.joints_from_readings(readings), self._panel, np.inf
        for chain in self._tool:
            points = chain.position(values) @ world_from_base[:3, :3].T + world_from_base[:3, 3]
            seen = (points[:, None] - carriages - panel.offset_m) @ panel.axes
            beside = np.maximum(-RIM_M - seen[..., :2], seen[..., :2] - panel.area_m - RIM_M).max(axis=-1)
            smallest = min(smallest, float(np.maximum(seen[..., 2], beside).min()))
        return smallest

    def gap(self, readings: Floats, world_from_base: Floats, carriages: Floats) -> float:
        """The smallest gap between links and column, m; negative where they meet.

        Args:
            readings: Places of the arm (n, N), readings.
            world_from_base: Where the base stands in the table's frame (4, 4).
            carriages: Places of the carriage (m, 3), each combined with every place of the arm, m.
        """
        links = self._links(readings) @ world_from_base[:3, :3].T + world_from_base[:3, 3]
        top = carriages + self._panel.offset_m + self._panel.axes[:, :2] @ (0.5 * self._panel.area_m)
        spans = np.linalg.norm(np.diff(links[0], axis=0), axis=1) > SHORTEST_LINK_M
        begin = links[:, :-1][:, spans].reshape(-1, 1, 3)
        along = np.diff(links, axis=1)[:, spans].reshape(-1, 1, 3)
        return (
            float(_between(begin, along, top[None], -self._column * self._panel.normal).min()) - self._radii
        )

    def _links(self, readings: Floats) -> Floats:
        """Origins (n, N + 1, 3) of the base and of all links, in the base frame."""
        values = self._arm.joints_from_readings(readings)
        base = np.broadcast_to(self._arm.base[:3, 3], (len(values), 3))
        columns = [np.ascontiguousarray(values[:, : k + 1]) for k in range(len(self._chains))]
        ends = [chain.position(part) for chain, part in zip(self._chains, columns, strict=True)]
        return np.stack([base, *ends], axis=1)


def _between(begin: Floats, along: Floats, top: Floats, down: Floats) -> Floats:
    """Distances (k, m) between segments from `begin` (k, 1, 3) and from `top` (1, m, 3).

    Ericson, Real-Time Collision Detection, 2005, section 5.1.9.

    Args:
        begin: Where the first ones begin.
        along: From there to their ends (k, 1, 3).
        top: Where the second ones begin.
        down: From there to their ends, the same for all (3,).
    """
    apart = begin - top
    aa, bb, ab = _dot(along, along), float(down @ down), along @ down
    to_a, to_b = _dot(along, apart), apart @ down
    crossing = aa * bb - ab * ab
    parallel = crossing <= 0.0
    s = np.where(parallel, 0.0, (ab * to_b - to_a * bb) / np.where(parallel, 1.0, crossing))
    t = np.clip((ab * np.clip(s, 0.0, 1.0) + to_b) / bb, 0.0, 1.0)
    s = np.clip((ab * t - to_a) / aa, 0.0, 1.0)
    nearest = apart + s[..., None] * along - t[..., None] * down
    return np.asarray(np.sqrt(_dot(nearest, nearest)))


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def _rows(arm: Robot) -> tuple[str, list[str], Floats, Floats]:
    return arm.convention, list(arm.joints), arm.table, arm.base


def _at(point: Floats) -> Floats:
    transform = np.eye(4)
    transform[:3, 3] = point
    return transform
