"""What stands otherwise from some row on: a target on its tool, a joint, the device or the arm's base.

A target that slips moves along the axes of the flange, a joint turns about its own: neither is the same way
in the world at all poses, so that no displacement of the set-up follows it. What is left of the rows is
asked, for each place in the order of measuring, whether it is explained by such a step from there on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

TARGET: Final = "target"
JOINT: Final = "joint"
FRAME: Final = "frame"
TARGET_SLIPPED: Final = "target_slipped"
JOINT_MOVED: Final = "joint_moved"
SETUP_TURNED: Final = "setup_turned"
STEP_KINDS: Final = (TARGET_SLIPPED, JOINT_MOVED, SETUP_TURNED)
"""Kinds of notices of what stands otherwise from some row on."""
AXES: Final = 3
BESIDE: Final = 5
"""Visits before and behind a step, at the least: fewer are outliers."""
FAINT: Final = 0.01
"""Part of a direction that is left beside what was fitted, below which that imitates it."""


@dataclass(frozen=True, eq=False)
class Left:
    """What a fit leaves of n measured values of one set-up, in the order of measuring.

    Attributes:
        pull: Residuals (n,) over their covariance: what columns are multiplied with for their score.
        metric: Inverse covariance (n, n), without what was fitted: what columns tell beside that.
        alone: The same of noise alone (n, n), of each visit by itself: what they would tell if nothing was.
        visit: Number of the visit of each value (n,), ascending.
        square: Sum of squares of the residuals of all set-ups, in units of their variances.
        freedom: Its degrees of freedom.
    """

    pull: Floats
    metric: Floats
    alone: Floats
    visit: Rows
    square: float
    freedom: float


@dataclass(frozen=True)
class Shape:
    """What may stand otherwise.

    Attributes:
        what: TARGET, JOINT or FRAME.
        numbers: Which targets or joints, from 0.
        columns: Its columns among those that are asked.
    """

    what: str
    numbers: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Step:
    """A step.

    Attributes:
        shape: What stands otherwise.
        place: Number of the first visit behind it, from 0: there it is the whole set-up that differs.
        sizes: By how much (k,), in units of its columns.
        share: Part of the squares that it explains.
        gain: Logarithm of its evidence over that of none.
        chance: How likely chance explains as much somewhere, with something.
    """

    shape: Shape
    place: int
    sizes: Floats
    share: float
    gain: float
    chance: float


def likeliest_step(
    left: Left, columns: Floats, shapes: Sequence[Shape], beside: Sequence[int] = (), *, others: bool = False
) -> Step | None:
    """The step that explains most for how much it may choose; None where there is no room for one.

    It is the score test of generalised least squares: a step is fitted beside all that was fitted, without
    its being searched again, and beside steps of the columns `beside` at the same place, which are told
    elsewhere. Steps of unlike many columns are compared by their evidence (Schwarz 1978).

    Args:
        left: What is left.
        columns: Derivatives (n, p) of the values by what may stand otherwise.
        shapes: What may.
        beside: Columns of what may have moved as well.
        others: Whether there are other set-ups, which the whole of this one may differ from.
    """
    from scipy.special import betaincc  # noqa: PLC0415 - slow to import

    gram, pull, unit = _behind(left, columns)
    places = np.concatenate([[0] * others, np.arange(BESIDE, len(gram) - BESIDE + 1)]).astype(np.int64)
    if not len(places) or left.freedom <= 0.0:
        return None
    gram, pull, unit = gram[places], pull[places], unit[places]
    told, pull, gram, rank_beside = _without(gram, pull, list(beside))
    found: Step | None = None
    for shape in shapes:
        own = list(shape.columns)
        sizes, squares, ranks = _solved(gram[:, own][:, :, own], pull[:, own])
        share = np.clip(squares / np.maximum(left.square - told, squares), 0.0, 1.0)
        free = left.freedom - rank_beside - ranks
        usable = (ranks > 0) & (free > ranks)
        nothing = np.finfo(np.float64).tiny
        gain = -0.5 * (free * np.log(np.maximum(1.0 - share, nothing)) + ranks * np.log(left.freedom))
        gain = np.where(usable, gain, -np.inf)
        k = int(np.argmax(gain))
        if not np.isfinite(gain[k]) or (found is not None and gain[k] <= found.gain):
            continue
        chance = float(betaincc(0.5 * ranks[k], 0.5 * free[k], share[k])) * len(places) * len(shapes)
        by = sizes[k] / unit[k, own]
        found = Step(shape, int(places[k]), by, float(share[k]), float(gain[k]), min(chance, 1.0))
    return found


def _behind(left: Left, columns: Floats) -> tuple[Floats, Floats, Floats]:
    """Of the columns, zero before each visit, their products (v, p, p) over the metric and (v, p) with the
    pull, in units (v, p) of the columns on its lesser side.
    """
    starts = np.flatnonzero(np.diff(left.visit, prepend=-1))
    ends = np.append(starts[1:], len(left.visit))
    count = columns.shape[1]
    gram, known = np.empty((len(starts), count, count)), np.zeros((count, count))
    pull, square = np.empty((2, len(starts), count))
    for k in reversed(range(len(starts))):
        own, behind = slice(starts[k], ends[k]), slice(ends[k], None)
        here = columns[own]
        across = here.T @ (left.metric[own, behind] @ columns[behind])
        known = known + here.T @ left.metric[own, own] @ here + across + across.T
        gram[k], pull[k] = known, left.pull[own] @ here
        square[k] = (here * (left.alone[own, own] @ here)).sum(axis=0)
    pull, square = (np.cumsum(each[::-1], axis=0)[::-1] for each in (pull, square))
    unit = np.sqrt(np.minimum(square, np.maximum(square[0] - square, 0.0)))
    unit[0] = np.sqrt(square[0])
    unit[unit == 0.0] = 1.0
    return gram / (unit[:, :, None] * unit[:, None]), pull / unit, unit


def _without(gram: Floats, pull: Floats, beside: list[int]) -> tuple[Floats, Floats, Floats, Floats]:
    """What some columns explain (k,), the pull (k, p) and the products (k, p, p) of all beside them, and how
    many of them tell something (k,).
    """
    inverse, rank = _inverse(gram[:, beside][:, :, beside])
    across = gram[:, :, beside] @ inverse
    told = np.einsum("ka,kab,kb->k", pull[:, beside], inverse, pull[:, beside])
    return (
        told,
        pull - np.einsum("kpb,kb->kp", across, pull[:, beside]),
        gram - across @ gram[:, beside],
        rank,
    )


def _solved(gram: Floats, pull: Floats) -> tuple[Floats, Floats, Floats]:
    """Coefficients (k, c), the squares that they explain (k,), and how many directions tell more (k,)."""
    inverse, rank = _inverse(gram)
    sizes = np.einsum("kab,kb->ka", inverse, pull)
    return sizes, np.einsum("ka,ka->k", sizes, pull), rank


def _inverse(gram: Floats) -> tuple[Floats, Floats]:
    """Inverses (k, c, c) along the directions that are not imitated, and how many these are (k,)."""
    values, directions = np.linalg.eigh(gram)
    told = values > FAINT
    scaled = directions * np.where(told, 1.0 / np.where(told, values, 1.0), 0.0)[:, None]
    return scaled @ directions.transpose(0, 2, 1), told.sum(axis=1).astype(np.float64)
