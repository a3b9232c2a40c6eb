"""From corrected readings q^c to the numbers that the program is to say, checked by reading them again."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.controller import Controller
from truearm.inverse import Inverse
from truearm.programs.configuration import ANY, Configuration
from truearm.programs.environment import Environment
from truearm.programs.layouts import JointLayout, PoseLayout, of_joints, of_pose
from truearm.programs.program import Program, numbers_of, turned_as_stated
from truearm.programs.solving import AT_ONCE, Solved, are_singular
from truearm.programs.tables import all_ones, run_of
from truearm.programs.uses import Uses
from truearm.robot import Robot
from truearm.turns import with_turns
from truearm.types import Floats, Integers
from truearm.units import MM_PER_METRE

STEPS: Final = 4
ALMOST: Final = 1e-9
MOST_DECIMALS: Final = 17
"""More than a double of some size holds; they come of an exponent."""
AGREES_RAD: Final = 1e-3
NOT_UNIQUE: Final = "no configuration data says its corrected readings and no others"
POSITION: Final = 3
"""How many numbers of a pose, the first ones, are its position."""
POINT_SINGULAR: Final = (
    "the joints that it states lie at a singularity, where those of its correction are not near"
)
CORRECTED_SINGULAR: Final = "its correction ends at a singularity, where a pose does not determine the joints"


@dataclass(frozen=True, eq=False)
class Written:
    """Numbers to write.

    Attributes:
        places: Places of the numbers among all numbers of the program, (m,), ascending.
        values: What to write, in the text's units, (m,).
        decimals: With how many digits behind the point, (m,).
        reasons: Why a target cannot be written, by its number.
        moved_mm: How far the position that each target says moves, (t,); NaN for joint targets and those
            that are not written.
    """

    places: Integers
    values: Floats
    decimals: Integers
    reasons: dict[int, str]
    moved_mm: Floats


def encode_targets(
    program: Program, uses: Uses, solved: Solved, which: Integers, controller: Controller
) -> Written:
    """The numbers of targets `which` (n,) that say their readings.

    Args:
        program: The program.
        uses: How its targets are used.
        solved: What the targets mean, with corrected readings.
        which: Targets to write.
        controller: The controller's model.
    """
    encoder = Encoder(program, uses, controller.robot, controller.inverse)
    points = np.isin(which, list(solved.points)) if solved.points else np.zeros(len(which), dtype=bool)
    for number, layout in enumerate(program.layouts):
        of_layout = program.targets.layout[which] == number
        whole, placed = which[of_layout & ~points], which[of_layout & points]
        for here, environment in _by_environment(program, uses, placed):
            encoder.points(here, layout, environment, solved.q[here])
        if of_pose(layout):
            for here, environment in _by_environment(program, uses, whole):
                encoder.poses(here, layout, environment, solved.q[run_of(here)])
        elif of_joints(layout) and len(whole):
            encoder.joints(whole, layout, solved.q[run_of(whole)])
    return encoder.written()


def _by_environment(program: Program, uses: Uses, which: Integers) -> Iterator[tuple[Integers, Environment]]:
    """Targets `which` (n,) with the environments that they are used in."""
    for number in np.unique(uses.environment[which]).tolist():
        yield which[uses.environment[which] == number], program.environments[number]


class Encoder:
    """Gathers numbers and reasons."""

    def __init__(self, program: Program, uses: Uses, robot: Robot, inverse: Inverse) -> None:
        self.program, self.uses, self.robot, self.inverse = program, uses, robot, inverse
        self.reasons: dict[int, str] = {}
        self._moved_mm: Floats = np.full(len(program.targets), np.nan)
        self._found: list[tuple[Integers, Floats, Integers]] = []

    def joints(self, which: Integers, layout: JointLayout, q: Floats) -> None:
        """Joint targets say q^c itself."""
        self._keep(which, layout, *self.joint_numbers(which, layout, q))

    def poses(self, which: Integers, layout: PoseLayout, environment: Environment, q: Floats) -> None:
        """Cartesian targets say where the controller's model puts the tool at q^c."""
        values, decimals = self.pose_numbers(which, layout, environment, q)
        self._keep(which, layout, values, decimals)
        self._note_moved(which, layout, values)

    def points(
        self, which: Integers, layout: JointLayout | PoseLayout, environment: Environment, q: Floats
    ) -> None:
        """Targets of which only the position counts say where the tool is at q^c, turned as they state."""
        number = int(self.uses.environment[which[0]])
        flange = turned_as_stated(self.program, which, number, self._flange(q), self.robot)
        near = numbers_of(self.program, which, layout)
        if of_joints(layout):
            said, steady = joints_of(self.robot, flange, layout.to_readings(near))
            self.reasons.update(dict.fromkeys(which[~steady].tolist(), POINT_SINGULAR))
            self.joints(which, layout, said)
        elif of_pose(layout):
            width = layout.width - layout.configuration
            values = np.array(near)
            values[:, :width] = layout.from_poses(environment.stored_poses(flange), near[:, :width])
            values[:, POSITION:] = near[:, POSITION:]
            values, decimals = self._rounded(which, layout, values)
            self._keep(which, layout, values, decimals, POSITION)
            self._note_moved(which, layout, values)

    def _flange(self, q: Floats) -> Floats:
        """Where the controller believes the flange (n, 4, 4) at readings (n, N)."""
        return self.robot.flange_chain.pose(np.ascontiguousarray(self.robot.joints_from_readings(q)))

    def _note_moved(self, which: Integers, layout: PoseLayout, values: Floats) -> None:
        """How far the positions of targets move that are written as `values` (n, width)."""
        width = layout.width - layout.configuration
        before = layout.to_poses(numbers_of(self.program, which, layout)[:, :width])
        after = layout.to_poses((values * self._factors(which, layout))[:, :width])
        moved = np.linalg.norm((after - before)[:, :3, 3], axis=1)
        self._moved_mm[which] = np.where(np.isin(which, list(self.reasons)), np.nan, MM_PER_METRE * moved)

    def pose_numbers(
        self, which: Integers, layout: PoseLayout, environment: Environment, q: Floats
    ) -> tuple[Floats, Integers]:
        """Numbers and decimals (n, width) that say readings `q` (n, N) in the manner of targets `which`."""
        pose_width = layout.width - layout.configuration
        near = numbers_of(self.program, which, layout)
        stored = environment.stored_poses(self._flange(q))
        values = np.array(near)
        values[:, :pose_width] = layout.from_poses(stored, near[:, :pose_width])
        values, decimals = self._rounded(which, layout, values)
        again = layout.to_poses((values * self._factors(which, layout))[:, :pose_width])
        flange = environment.flange_poses(again)
        said, steady = joints_of(self.robot, flange, q)
        for target in which[~steady]:
            self.reasons[int(target)] = CORRECTED_SINGULAR
        if layout.configuration and self.program.configuration is not None:
            stated = numbers_of(self.program, which, layout)[:, pose_width:]
            values[:, pose_width:] = self._configured(which, stated, said, flange)
        return values, decimals

    def joint_numbers(self, which: Integers, layout: JointLayout, q: Floats) -> tuple[Floats, Integers]:
        """The same for joint targets."""
        near = numbers_of(self.program, which, layout)
        return self._in_text(which, layout, layout.from_readings(q, near))

    def _configured(self, which: Integers, stated: Floats, said: Floats, flange: Floats) -> Floats:
        """Configuration data (n, C) that tells the readings `said` from all others of the same pose."""
        configuration = self.program.configuration
        if configuration is None:
            return stated
        text = configuration.text_of_digits(configuration.digits(said), stated)
        absent = np.isnan(stated)
        rows = np.flatnonzero(~absent.all(axis=1))
        for start in range(0, len(rows), AT_ONCE):
            some = rows[start : start + AT_ONCE]
            complete = some[(np.isfinite(text[some]) | absent[some]).all(axis=1)]
            alone = self._alone(configuration, said[complete], flange[complete], text[complete])
            for row in np.setdiff1d(some, complete[alone]):
                self.reasons[int(which[row])] = NOT_UNIQUE
        return np.where(absent, np.nan, text)

    def _alone(
        self, configuration: Configuration, said: Floats, flange: Floats, text: Floats
    ) -> NDArray[np.bool_]:
        """Where configuration data (n, C) leaves the controller no readings but `said` (n, N)."""
        if len(said) == 0:
            return np.zeros(0, dtype=bool)
        rows, candidates = with_turns(self.inverse.branches(flange), self.robot)
        if len(candidates) == 0:
            return np.zeros(len(said), dtype=bool)
        wanted = configuration.digits_of_text(text)[rows]
        agrees = ((configuration.digits(candidates) == wanted) | (wanted == ANY)).all(axis=1)
        same = np.abs(candidates - said[rows]).max(axis=1) < AGREES_RAD
        right = np.bincount(rows[agrees & same], minlength=len(said)) > 0
        wrong = np.bincount(rows[agrees & ~same], minlength=len(said)) > 0
        return right & ~wrong

    def _rounded(
        self, which: Integers, layout: JointLayout | PoseLayout, values: Floats
    ) -> tuple[Floats, Integers]:
        """Numbers in the text's units, rounded as they are written, and their decimals, (n, width) each."""
        exact, decimals = self._in_text(which, layout, values)
        scale = 10.0**decimals
        rounded: Floats = np.round(exact * scale) / scale
        return rounded, decimals

    def _in_text(
        self, which: Integers, layout: JointLayout | PoseLayout, values: Floats
    ) -> tuple[Floats, Integers]:
        """Numbers in the text's units, and the decimals to write them with."""
        targets, factors = self.program.targets, self._factors(which, layout)
        least = np.array(layout.least_decimals, dtype=np.int16)
        if not all_ones(factors):
            lost = np.ceil(np.log10(np.abs(factors)) - ALMOST).astype(np.int64)
            values, least = values / factors, np.maximum(least + lost, 0).astype(np.int16)
        stated = np.minimum(targets.of(targets.decimals, which, layout.width), MOST_DECIMALS)
        return values, np.maximum(stated, least)

    def _factors(self, which: Integers, layout: JointLayout | PoseLayout) -> Floats:
        factors: Floats = self.program.targets.of(self.program.targets.factors, which, layout.width)
        return factors

    def _keep(
        self,
        which: Integers,
        layout: JointLayout | PoseLayout,
        values: Floats,
        decimals: Integers,
        count: int | None = None,
    ) -> None:
        """Numbers to write, (n, width), of each target the first `count`, if not all."""
        targets = self.program.targets
        present = targets.of(targets.starts, which, layout.width) >= 0
        if count is not None:
            present[:, count:] = False
        if self.reasons:
            present &= ~np.isin(which, list(self.reasons))[:, None]
        places = targets.numbers(which, layout.width)
        if present.all():
            self._found.append((places.reshape(-1), values.reshape(-1), decimals.reshape(-1)))
        else:
            self._found.append((places[present], values[present], decimals[present]))

    def written(self) -> Written:
        """All that was found, in the order of the numbers."""
        if not self._found:
            nothing = np.empty(0, dtype=np.int64)
            return Written(nothing, np.empty(0), nothing, self.reasons, self._moved_mm)
        if len(self._found) == 1:
            return Written(*self._found[0], self.reasons, self._moved_mm)
        places, values, decimals = (np.concatenate(parts) for parts in zip(*self._found, strict=True))
        order = np.argsort(places, kind="stable")
        return Written(places[order], values[order], decimals[order], self.reasons, self._moved_mm)


