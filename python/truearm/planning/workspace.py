"""What the division of a space asks of the world: candidates in a box, and measurements of some of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from truearm._core import MeasurementSet
from truearm.errors import InputError
from truearm.fits.core_set import measured_points
from truearm.planning.accessibility import Rule
from truearm.planning.pool import PoolOptions, draw_pool
from truearm.planning.spaces import Space
from truearm.types import Floats

Measure = Callable[[Floats], Floats]


@dataclass(eq=False)
class Workspace:
    """A space whose poses are measured on demand.

    Attributes:
        space: What is divided.
        measure_points: Measures readings (n, N): points (n, 3) in the world, m; NaN where that failed.
        rules: What makes a pose accessible.
        readings: All readings that were measured, in their order.
        points: What was measured at them.
    """

    space: Space
    measure_points: Measure
    rules: Sequence[Rule] = ()
    readings: list[Floats] = field(default_factory=list)
    points: list[Floats] = field(default_factory=list)

    def candidates(self, low: Floats, high: Floats, count: int, seed: int) -> tuple[Floats, Floats]:
        """At most `count` accessible poses of a box: joint values (k, N) and coordinates (k, D)."""
        options = PoolOptions(rules=self.rules, seed=seed)
        pool = draw_pool(self.space, count, options, box=(np.asarray(low), np.asarray(high)))
        return np.ascontiguousarray(self.space.robot.joints_from_readings(pool.readings)), pool.coordinates

    def measure(self, values: Floats) -> MeasurementSet:
        """Measure joint values (k, N).

        Raises:
            InputError: If the callable gives another shape than (k, 3).
        """
        readings = self.space.robot.readings_from_joints(values)
        points = np.asarray(self.measure_points(readings), dtype=np.float64)
        if points.shape != (len(readings), 3):
            raise InputError(
                f"measuring {len(readings)} poses gave an array of shape {points.shape}",
                where="measure_points",
                rule="It gives a point (x, y, z) in m for each",
            )
        self.readings.append(readings)
        self.points.append(points)
        return measured_points(values, points)
