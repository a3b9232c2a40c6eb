"""What stands otherwise from some row on: a target on its tool, a joint, the device, a scale.

A target that slips moves along the axes of the flange, a joint turns about its own, and what an instrument of
another scale measures, or an arm that is warmer reaches, lies farther apart: neither is the same way in the
world at all poses, so that no displacement of the set-up follows it. What is left of the rows is asked, for
each place in the order of measuring, whether it is explained by such a step from there on.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.types import AXES, Floats, Rows

TARGET: Final = "target"
JOINT: Final = "joint"
FRAME: Final = "frame"
SCALE: Final = "scale"
TARGET_SLIPPED: Final = "target_slipped"
JOINT_MOVED: Final = "joint_moved"
SETUP_TURNED: Final = "setup_turned"
SCALE_DIFFERS: Final = "scale_differs"
STEP_KINDS: Final = (TARGET_SLIPPED, JOINT_MOVED, SETUP_TURNED, SCALE_DIFFERS)
"""Kinds of notices of what stands otherwise from some row on."""
BESIDE: Final = 5
"""Visits before and behind a step, at the least: fewer are outliers."""
FAINT: Final = 0.01
"""Part of a direction that is left beside what was fitted, below which that imitates it."""
NOTHING: Final = 1e-9
"""Part of what columns tell by themselves, below which a direction of several is none."""
NEARLY_NONE: Final = float(np.finfo(np.float64).tiny)
"""What numbers are divided by at the least, and have a logarithm of."""


@dataclass(frozen=True, eq=False)
class Left:
    """What a fit leaves of n measured values of one set-up, in the order of measuring.

    Attributes:
        pull: Residuals (n,) over their covariance: what columns are multiplied with for their score.
        metric: Inverse covariance (n, n), without what was fitted: what columns tell beside that.
        alone: The same of noise alone (n, n): what they would tell if nothing was.
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
        what: TARGET, JOINT, FRAME or SCALE.
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
        tries: How many places and ways were asked for it.
        chance: How likely chance explains as much somewhere, with something.
    """

    shape: Shape
    place: int
    sizes: Floats
    share: float
    gain: float
    tries: int
    chance: float


def evidence(share: Floats, ranks: Floats, freedom: Floats | float, values: float) -> Floats:
    """Logarithm of the evidence of explanations over that of none (Schwarz 1978), -inf where there is none.

    Args:
        share: Part of the squares that each explains (k,).
        ranks: How many directions it has (k,).
        freedom: Degrees of freedom that it leaves (k,).
        values: Those of the residuals.
    """
    gain = -0.5 * (freedom * np.log(np.maximum(1.0 - share, NEARLY_NONE)) + ranks * np.log(values))
    return np.where((ranks > 0) & (freedom > ranks), gain, -np.inf)


def likeliest_step(
    left: Left, columns: Floats, shapes: Sequence[Shape], beside: Sequence[int] = (), *, others: bool = False
) -> Step | None:
    """The step that explains most for how much it may choose; None where there is no room for one.

    It is the score test of generalised least squares: a step is fitted beside all that was fitted, without
    its being searched again, and beside steps of the columns `beside` at the same place, which are told
    elsewhere. Steps of unlike many columns are compared by their evidence. Several targets
    step each by itself or, on a tool that moves, all alike.

    Args:
        left: What is left.
        columns: Derivatives (n, p) of the values by what may stand otherwise.
        shapes: What may.
        beside: Columns of what may have moved as well.
        others: Whether there are other set-ups, which the whole of this one may differ from.
    """
    from scipy.special import betaincc  # noqa: PLC0415 - slow to import

    gram, pull, alone = _behind(left, columns)
    places = np.concatenate([[0] * others, np.arange(BESIDE, len(gram) - BESIDE + 1)]).astype(np.int64)
    if not len(places) or left.freedom <= 0.0:
        return None
    gram, pull, alone = gram[places], pull[places], alone[places]
    told, pull, gram, rank_beside = _without(gram, pull, alone, list(beside))
    found: Step | None = None
    ways = [(shape, along) for shape in shapes for along in _ways(shape)]
    tries = len(places) * len(ways)
    for shape, along in ways:
        own = list(shape.columns)
        gram_along, alone_along = (along.T @ each[:, own][:, :, own] @ along for each in (gram, alone))
        sizes, squares, ranks = _solved(gram_along, pull[:, own] @ along, alone_along)
        share = squares / np.maximum(np.maximum(left.square - told, squares), NEARLY_NONE)
        free = left.freedom - rank_beside - ranks
        gain = evidence(share, ranks, free, left.freedom)
        k = int(np.argmax(gain))
        if not np.isfinite(gain[k]) or (found is not None and gain[k] <= found.gain):
            continue
        chance = float(betaincc(0.5 * ranks[k], 0.5 * free[k], share[k])) * tries
        by, told_by = along @ sizes[k], (float(share[k]), float(gain[k]), tries, min(chance, 1.0))
        found = Step(shape, int(places[k]), by, *told_by)
    return found


def _ways(shape: Shape) -> Iterator[Floats]:
    """Directions (c, r) of its columns that a shape may step along: all of them, and targets all alike."""
    yield np.eye(len(shape.columns))
    count, others = len(shape.numbers), len(shape.columns) - AXES * len(shape.numbers)
    if shape.what == TARGET and count > 1 and others >= 0:
        alike = np.zeros((len(shape.columns), AXES + others))
        alike[: AXES * count, :AXES] = np.tile(np.eye(AXES), (count, 1))
        alike[AXES * count :, AXES:] = np.eye(others)
        yield alike


def _behind(left: Left, columns: Floats) -> tuple[Floats, Floats, Floats]:
    """Of the columns, zero before each visit, their products (v, p, p) over the metric and (v, p) with the
    pull; and what noise alone would tell (v, p, p) of a step there, were only the columns' level fitted.
    """
    starts = np.flatnonzero(np.diff(left.visit, prepend=-1))
    pull = _from_there(columns * left.pull[:, None], starts)
    whole = columns.T @ left.alone @ columns
    level = _from_there(columns[:, :, None] * (left.alone @ columns)[:, None], starts)
    told = level @ np.linalg.pinv(whole, hermitian=True) @ level.transpose(0, 2, 1)
    alone = _products(left.alone, columns, starts) - told
    alone[0] = whole
    return _products(left.metric, columns, starts), pull, 0.5 * (alone + alone.transpose(0, 2, 1))


def _from_there(values: Floats, starts: Rows) -> Floats:
    """Sums (v, ...) of values (n, ...) from the first of each visit on."""
    return np.cumsum(np.add.reduceat(values, starts)[::-1], axis=0)[::-1]


def _products(matrix: Floats, columns: Floats, starts: Rows) -> Floats:
    """Products (v, p, p) over a matrix (n, n) of columns (n, p) that are zero before each visit."""
    found, known = np.empty((len(starts), *columns.shape[1:] * 2)), np.zeros(columns.shape[1:] * 2)
    ends = np.append(starts[1:], len(columns))
    for k in reversed(range(len(starts))):
        own, behind = slice(starts[k], ends[k]), slice(ends[k], None)
        here = columns[own]
        across = here.T @ (matrix[own, behind] @ columns[behind])
        known = known + here.T @ matrix[own, own] @ here + across + across.T
        found[k] = known
    return found


def _without(
    gram: Floats, pull: Floats, alone: Floats, beside: list[int]
) -> tuple[Floats, Floats, Floats, Floats]:
    """What some columns explain (k,), the pull (k, p) and the products (k, p, p) of all beside them, and how
    many of them tell something (k,).
    """
    inverse, rank = _inverse(gram[:, beside][:, :, beside], alone[:, beside][:, :, beside])
    across = gram[:, :, beside] @ inverse
    told = np.einsum("ka,kab,kb->k", pull[:, beside], inverse, pull[:, beside])
    return (
        told,
        pull - np.einsum("kpb,kb->kp", across, pull[:, beside]),
        gram - across @ gram[:, beside],
        rank,
    )


def _solved(gram: Floats, pull: Floats, alone: Floats) -> tuple[Floats, Floats, Floats]:
    """Coefficients (k, c), the squares that they explain (k,), and how many directions tell more (k,)."""
    inverse, rank = _inverse(gram, alone)
    sizes = np.einsum("kab,kb->ka", inverse, pull)
    return sizes, np.einsum("ka,ka->k", sizes, pull), rank


def _inverse(gram: Floats, alone: Floats) -> tuple[Floats, Floats]:
    """Inverses (k, c, c) along the directions that are not imitated, and how many these are (k,).

    Imitated is what is told next to nothing of beside what was fitted, of what noise alone (k, c, c) would
    tell: a target is told by its differences to others far better than the shift that all have in common.
    """
    unit = np.sqrt(np.maximum(np.einsum("kaa->ka", alone), 0.0))
    scale = np.where(unit > 0.0, 1.0 / np.where(unit > 0.0, unit, 1.0), 0.0)[:, :, None]
    values, directions = np.linalg.eigh(alone * scale * scale.transpose(0, 2, 1))
    is_one = values > NOTHING
    whitening = scale * directions * np.where(is_one, np.where(is_one, values, 1.0) ** -0.5, 0.0)[:, None]
    values, directions = np.linalg.eigh(whitening.transpose(0, 2, 1) @ gram @ whitening)
    told = values > FAINT
    scaled = directions * np.where(told, np.where(told, values, 1.0) ** -0.5, 0.0)[:, None]
    root = whitening @ scaled
    return root @ root.transpose(0, 2, 1), told.sum(axis=1).astype(np.float64)
