"""On which branch a six-axis arm stands: on which side of each of its singularities."""

from typing import Final

import numpy as np

from truearm.defaults import LARGEST_JOINT_DEG
from truearm.inverse import Inverse
from truearm.turns import EDGE_RAD, NearestTurns
from truearm.types import Floats, Mask

NUMERIC: Final = "numeric"
"""Method of an arm without a closed form."""
CORRECTION_RAD: Final = np.deg2rad(LARGEST_JOINT_DEG)
"""So far apart a nominal and a calibrated arm may stand at one pose."""


def crossed(inverse: Inverse, q: Floats, before: Floats) -> Mask:
    """Whether a singularity lies between readings (n, N) and others (n, N) before them, (n,).

    One within EDGE_RAD of either does not count: rounded readings do not tell on which side of it they are.
    """
    return np.asarray(_crossings(inverse, q, before).any(axis=1))


def strayed(inverse: Inverse, q: Floats, before: Floats) -> Mask:
    """Of solutions q (n, N) that the core takes to be on the branch of `before`, which are not, (n,).

    The core looks at the sign of the determinant of the Jacobian, which two singularities bring back. Where a
    single one lies between, the calibrated arm is on the other side of one than the nominal arm. That is this
    one, and the core is right, if this one alone is so near that what is corrected may take a joint over it.
    """
    crossings = _crossings(inverse, q, before)
    found: Mask = np.asarray(crossings.any(axis=1))
    (asked,) = np.nonzero(found)
    if len(asked):
        far = _told(inverse, q[asked], CORRECTION_RAD) & _told(inverse, before[asked], CORRECTION_RAD)
        alone = crossings[asked].sum(axis=1) == 1
        found[asked] = ~alone | (far == crossings[asked]).any(axis=1)
    return found


def starts(inverse: Inverse, base_from_flange: Floats, seeds: Floats, *, nearest: bool) -> Floats:
    """Readings (n, N) of the plain arm from which a search meets its target on the branch of its seed.

    Of an arm with a closed form they are those on that branch, at the turns nearest to the seed; of another
    one those where a search from a seed on no branch ends.

    Args:
        inverse: The plain arm's.
        base_from_flange: Targets (n, 4, 4).
        seeds: Readings (n, N).
        nearest: Whether none of another branch may be nearer to the seed, as on a path, which does not swing.

    Returns:
        The readings; NaN where there are none.
    """
    if inverse.method == NUMERIC:
        return _beyond_edges(inverse, base_from_flange, seeds)
    found, nearest_turns = np.full(seeds.shape, np.nan), NearestTurns(inverse.robot)
    for row, (branches, seed) in enumerate(zip(inverse.branches(base_from_flange), seeds, strict=True)):
        _, turned = nearest_turns(branches[np.isfinite(branches).all(axis=1)], seed)
        turned = turned[np.argsort(np.linalg.norm(turned - seed, axis=1))]
        (same,) = np.nonzero(~crossed(inverse, turned, np.tile(seed, (len(turned), 1))))
        if len(same) and not (nearest and same[0] > 0):
            found[row] = turned[same[0]]
    return found


def beside(inverse: Inverse, seed: Floats) -> Floats:
    """Readings (k, N) on both sides of each singularity whose side the seed (N,) does not tell: so far off
    that the calibrated arm is on both sides of its own, too.
    """
    untold = ~_told(inverse, seed[None])[0]
    if not untold.any():
        return np.empty((0, len(seed)))
    steps = CORRECTION_RAD * np.eye(len(seed))[inverse.robot.revolute]
    ways = np.stack([seed + steps, seed - steps])
    sides = inverse.sides(ways.reshape(-1, len(seed))).reshape(*ways.shape[:2], -1)
    across = (sides[0] != sides[1])[:, untold].any(axis=1)
    return np.asarray(ways[:, across].reshape(-1, len(seed)))


def _crossings(inverse: Inverse, q: Floats, before: Floats) -> Mask:
    """Which sides (n, S) differ between two readings that both tell them."""
    differ: Mask = inverse.sides(q) != inverse.sides(before)
    (asked,) = np.nonzero(differ.any(axis=1))
    if len(asked):
        differ[asked] &= _told(inverse, q[asked]) & _told(inverse, before[asked])
    return differ


def _beyond_edges(inverse: Inverse, base_from_flange: Floats, seeds: Floats) -> Floats:
    """Where searches from those seeds end that do not tell their side, (n, N); NaN for the others."""
    found, edge = np.full(seeds.shape, np.nan), ~_told(inverse, seeds).all(axis=1)
    found[edge] = inverse.near_or_nan(base_from_flange[edge], seeds[edge])
    return found


def _told(inverse: Inverse, q: Floats, by_rad: float = EDGE_RAD) -> Mask:
    """Which sides (n, S) readings (n, N) tell: those that they would tell with any joint `by_rad` away."""
    steps = by_rad * np.eye(q.shape[1])[inverse.robot.revolute]
    around = q[:, None] + np.concatenate([steps, -steps])
    sides = inverse.sides(around.reshape(-1, q.shape[1])).reshape(*around.shape[:2], -1)
    told: Mask = (sides == sides[:, :1]).all(axis=1)
    return told
