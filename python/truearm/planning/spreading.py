"""Points that fill a set evenly: each the farthest from those before it."""

import numpy as np
from numpy.typing import NDArray

from truearm.types import Floats


def fill(points: Floats, count: int) -> NDArray[np.int64]:
    """At most `count` rows of points (n, D), from the middle on; every column counts by its own reach."""
    span = np.ptp(points, axis=0)
    scaled = points / np.where(span > 0.0, span, 1.0)
    picked = [int(np.argmin(np.linalg.norm(scaled - scaled.mean(axis=0), axis=1)))]
    nearest = np.full(len(points), np.inf)
    for _ in range(min(count, len(points)) - 1):
        nearest = np.minimum(nearest, np.linalg.norm(scaled - scaled[picked[-1]], axis=1))
        picked.append(int(np.argmax(nearest)))
    return np.array(picked, dtype=np.int64)


def least_distance(points: Floats) -> float:
    """Distance of the two points of (n, D) that are closest to one another; infinite for one."""
    between = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(between, np.inf)
    return float(between.min())
