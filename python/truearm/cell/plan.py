"""Which poses to measure: those that determine most, others to judge by, and some twice, in a good order."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.cell.cell_file import Cell
from truearm.cell.ordering import motion_seconds, paper_order, short_order
from truearm.cell.poses_file import Poses
from truearm.cell.prediction import Prediction
from truearm.cell.rehearsal import problem_of
from truearm.cell.session import Step
from truearm.errors import WorkError
from truearm.identified import IdentifiedArm
from truearm.planning.choosing import Choice, ChoiceOptions, Criterion, choose, unknowns_jacobian
from truearm.robot import Robot

Floats = NDArray[np.float64]

POOL_PER_POSE: Final = 12
POOL_PER_NUMBER: Final = 3
LEAST_POOL: Final = 400
MOST_DRAWS: Final = 200_000
UNLIMITED_RAD: Final = np.pi
JUDGED_SHARE, REPEATED_SHARE, LEAST_JUDGED, LEAST_REPEATED = 0.25, 0.1, 5, 3
JOINT_SPEED_RAD_S: Final = 1.0
PRIOR_M: Final = 2e-3
LEVER_M: Final = 1.0
FREE: Final = 1e3


@dataclass(frozen=True)
class PlanOptions:
    """What is planned.

    Attributes:
        count: Poses to fit to.
        criterion: What of their Jacobian is best.
        seed: Seed of the pool.
        order: "short" or "paper".
        sigma_mm: Standard deviation of a measured coordinate, for the expected accuracy.
    """

    count: int = 60
    criterion: Criterion = "d"
    seed: int = 0
    order: str = "short"
    sigma_mm: float = 0.1


@dataclass(frozen=True, eq=False)
class Plan:
    """Poses in their order, and what is expected of them.

    Attributes:
        poses: With purpose "train", "validate" or "repeat", and alternating directions of approach.
        points: Targets in the base frame (n, 3), m.
        choice: What the choice did to the indices.
        seconds: Motion time in the paper's and in the short order.
        expected: Expected standard deviation of the calibrated position over the pool, mm, by number.
    """

    poses: Poses
    points: Floats
    choice: Choice
    seconds: dict[str, float]
    expected: dict[int, float]


def plan_poses(
    arm: Robot, options: PlanOptions, *, cell: Cell | None = None, numbers: Sequence[int] = ()
) -> Plan:
    """Plan a measurement.

    Args:
        arm: The nominal arm.
        options: How many, and what is best.
        cell: Cell whose sensor has to reach the poses; joint limits alone without one.
        numbers: Numbers of poses of which the expected accuracy is asked for.

    Raises:
        WorkError: If the sensor reaches too few poses.
    """
    flange_from_target = arm.tool if cell is None else cell.flange_from_target
    size = max(LEAST_POOL, POOL_PER_POSE * options.count, POOL_PER_NUMBER * max(numbers, default=0))
    pool = _pool(arm, cell, size, options.seed)
    wanted = ChoiceOptions(criterion=options.criterion, tool=flange_from_target)
    identified = IdentifiedArm(arm)
    choice = choose(identified, pool, options.count, wanted)
    rows, purposes = _with_others(pool, choice.rows)
    points = _targets(arm, pool[rows], flange_from_target)
    orders = {
        "paper": paper_order(points),
        "short": short_order(points, pool[rows], JOINT_SPEED_RAD_S),
    }
    order = orders[options.order]
    readings = pool[rows][order]
    approach = np.where(np.arange(len(order)) % 2 == 0, 1, -1)
    return Plan(
        Poses(readings, approach, tuple(purposes[k] for k in order)),
        points[order],
        choice,
        {name: motion_seconds(pool[rows], each, JOINT_SPEED_RAD_S) for name, each in orders.items()},
        {n: expected_mm(identified, pool, n, wanted, options.sigma_mm) for n in numbers},
    )


def expected_mm(
    arm: IdentifiedArm, pool: Floats, count: int, wanted: ChoiceOptions, sigma_mm: float
) -> float:
    """Root mean square of the standard deviation of the position of the target over the pool, mm.

    Of the constant model, for `count` well chosen poses with noise `sigma_mm` in each coordinate, under the
    default priors of the parameters and none on the set-up.
    """
    chosen = choose(arm, pool, count, wanted).rows
    jacobian, _ = unknowns_jacobian(arm, pool, wanted)
    links = jacobian.shape[2] - (0 if arm.world_is_known else SETUP_UNKNOWNS)
    prior = np.concatenate([np.full(jacobian.shape[2] - links, FREE), np.full(links, PRIOR_M)])
    scaled = jacobian * prior
    rows = scaled[chosen].reshape(-1, scaled.shape[2]) / (1e-3 * sigma_mm)
    information = rows.T @ rows + np.eye(scaled.shape[2])
    spread = np.linalg.solve(np.linalg.cholesky(information), scaled.reshape(-1, scaled.shape[2]).T)
    return float(1e3 * np.sqrt(np.square(spread).sum() / len(pool)))


SETUP_UNKNOWNS: Final = 9


def _pool(arm: Robot, cell: Cell | None, size: int, seed: int) -> Floats:
    """Readings (size, N) drawn evenly within the limits, all of which can be measured."""
    rng = np.random.default_rng(seed)
    low, high = np.clip(arm.limits.T, -UNLIMITED_RAD, UNLIMITED_RAD)
    prediction = None if cell is None else Prediction(cell)
    found: list[Floats] = []
    for drawn in range(MOST_DRAWS):
        readings = rng.uniform(low, high)
        step = Step(0, "pose", 0, "", 0, readings)
        if cell is None or prediction is None or not problem_of(cell, prediction, step):
            found.append(readings)
        if len(found) == size:
            return np.array(found)
        if drawn == MOST_DRAWS // 10 and len(found) < size // 100:
            break
    raise WorkError(
        f"{len(found)} of {MOST_DRAWS} random poses can be measured",
        rule=f"A pool of {size} is needed",
        way_out="Look at [world], [target] and the sensor's range in the cell file, or ask for fewer poses",
    )


def _with_others(pool: Floats, chosen: NDArray[np.int64]) -> tuple[NDArray[np.int64], list[str]]:
    """Rows of the pool: chosen ones, others spread over the space, and some of the chosen ones once more."""
    judged = _spread(pool, chosen, max(LEAST_JUDGED, round(JUDGED_SHARE * len(chosen))))
    again = chosen[:: max(1, len(chosen) // max(LEAST_REPEATED, round(REPEATED_SHARE * len(chosen))))]
    purposes = ["train"] * len(chosen) + ["validate"] * len(judged) + ["repeat"] * len(again)
    return np.concatenate([chosen, judged, again]), purposes


def _spread(pool: Floats, taken: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Rows far from one another, each the farthest from those before; none of the taken ones."""
    free = np.setdiff1d(np.arange(len(pool)), taken)
    span = np.ptp(pool, axis=0)
    scaled = pool[free] / np.where(span > 0.0, span, 1.0)
    picked = [int(np.argmin(np.linalg.norm(scaled - scaled.mean(axis=0), axis=1)))]
    nearest = np.full(len(free), np.inf)
    for _ in range(min(count, len(free)) - 1):
        nearest = np.minimum(nearest, np.linalg.norm(scaled - scaled[picked[-1]], axis=1))
        picked.append(int(np.argmax(nearest)))
    return free[picked]


def _targets(arm: Robot, readings: Floats, flange_from_target: Floats) -> Floats:
    poses = arm.flange_chain.pose(arm.joints_from_readings(readings)) @ flange_from_target
    return np.asarray(poses[:, :3, 3])
