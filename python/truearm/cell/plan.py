"""Which poses to measure: those that determine most, others to judge by, and some again, in a good order."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.cell.cell_file import Cell
from truearm.cell.motion import Motion, Passage
from truearm.cell.ordering import motion_seconds, paper_order, short_order, there_and_back
from truearm.cell.poses_file import Poses
from truearm.cell.prediction import Prediction
from truearm.cell.reaching import within_reach
from truearm.cell.rehearsal import problem_of
from truearm.cell.session import Step
from truearm.defaults import THERE_AND_BACK
from truearm.description.one_turn import one_turn
from truearm.errors import UsageError, WorkError, count_of
from truearm.fits.identified import IdentifiedArm
from truearm.kinds import check_values, settle
from truearm.planning.accessibility import Rule
from truearm.planning.choosing import (
    CRITERIA,
    Choice,
    ChoiceOptions,
    Criterion,
    choose,
    setup_kinds,
    unknowns_jacobian,
)
from truearm.planning.spreading import fill
from truearm.robot import Robot
from truearm.tables.columns import REPEAT, VALIDATE
from truearm.types import Floats
from truearm.units import MM_PER_METRE

CHOICES: Final = 4
"""How often poses are chosen where the arm does not get to some of them."""
STARTS: Final = 3
"""From so many starts poses are exchanged: of 20 poses of the RV-M2 o4 is a tenth larger than from one."""
HUBS: Final = 4
"""From so many poses, from the middle on, the others of a pool are to have a way."""
DRAWN_AT_ONCE: Final = 200
POOL_PER_POSE: Final = 12
POOL_PER_NUMBER: Final = 3
LEAST_POOL: Final = 400
MOST_TOLD: Final = 1000
"""Poses of which the expected accuracy is told in a second; of more it takes as long as the choice itself."""
MOST_DRAWS: Final = 200_000
OF_CELL: Final = "[world], [target] and the sensor's range in the cell file, at "
NONE_HELD: Final[Mapping[int, float]] = MappingProxyType({})
JUDGED_SHARE, REPEATED_SHARE, LEAST_JUDGED, LEAST_REPEATED = 0.25, 0.1, 5, 3
JOINT_SPEED_RAD_S: Final = 1.0
PRIOR_M: Final = 2e-3
FREE: Final = 1e3
ORDERS: Final = (THERE_AND_BACK, "short", "paper")


@dataclass(frozen=True)
class PlanOptions:
    """What is planned.

    Attributes:
        count: Poses to fit to.
        criterion: What of their Jacobian is best.
        seed: Seed of the pool.
        order: "there-and-back", "short" or "paper".
        sigma_mm: Standard deviation of a measured coordinate, for the expected accuracy.
        rules: What every pose has to keep to, of truearm.planning.accessibility or functions like these.
        link_radius_mm: Half the thickness of links that are not to meet; 0 where they may, the cell's, or 40,
            by default.
    """

    count: int = 60
    criterion: Criterion = "d"
    seed: int = 0
    order: str = THERE_AND_BACK
    sigma_mm: float = 0.1
    rules: tuple[Rule, ...] = ()
    link_radius_mm: float | None = None

    def __post_init__(self) -> None:
        settle(self, whole=("count", "seed"), numbers=("sigma_mm", "link_radius_mm"))
        choices = {"order": ORDERS, "criterion": CRITERIA}
        not_negative = ("seed", "link_radius_mm")
        check_values(self, choices=choices, sizes=("sigma_mm",), not_negative=not_negative)
        if self.count < 1:
            raise UsageError(count_of(self.count, "pose"), rule="At least one is planned")


@dataclass(frozen=True, eq=False)
class Plan:
    """Poses in their order, and what is expected of them.

    Attributes:
        poses: With purpose "train", "validate" or "repeat", and alternating directions of approach.
        points: Targets in the base frame (n, 3), m.
        choice: What the choice did to the indices.
        seconds: Time of the motions of the joints in each order by name, with the poses that are repeated.
        expected: Expected standard deviation of the calibrated position over the pool, mm, by number.
        passage: How the arm gets from pose to pose.
    """

    poses: Poses
    points: Floats
    choice: Choice
    seconds: dict[str, float]
    expected: dict[int, float]
    passage: Passage


def plan_poses(
    arm: Robot, options: PlanOptions, *, cell: Cell | None = None, numbers: Sequence[int] = ()
) -> Plan:
    """Plan a measurement.

    Args:
        arm: The nominal arm.
        options: How many, and what is best.
        cell: Cell whose sensor has to reach the poses; joint limits and rules alone without one.
        numbers: Numbers of poses of which the expected accuracy is asked for, beside that of the options
            up to a thousand; without any it is not.

    Raises:
        WorkError: If the sensor reaches too few poses, or rules allow too few.
    """
    flange_from_target = arm.tool if cell is None else cell.flange_from_target
    size = max(LEAST_POOL, POOL_PER_POSE * options.count, POOL_PER_NUMBER * max(numbers, default=0))
    motion = Motion.of(arm, cell, options.rules, [flange_from_target], options.link_radius_mm)
    pool = measurable_pool(motion, size, options.seed)
    wanted = ChoiceOptions(criterion=options.criterion, tool=flange_from_target)
    identified, asked = IdentifiedArm(arm), [options.count] if options.count <= MOST_TOLD else []
    told = sorted({*numbers, *asked}) if numbers else []
    arranged = _arranged(identified, pool, options, wanted, motion)
    poses = arranged.orders[options.order]
    return Plan(
        poses,
        targets_of(arm, poses.readings, flange_from_target),
        arranged.choice,
        {name: seconds_of(each) for name, each in arranged.orders.items()},
        {n: expected_mm(identified, pool, n, wanted, options.sigma_mm) for n in told},
        motion.passage(poses, arranged.unreached),
    )


@dataclass(frozen=True, eq=False)
class _Arranged:
    """A choice, its poses in each order by name, and those (from 0) of the wanted one without a way."""

    choice: Choice
    orders: dict[str, Poses]
    unreached: list[int]


def _arranged(
    arm: IdentifiedArm, pool: Floats, options: PlanOptions, wanted: ChoiceOptions, motion: Motion
) -> _Arranged:
    """Choose and order poses of a pool; others come in the place of those to which there is no way."""
    repeats = min(max(LEAST_REPEATED, round(REPEATED_SHARE * options.count)), options.count)
    for last in [*[False] * (CHOICES - 1), True]:
        choice = choose(arm, pool, options.count, replace(wanted, starts=STARTS))
        rows, purposes = _with_others(pool, choice.rows)
        points = targets_of(arm.robot, pool[rows], motion.tools[0])
        orders = {
            name: in_order(pool[rows], purposes, order, repeats)[0]
            for name, order in orders_of(points, pool[rows]).items()
        }
        orders[options.order], unreached = within_reach(motion, orders[options.order])
        if last or not unreached:
            break
        pool = _with_ways(pool, orders[options.order].readings, unreached, motion)
    return _Arranged(choice, orders, unreached)


def _with_ways(pool: Floats, readings: Floats, unreached: list[int], motion: Motion) -> Floats:
    """Poses of a pool without those of the readings (n, N) that are not reached.

    Where no table is on the way, without those too that seem to have no way from any of a few of the others.
    """
    pool = pool[~(pool[:, None] == readings[unreached]).all(axis=2).any(axis=1)]
    reached = np.delete(readings, unreached, axis=0)
    if motion.passes_table or not len(reached):
        return pool
    ways = [motion.ways.seem_clear(pool, reached[row]) for row in fill(reached, HUBS)]
    return pool[np.any(ways, axis=0)]


def seconds_of(poses: Poses) -> float:
    """Time of the motions of the joints from pose to pose, s."""
    return motion_seconds(poses.readings, np.arange(len(poses)), JOINT_SPEED_RAD_S)


def orders_of(points: Floats, readings: Floats) -> dict[str, NDArray[np.int64]]:
    """The orders of targets (n, 3) and readings (n, N) by name."""
    short = short_order(points, readings, JOINT_SPEED_RAD_S)
    return dict(zip(ORDERS, (there_and_back(short), short, paper_order(points)), strict=True))


def expected_mm(
    arm: IdentifiedArm, pool: Floats, count: int, wanted: ChoiceOptions, sigma_mm: float
) -> float:
    """Root mean square of the standard deviation of the position of the target over the pool, mm.

    Of the constant model, for `count` well chosen poses with noise `sigma_mm` in each coordinate, under the
    default priors of the parameters and none on the set-up.
    """
    chosen = choose(arm, pool, count, wanted).rows
    jacobian, _ = unknowns_jacobian(arm, pool, wanted)
    links = jacobian.shape[2] - len(setup_kinds(arm, pose=wanted.pose))
    prior = np.concatenate([np.full(jacobian.shape[2] - links, FREE), np.full(links, PRIOR_M)])
    scaled = jacobian * prior
    rows = scaled[chosen].reshape(-1, scaled.shape[2]) / (1e-3 * sigma_mm)
    # Of what the poses do not tell normal equations lose the prior in rounding; this root keeps it.
    root = np.linalg.qr(np.vstack([rows, np.eye(scaled.shape[2])])).R
    spread = np.linalg.solve(root.T, scaled.reshape(-1, scaled.shape[2]).T)
    return float(MM_PER_METRE * np.sqrt(np.square(spread).sum() / len(pool)))


def measurable_pool(motion: Motion, size: int, seed: int, held: Mapping[int, float] = NONE_HELD) -> Floats:
    """Readings (size, N) drawn evenly within the limits, all of which keep to the rules and can be measured.

    Joints start beside them within the limits, from either side. Those in `held`, by their number from 1, are
    held at readings, rad or m.

    Raises:
        WorkError: If there are too few.
    """
    cell = motion.cell
    prediction = None if cell is None else Prediction(cell)
    found: list[Floats] = []
    drawn = 0
    for block in _drawn(motion, seed, held):
        for readings in block[motion.allowed(block)]:
            step = Step(0, "pose", 0, "", 0, readings)
            if cell is None or prediction is None or not problem_of(cell, prediction, step):
                found.append(readings)
            if len(found) == size:
                return np.array(found)
        drawn += len(block)
        if drawn >= MOST_DRAWS // 10 and len(found) < size // 100:
            break
    raise WorkError(
        f"{len(found)} of {drawn} random poses can be measured",
        rule=f"A pool of {size} is needed{_told_of_rules(motion, seed, held)}",
        way_out=f"Look at {'' if cell is None else OF_CELL}--floor-mm, --box-mm, --link-radius-mm and the "
        "joints' limits, or ask for fewer poses",
    )


def _told_of_rules(motion: Motion, seed: int, held: Mapping[int, float]) -> str:
    """What each rule alone makes of the first poses that are drawn, in words; "" where there are no rules."""
    first = next(_drawn(motion, seed, held))
    told = ", ".join(f"{name} {count}" for name, count in motion.allowed_by_each(first))
    return told and f"; of {len(first)} of them each rule alone allows: {told}"


def _drawn(motion: Motion, seed: int, held: Mapping[int, float]) -> Iterator[Floats]:
    """Readings (DRAWN_AT_ONCE, N) within the limits and one turn, or as held, MOST_DRAWS in all."""
    rng, arm = np.random.default_rng(seed), motion.arm
    low, high = motion.run_up.room(*one_turn(arm))
    for _ in range(MOST_DRAWS // DRAWN_AT_ONCE):
        block = rng.uniform(low, high, (DRAWN_AT_ONCE, arm.joint_count))
        for joint, reading in held.items():
            block[:, joint - 1] = reading
        yield block


def _with_others(pool: Floats, chosen: NDArray[np.int64]) -> tuple[NDArray[np.int64], list[str]]:
    """Rows of the pool: chosen ones, and others spread over the space."""
    free = np.setdiff1d(np.arange(len(pool)), chosen)
    judged = free[fill(pool[free], max(LEAST_JUDGED, round(JUDGED_SHARE * len(chosen))))]
    return np.concatenate([chosen, judged]), ["train"] * len(chosen) + [VALIDATE] * len(judged)


def in_order(
    readings: Floats, purposes: Sequence[str], order: NDArray[np.int64], repeats: int
) -> tuple[Poses, NDArray[np.int64]]:
    """Poses in an order, approached from both sides in turn, and some of them three times.

    A repeated pose is approached from the other side at once, which shows hysteresis before anything drifts;
    and at the end from its first side, which shows repeatability and warm-up.

    Args:
        readings: Of the poses (n, N).
        purposes: Of the poses.
        order: In which they are measured (n,).
        repeats: How many poses are repeated, spread evenly over the order of those that train.

    Returns:
        The poses, and the number of each in `readings`.
    """
    sides = np.where(np.arange(len(order)) % 2 == 0, 1, -1)
    trained = [k for k, pose in enumerate(order) if purposes[pose] == "train"]
    again = {trained[k] for k in np.linspace(0, len(trained) - 1, repeats).round().astype(int)}
    steps: list[tuple[int, int, str]] = []
    for k, pose in enumerate(order):
        steps.append((int(pose), int(sides[k]), purposes[pose]))
        if k in again:
            steps.append((int(pose), -int(sides[k]), REPEAT))
    steps += [(int(order[k]), int(sides[k]), REPEAT) for k in sorted(again)]
    rows = np.array([step[0] for step in steps], dtype=np.int64)
    approach = np.array([step[1] for step in steps], dtype=np.int64)
    return Poses(readings[rows], approach, tuple(step[2] for step in steps)), rows


def targets_of(arm: Robot, readings: Floats, flange_from_target: Floats) -> Floats:
    """Target points (n, 3) in the base frame at readings (n, N)."""
    poses = arm.flange_chain.pose(arm.joints_from_readings(readings)) @ flange_from_target
    return np.asarray(poses[:, :3, 3])
