"""The choice of the poses that determine the parameters best."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truearm import kinds
from truearm._core import CoreError, Problem, choose_poses, independent_columns, linearise, setup_jacobian
from truearm.arrays import as_rows
from truearm.errors import UsageError, WorkError, list_names
from truearm.fits.core_set import known_setup, measured_points
from truearm.fits.endpoints import at_tool
from truearm.fits.identified import IdentifiedArm
from truearm.fits.parameters import THETA, D
from truearm.types import Floats

if TYPE_CHECKING:
    from truearm import _core

Criterion = Literal["kappa", "d", "o1", "o2", "o3", "o4", "o5"]

CRITERIA: Final = ("kappa", "d", "o1", "o2", "o3", "o4", "o5")
SHIFT: Final = (D, D, D)
TURN: Final = (THETA, THETA, THETA)


@dataclass(frozen=True)
class ChoiceOptions:
    """How poses are chosen.

    Attributes:
        criterion: "kappa" to minimise the condition number; "o1" to "o5", or "d", to maximise an index.
        limit: Largest condition number of M that is good enough; None for none.
        names: Parameters that are to be determined; all that the pool can determine by default.
        pose: Whether orientation is measured too.
        passes: Passes of the exchange at the most.
        tool: What is measured: a point (3,) in the flange frame or a transform (4, 4) from it; the robot
            file's tool by default.
        starts: From how many starts poses are exchanged; the best end counts. All but the first are drawn.
    """

    criterion: Criterion = "kappa"
    limit: float | None = None
    names: Sequence[str] | None = None
    pose: bool = False
    passes: int = 20
    tool: ArrayLike | None = None
    starts: int = 1

    def __post_init__(self) -> None:
        kinds.settle(self, whole=("passes", "starts"), numbers=("limit",), flags=("pose",))
        kinds.check_values(
            self, choices={"criterion": CRITERIA}, positive=("limit", "starts"), not_negative=("passes",)
        )
        if self.names is not None:
            object.__setattr__(self, "names", kinds.words(self.names, "names"))
            check_some(self.names, "names")


@dataclass(frozen=True, eq=False)
class Choice:
    """Chosen poses.

    Attributes:
        rows: Of the pool (count,).
        before: Indices of the start by name: kappa of M, kappa_normal of M^t M (equation (4) as it is meant),
            o1 to o5, log_det. Rows of M are mm, columns per mm and per 1/300 rad.
        after: The same of the choice.
        exchanges: How often a pose was exchanged.
        well_conditioned: Whether the limit is met; if not, the pool cannot be well conditioned.
    """

    rows: NDArray[np.int64]
    before: dict[str, float]
    after: dict[str, float]
    exchanges: int
    well_conditioned: bool


def choose(
    arm: IdentifiedArm,
    readings: ArrayLike,
    count: int,
    options: ChoiceOptions | None = None,
    *,
    given: ArrayLike | None = None,
) -> Choice:
    """Choose `count` of the poses `readings` (n, N).

    With the arm's frame "world" the parameters are the base row's and the links'; else the unknowns of the
    set-up, world_from_base and the target (its turn too where orientation is measured), are determined along
    with them. Parameters that the pool and the given poses do not determine are left out, unless the options
    name them.

    Args:
        arm: The arm and what of it is unknown.
        readings: The pool.
        count: How many.
        options: Criterion and limit.
        given: Poses (k, N) that are measured anyway.

    Raises:
        UsageError: If there is no such parameter, or `count` is no whole number.
        InputError: If poses are not finite numbers of these shapes.
        WorkError: If the pool is smaller than the choice, the choice too small to determine the unknowns, or
            a parameter that is named is not determined.
    """
    kinds.required(arm, IdentifiedArm, "the arm")
    kinds.check_number(count, "count", Integral)
    chosen = kinds.chosen(ChoiceOptions, options, {})
    pool = _poses(arm, readings)
    if len(pool) < count:
        raise WorkError(
            f"{count} poses are to be chosen from {len(pool)}",
            rule="The pool must be larger than the choice",
            way_out="Draw a larger pool, or choose fewer",
        )
    jacobian, columns = unknowns_jacobian(arm, pool, chosen)
    before = jacobian[:0]
    if given is not None and np.size(given):
        before = unknowns_jacobian(arm, _poses(arm, given), chosen)[0]
    kept = independent_columns(np.concatenate([before, jacobian]), columns)
    if chosen.names is not None:
        _check_determined(arm, columns, kept, setup=len(setup_kinds(arm, pose=chosen.pose)))
    _check_enough(count + len(before), jacobian.shape[1], len(kept))
    how: _core.ChoiceOptions = {
        "columns": [columns[k] for k in kept],
        "criterion": chosen.criterion,
        "limit": chosen.limit,
        "given": np.ascontiguousarray(before[:, :, kept]) if len(before) else None,
        "start": None,
        "passes": chosen.passes,
    }
    wanted, rng = np.ascontiguousarray(jacobian[:, :, kept]), np.random.default_rng(0)
    drawn = [rng.permutation(len(pool))[:count].astype(np.int64) for _ in range(chosen.starts - 1)]
    try:
        ends = [choose_poses(wanted, count, {**how, "start": start}) for start in (None, *drawn)]
    except CoreError as error:
        raise WorkError(str(error)) from error
    best = max(ends, key=lambda end: _merit(end.after, chosen.criterion))
    rows = np.array(best.chosen, dtype=np.int64)
    return Choice(rows, ends[0].before, best.after, best.exchanges, best.well_conditioned)


def _poses(arm: IdentifiedArm, readings: ArrayLike) -> Floats:
    rows, _ = as_rows(readings, arm.robot.joint_count, what=f"joint readings of {arm.robot.name}")
    return rows


def _merit(indices: Mapping[str, float], criterion: Criterion) -> float:
    """What is largest of the best poses."""
    if criterion == "kappa":
        return -indices["kappa"]
    return indices["log_det" if criterion == "d" else criterion]


def check_some(names: Sequence[str], option: str) -> None:
    """Raise UsageError where an option names no parameter, or one twice."""
    if not names or len(set(names)) < len(names):
        raise UsageError(f"{list(names)}", where=option, rule="One parameter or more, each once")


def _check_determined(arm: IdentifiedArm, columns: list[int], kept: Sequence[int], *, setup: int) -> None:
    """Raise WorkError where parameters, which stand behind the set-up, are not among the columns kept."""
    name_of = dict(zip(arm.candidates.columns, arm.candidates.names, strict=True))
    lost = [name_of[columns[k]] for k in sorted(set(range(setup, len(columns))) - set(kept))]
    if lost:
        raise WorkError(
            f"the poses of the pool do not determine {list_names(lost)}",
            where="names",
            rule="The set-up, or parameters before them, can stand for them at every pose",
            way_out="Name others, or draw a pool in which more joints move",
        )


def _check_enough(count: int, values: int, unknowns: int) -> None:
    """Raise WorkError where so many poses, each of so many values, cannot determine the unknowns."""
    if count * values < unknowns:
        raise WorkError(
            f"{count} poses have {count * values} measured values",
            rule=f"{unknowns} unknowns of arm and set-up are to be determined",
            way_out=f"Choose {-(-unknowns // values)} poses or more",
        )


def setup_kinds(arm: IdentifiedArm, *, pose: bool) -> tuple[int, ...]:
    """Kinds of the unknowns of the set-up, none where the world is known.

    They are shift and turn of the base and shift of the target, and its turn where orientation is measured.
    """
    return () if arm.world_is_known else SHIFT + TURN + SHIFT + (TURN if pose else ())


def unknowns_jacobian(
    arm: IdentifiedArm, readings: Floats, options: ChoiceOptions | None = None
) -> tuple[Floats, list[int]]:
    """Derivatives (n, 3 or 6, P) of the tool by the unknowns, and a parameter of each one's kind.

    Args:
        arm: The arm.
        readings: Poses (n, N).
        options: Parameters of the arm, and what is measured; all candidates and a position by default.

    Raises:
        UsageError: If there is no such parameter.
    """
    chosen, candidates = options or ChoiceOptions(), arm.candidates
    pose = chosen.pose
    wanted = list(candidates.columns)
    if chosen.names is not None:
        wanted = sorted({candidates.column(name) for name in chosen.names})
    chain = arm.chain(arm.robot.flange @ at_tool(arm.robot, chosen.tool))
    count = len(readings)
    turned = np.repeat(np.eye(3)[None], count, axis=0) if pose else None
    measured = measured_points(arm.robot.joints_from_readings(readings), np.zeros((count, 3)), turned)
    problem, setup = Problem(chain, measured, wanted, arm.world_is_known), known_setup(np.zeros(3))
    jacobian, _ = linearise(problem, arm.table, setup)
    if arm.world_is_known:
        return jacobian, wanted
    own = setup_jacobian(problem, arm.table, setup)
    return np.concatenate([own, jacobian], axis=2), [*setup_kinds(arm, pose=pose), *wanted]
