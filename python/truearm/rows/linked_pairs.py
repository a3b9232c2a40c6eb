"""Poses that pairs of rows link: which stay on one side where rows are divided."""

from typing import TYPE_CHECKING, Final

import numpy as np

from truearm.errors import Notice, count_of
from truearm.measurements import Measurements
from truearm.types import Mask, Rows, Texts

if TYPE_CHECKING:
    from truearm.rows.splitting import Split

LINKED: Final = 0.2
"""Share of the rows of a file from which those that pairs link are parted."""
LOST: Final = 0.1
"""Share of all distances from which it is said how many neither train nor are judged."""
STRETCHES: Final = 20
"""How many stretches of poses they are parted into,"""
SHORTEST: Final = 5
"""each of so many poses at the least; fewer than two such stretches are not parted."""
PAIRS_BETWEEN: Final = "pairs_between"
COMMON_POSE: Final = (
    "Where pairs have one pose in common, its point is a fixed one: give each distance one row, of the other "
    'pose, with a name of the point in the column "anchor" in place of "pair"'
)


def in_stretches(pose: Rows, pair: Rows, linked: Rows, sources: Texts) -> tuple[Rows, Mask]:
    """Labels (n,) of rows that pairs (n,) link (n,), where they are of many poses (n,) in stretches of these.

    Also tells which rows (n,) are in such stretches.
    """
    found, further = linked.copy(), int(linked.max()) + 1
    _, file, sizes = np.unique(sources, return_inverse=True, return_counts=True)
    for label, count in zip(*np.unique(linked, return_counts=True), strict=True):
        if count < 2 * SHORTEST:
            continue
        own = np.flatnonzero(linked == label)
        place = _from_pair_to_pair(pose[own], pair[own])
        poses, share = int(place.max()) + 1, np.bincount(file[own], minlength=len(sizes)) / sizes
        if share.max() >= LINKED and poses >= 2 * SHORTEST:
            found[own] = further + place // max(SHORTEST, poses // STRETCHES)
            further = int(found.max()) + 1
    return found, found > linked.max()


def _from_pair_to_pair(pose: Rows, pair: Rows) -> Rows:
    """Places (m,) of the poses (m,) of rows that pairs (m,) link, on a way from pair to pair.

    It begins at the first row's pose, and where it ends it goes on from the last pose that has other pairs.
    """
    from scipy.sparse import coo_array  # noqa: PLC0415 - seldom needed, and slow to import
    from scipy.sparse.csgraph import depth_first_order  # noqa: PLC0415

    _, first, number = np.unique(pose, return_index=True, return_inverse=True)
    number, count = np.argsort(np.argsort(first))[number.reshape(-1)], len(first)
    _, link = np.unique(pair, return_inverse=True)
    nodes = count + int(link.max()) + 1
    edges = coo_array((np.ones(len(pose)), (number, count + link.reshape(-1))), shape=(nodes, nodes))
    order = depth_first_order(edges.tocsr(), 0, directed=False, return_predecessors=False)
    return np.asarray(np.argsort(order[order < count])[number], dtype=np.int64)


def on_one_side(data: Measurements, rows: Rows, held: Mask) -> Mask:
    """Mask (r,) of rows without those of pairs that have one row on either side."""
    if data.pair is None:
        return np.ones(len(rows), dtype=np.bool_)
    pair = data.pair[rows]
    both = np.intersect1d(pair[held], pair[~held])
    return ~np.isin(pair, both[both != ""])


def pairs_between(data: Measurements, split: "Split") -> list[Notice]:
    """A notice where many pairs have one row on either side, so that they neither train nor are judged."""
    lost, count = split.between // 2, _distance_count(data)
    if lost <= LOST * count:
        return []
    text = (
        f"{lost} of {count_of(count, 'distance')} go from poses that train to poses that are held out: these "
        f"neither train nor are judged; {_distance_count(data.select(split.holdout))} are judged. Pairs of "
        f"poses that are in no other pair lose none. {COMMON_POSE}."
    )
    return [Notice(PAIRS_BETWEEN, text)]


def _distance_count(data: Measurements) -> int:
    """How many distances rows hold, of which some are in pairs."""
    pair = np.full(len(data), "") if data.pair is None else data.pair
    return int((pair == "").sum()) + len(np.unique(pair[pair != ""]))


def components(a: Rows, b: Rows) -> Rows:
    """Labels (n,) of rows connected by equal labels in `a` (n,) or in `b` (n,)."""
    if _all_differ(b):
        return a
    if _all_differ(a):
        return b
    from scipy.sparse import coo_array  # noqa: PLC0415 - seldom needed, and slow to import
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    _, b = np.unique(b, return_inverse=True)
    nodes = int(a.max()) + 1 + int(b.max()) + 1
    edges = coo_array((np.ones(len(a)), (a, b + int(a.max()) + 1)), shape=(nodes, nodes))
    _, labels = connected_components(edges, directed=False)
    return np.asarray(labels[a], dtype=np.int64)


def _all_differ(labels: Rows) -> bool:
    return len(np.unique(labels)) == len(labels)
