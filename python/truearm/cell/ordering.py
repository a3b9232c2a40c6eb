"""In which order poses are measured: the paper's and a shorter one from low to high, and there and back."""

from itertools import pairwise
from typing import Final

import networkx as nx
import numpy as np
from networkx.algorithms import approximation
from numpy.typing import NDArray

from truearm.types import Floats

Order = NDArray[np.int64]

BAND_M: Final = 0.08
MOST_BANDS: Final = 6
SEED: Final = 7


def paper_order(points: Floats) -> Order:
    """By height in bands, then by x and y: section 7 of the paper. Points (n, 3), m."""
    band = np.floor(points[:, 2] / BAND_M)
    return np.lexsort((points[:, 1], points[:, 0], band)).astype(np.int64)


def short_order(points: Floats, readings: Floats, speed: float) -> Order:
    """By height in bands, as short as a heuristic finds it within each: greedy, then threshold accepting.

    The bands are higher than the paper's where there would be many, so that there is something to shorten;
    the table still comes from below. The heuristics are NetworkX's for the travelling salesman. Where they
    find nothing shorter it is the paper's order.

    Args:
        points: Targets (n, 3), m.
        readings: Joint readings (n, N).
        speed: Joint speed, rad/s; motion time is that of the joint with the longest way.
    """
    band = np.floor(points[:, 2] / max(BAND_M, float(np.ptp(points[:, 2])) / MOST_BANDS))
    order: list[int] = []
    for value in np.unique(band):
        members = np.flatnonzero(band == value).tolist()
        order += _path(members, readings, speed, order[-1] if order else None)
    found, plain = np.array(order, dtype=np.int64), paper_order(points)
    return min(found, plain, key=lambda each: motion_seconds(readings, each, speed))


def there_and_back(order: Order) -> Order:
    """Every other pose of an order, then the rest of them from its end to its beginning.

    Each stretch of the order comes early and late, so that what drifts is not what varies along the order.
    """
    return np.concatenate([order[::2], order[1::2][::-1]])


def motion_seconds(readings: Floats, order: Order, speed: float) -> float:
    """Time of the motions between poses in an order, s."""
    ways = np.abs(np.diff(readings[order], axis=0)).max(axis=1)
    return float(ways.sum() / speed)


def _path(members: list[int], readings: Floats, speed: float, before: int | None) -> list[int]:
    """An order of some poses; it begins at the one nearest to the pose before."""
    if before is None:
        first = members[0]
    else:
        first = min(members, key=lambda k: float(np.abs(readings[k] - readings[before]).max()))
    if len(members) < 4:
        return [first, *(k for k in members if k != first)]
    graph = nx.Graph()
    for i, a in enumerate(members):
        for b in members[i + 1 :]:
            graph.add_edge(a, b, weight=float(np.abs(readings[a] - readings[b]).max()) / speed)
    start = approximation.greedy_tsp(graph, source=first)
    tour = approximation.threshold_accepting_tsp(graph, start, source=first, seed=SEED)
    return [int(node) for node in min(tour[:-1], tour[:0:-1], key=lambda path: _length(graph, path))]


def _length(graph: "nx.Graph[int]", path: list[int]) -> float:
    return sum(float(graph.edges[a, b]["weight"]) for a, b in pairwise(path))
