"""Waypoints on long straight moves, where the arm's error varies between the ends."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from truearm.inverse import Inverse
from truearm.kinds import check_positive
from truearm.programs.encoding import Encoder
from truearm.programs.environment import Environment, Transform, author_of
from truearm.programs.layouts import of_joints, of_pose
from truearm.programs.program import LinearStep, Program, StepTexts
from truearm.programs.tables import NOWHERE, Motion
from truearm.robot import Robot
from truearm.rotations import rigid_inverse
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Bools = NDArray[np.bool_]

MOST_SAMPLES: Final = 4000
WITHIN: Final = 4


@dataclass(frozen=True)
class Spacing:
    """How waypoints are inserted.

    Attributes:
        deviation_m: Largest deviation between two waypoints, as predicted.
        least_m: Least way between two of them, so that blending has room.
    """

    deviation_m: float
    least_m: float

    @classmethod
    def of(cls, deviation_mm: float, least_mm: float) -> "Spacing":
        """From millimetres.

        Raises:
            UsageError: If one of them is not positive.
        """
        for option, value in (("--densify-mm", deviation_mm), ("--least-spacing-mm", least_mm)):
            check_positive(value, option)
        return cls(deviation_mm / MM_PER_METRE, least_mm / MM_PER_METRE)


@dataclass(frozen=True, eq=False)
class Inserted:
    """What densification found.

    Attributes:
        texts: What is inserted, and moves that their language cannot say with waypoints.
        impossible: Moves, by number, that deviate by more and got no waypoints, those included.
    """

    texts: StepTexts
    impossible: tuple[int, ...]


class Densifier:
    """Inserts waypoints before linear moves."""

    def __init__(
        self,
        program: Program,
        models: tuple[Robot, Inverse, Any],
        encoder: Encoder,
        spacing: Spacing,
    ) -> None:
        self._program, self._encoder, self._spacing = program, encoder, spacing
        self._robot, self._inverse, self._compensator = models

    def insert(self, nominal: Floats, changed: Bools) -> Inserted:
        """Waypoints for every linear move between two changed targets, (t, N) readings and (t,)."""
        moves = self._program.moves
        ends = np.stack([moves.before, moves.target], axis=1)
        lines = (moves.motion == Motion.LINEAR) & (moves.before != NOWHERE) & changed[ends].all(axis=1)
        stepped: list[list[LinearStep]] = []
        impossible: list[int] = []
        for move in np.flatnonzero(lines).tolist():
            found = self._between(move, ends[move], nominal[ends[move]])
            if found is None:
                impossible.append(move)
            elif found:
                stepped.append(found)
        texts = self._program.language.linear_steps(self._program, stepped) if stepped else StepTexts()
        return Inserted(texts, tuple(sorted([*impossible, *texts.impossible])))

    def _between(self, move: int, targets: Integers, ends: Floats) -> list[LinearStep] | None:
        """Waypoints before a move; None where it deviates by more and that cannot be helped.

        Args:
            move: Its number.
            targets: Where the arm stands before it, and where it leads, (2,).
            ends: Readings of these, (2, N).
        """
        environment = self._program.environments[int(self._program.moves.environment[move])]
        uses = self._encoder.uses
        start, end = uses.displaced[targets].tolist()
        displacement = uses.displacements[end]
        tool = environment.tool.controller
        poses = self._robot.flange_chain.pose(np.ascontiguousarray(self._robot.joints_from_readings(ends)))
        if start != end:
            poses[0] = rigid_inverse(_moved(displacement)) @ _moved(uses.displacements[start]) @ poses[0]
        line = _line(poses @ tool, self._spacing.least_m)
        if line is None:
            return []
        seeds = ends[0] + np.linspace(0.0, 1.0, len(line))[:, None] * (ends[1] - ends[0])
        nominal = self._inverse.near_or_nan(line @ rigid_inverse(tool), seeds)
        nominal[-1] = ends[-1]
        if start == end:
            nominal[0] = ends[0]
        if np.isnan(nominal).any():
            return None
        found = self._compensator.joints(
            np.ascontiguousarray(nominal),
            tool=environment.tool.true,
            author=author_of(self._robot, environment.tool, displacement),
        )
        if np.asarray(found.refused).any():
            return None
        chosen, enough = _needed(self._written(found.q, environment), self._spacing.deviation_m)
        if not enough:
            return None
        return self._steps(move, environment, found.q[chosen]) if chosen else []

    def _written(self, q: Floats, environment: Environment) -> Floats:
        """Where the controller believes the tool, (n, 3)."""
        robot = self._encoder.robot
        poses = robot.flange_chain.pose(np.ascontiguousarray(robot.joints_from_readings(q)))
        points: Floats = (poses @ environment.tool.controller)[:, :3, 3]
        return points

    def _steps(self, move: int, environment: Environment, q: Floats) -> list[LinearStep] | None:
        """Waypoints that say readings (n, N); None where one cannot be said with certainty.

        A waypoint is written out in numbers, without the offsets that the move's own target has.
        """
        if not environment.places_as_stored:
            return None
        program, moves = self._program, self._program.moves
        target, file = int(moves.target[move]), int(moves.source[move])
        layout = program.layouts[int(program.targets.layout[target])]
        which = np.full(len(q), target)
        if of_pose(layout):
            values, decimals = self._encoder.pose_numbers(which, layout, environment, q)
        elif of_joints(layout):
            values, decimals = self._encoder.joint_numbers(which, layout, q)
        if self._encoder.reasons.pop(target, None) is not None:
            return None
        line, _ = program.sources[file].place(int(moves.at[move]))
        return [
            LinearStep(line, file, move, tuple(row.tolist()), tuple(digits.tolist()))
            for row, digits in zip(values, decimals, strict=True)
        ]


def _moved(displacement: Transform | None) -> Transform:
    return np.eye(4) if displacement is None else displacement


def _line(ends: Floats, least_m: float) -> Floats | None:
    """Poses (n, 4, 4) on the straight line between two, both ends included; None for a short one."""
    length = float(np.linalg.norm(ends[1, :3, 3] - ends[0, :3, 3]))
    count = min(int(length / least_m) * WITHIN, MOST_SAMPLES)
    if count < 2 * WITHIN:
        return None
    along = np.linspace(0.0, 1.0, count + 1)
    poses = np.tile(np.eye(4), (count + 1, 1, 1))
    poses[:, :3, 3] = ends[0, :3, 3] + along[:, None] * (ends[1, :3, 3] - ends[0, :3, 3])
    poses[:, :3, :3] = Slerp([0.0, 1.0], Rotation.from_matrix(ends[:, :3, :3]))(along).as_matrix()
    return poses


def _needed(points: Floats, deviation_m: float) -> tuple[list[int], bool]:
    """Which of the points (n, 3), the ends apart, a chain of straight lines needs, and whether they suffice.

    Equal steps lie between the points, WITHIN of them in the least spacing, so a line from point i to point j
    passes each point between at an equal share of its way.
    """
    chosen: list[int] = []
    start, last = 0, len(points) - 1
    while True:
        end = _farthest(points, start, deviation_m)
        if end is None:
            return chosen, False
        if end == last:
            return chosen, True
        chosen.append(end)
        start = end


def _farthest(points: Floats, start: int, deviation_m: float) -> int | None:
    """The last point to which a straight line from `start` stays within the deviation; None without one."""
    last = len(points) - 1
    if _deviation(points[start:]) <= deviation_m:
        return last
    low, high = start + WITHIN, last - WITHIN
    if high < low or _deviation(points[start : low + 1]) > deviation_m:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        if _deviation(points[start : middle + 1]) <= deviation_m:
            low = middle
        else:
            high = middle
    return low


def _deviation(points: Floats) -> float:
    share = np.linspace(0.0, 1.0, len(points))[:, None]
    straight = points[0] + share * (points[-1] - points[0])
    return float(np.linalg.norm(points - straight, axis=1).max())