def joints_of(robot: Robot, base_from_flange: Floats, near: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Readings (n, N) close to `near` that put the flange at poses (n, 4, 4), and where that is well defined.

    The poses are those of `near` but for the rounding of their numbers, so that a few steps of Newton's
    method are exact.
    """
    q = np.array(near)
    steady = np.ones(len(q), dtype=bool)
    for _ in range(STEPS):
        reached = robot.flange_chain.pose(np.ascontiguousarray(robot.joints_from_readings(q)))
        error = np.empty((len(q), 6))
        error[:, :3] = base_from_flange[:, :3, 3] - reached[:, :3, 3]
        turn = base_from_flange[:, :3, :3] @ np.swapaxes(reached[:, :3, :3], 1, 2)
        error[:, 3:] = 0.5 * np.stack(
            [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]],
            axis=1,
        )
        jacobian = robot.flange_chain.joint_jacobian(
            np.ascontiguousarray(robot.joints_from_readings(q)), pose=True
        )
        step = (np.linalg.pinv(jacobian @ robot.coupling) @ error[:, :, None])[:, :, 0]
        steady &= np.abs(step).max(axis=1) < AGREES_RAD * 10
        q += np.where(steady[:, None], step, 0.0)
    steady &= ~are_singular(robot, q)
    return q, steady
