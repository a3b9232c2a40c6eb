"""The touch panel on its carriage: from counts to points in the table's frame, and back."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from truearm.types import Floats

AXES: Final = {
    f"{sign}{axis}": (1.0 if sign == "+" else -1.0) * np.eye(3)[k]
    for k, axis in enumerate("xyz")
    for sign in "+-"
}


@dataclass(frozen=True, eq=False)
class Panel:
    """Geometry of the panel. u runs along its rows, v up its columns, the normal out of its face.

    Attributes:
        area_m: Size (2,) of the effective area along u and v.
        counts: Counts (2,) over the effective area.
        offset_m: From the carriage to the corner where both counts are zero (3,).
        axes: Unit vectors (3, 3) of u, v and normal in the table's frame, as columns.
        least_angle_rad: Least angle between the face and the pin.
    """

    area_m: Floats
    counts: Floats
    offset_m: Floats
    axes: Floats
    least_angle_rad: float

    @classmethod
    def of(
        cls, area_m: Floats, counts: Floats, offset_m: Floats, normal: str, u: str, least_angle_rad: float
    ) -> "Panel":
        """A panel whose normal and u are axes of the table, such as "+z" and "+x"."""
        across = np.cross(AXES[normal], AXES[u])
        axes = np.column_stack([AXES[u], across, AXES[normal]])
        return cls(area_m, counts, offset_m, axes, least_angle_rad)

    @cached_property
    def normal(self) -> Floats:
        """Out of the face, towards the pin (3,)."""
        return np.asarray(self.axes[:, 2])

    @cached_property
    def _normal(self) -> list[float]:
        """The normal in plain numbers, which are quicker than arrays for so few."""
        numbers: list[float] = self.normal.tolist()
        return numbers

    def point(self, carriage: Sequence[float], u: float, v: float) -> Floats:
        """The point in the table's frame (3,) that the panel shows at counts u, v, m."""
        places = zip(carriage, self._corner_and_metres_of_counts, strict=True)
        return np.array([at + corner + by_u * u + by_v * v for at, (corner, by_u, by_v) in places])

    @cached_property
    def _corner_and_metres_of_counts(self) -> list[list[float]]:
        """Along each axis of the table: the offset, and what a count of u and of v adds, m."""
        by_counts = self.axes[:, :2] * (self.area_m / self.counts)
        table: list[list[float]] = np.column_stack([self.offset_m, by_counts]).tolist()
        return table

    @cached_property
    def shorter_m(self) -> float:
        """The shorter side of the effective area."""
        return float(self.area_m.min())

    def seen(self, carriage: Floats, point: Floats) -> Floats:
        """A point in the table's frame as the panel sees it (3,): along u, along v, above its face; m."""
        return np.asarray(self.axes.T @ (point - carriage - self.offset_m))

    def counts_of(self, seen: Floats) -> Floats:
        """Counts (2,) of a point as seen by the panel (3,)."""
        return np.asarray(seen[:2] * self.counts / self.area_m)

    def carriage_under(self, point: Floats, standoff_m: float) -> Floats:
        """Where the carriage (3,) has to be for its middle to be `standoff_m` before a point (3,)."""
        return np.asarray(point - self.middle_m - standoff_m * self.normal)

    @cached_property
    def middle_m(self) -> Floats:
        """From the carriage to the middle of the effective area (3,)."""
        return np.asarray(self.offset_m + self.axes[:, :2] @ (0.5 * self.area_m))

    def holds(self, seen: Floats, margin_m: float = 0.0) -> bool:
        """Whether a point as seen by the panel lies over its effective area."""
        inside = (seen[:2] >= margin_m) & (seen[:2] <= self.area_m - margin_m)
        return bool(inside.all())

    def angle(self, pointing: Floats) -> float:
        """Angle between the face and a pin along a unit vector (3,), rad; positive from the front."""
        against = -sum([a * b for a, b in zip(pointing.tolist(), self._normal, strict=True)])
        return math.asin(min(1.0, max(-1.0, against)))
