"""New measurements against a calibration: residuals, derivatives, and how they may scatter."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.linalg import block_diag

from truearm._core import Problem, Setup, fit_constant, linearise, setup_jacobian, step_setup
from truearm.calibration import Calibration
from truearm.certainty.uncertainty import FINEST, noises_of, task_of
from truearm.description.dh_row import row_transform
from truearm.fits.core_set import core_set, rotations
from truearm.fits.enough_values import setup_unknowns
from truearm.fits.fitting import Task, core_errors, fit_options
from truearm.fits.known_scale import usual_sigma
from truearm.judgement.judging import model_inputs
from truearm.measurements import Measurements
from truearm.rotations import rigid_inverse, rotation_vector_from_matrix
from truearm.rows.own_sigmas import of_all_targets, own_covariances, sigmas_of_turns
from truearm.rows.visits import pose_numbers
from truearm.types import AXES, Floats, Mask, Rows
from truearm.updating.parts import part_of, places_of
from truearm.updating.revisits import UNSEEN, Apart
from truearm.updating.scale import known_scale, stated_data
from truearm.updating.unknowns import Unknowns, is_part_of

RANK: Final = 1e-9
"""Columns reach no farther than this share of the farthest in directions that they do not have."""


@dataclass(frozen=True, eq=False)
class State:
    """Values of the unknowns: of the arm (a,), and the set-ups."""

    arm: Floats
    setup: Setup


@dataclass(frozen=True, eq=False)
class Linear:
    """R measured values at a state, base frame.

    Attributes:
        residual: Measured minus predicted (R,), m and rad.
        jacobian: Derivatives (R, u) of the prediction by the unknowns.
        departure: How far the unknowns are from where their priors have them (u,).
        visit: Row of each value (R,), a visit to a pose.
        pose: Number of its pose (R,).
        quantity: Number of what it is a measurement of (R,): of visits to a pose the same, unless they
            contradict the calibration.
    """

    residual: Floats
    jacobian: Floats
    departure: Floats
    visit: Rows
    pose: Rows
    quantity: Rows


class Scene:
    """The rows of an update under one model of a calibration.

    Args:
        task: What is measured.
        data: The rows.
        calibration: As it was.
        unknowns: What may have moved.
        about: Set-ups that what is found anew is held at, ever so gently; without them those of `found_free`.
        apart: How far visits to a pose differ.
    """

    def __init__(
        self,
        task: Task,
        data: Measurements,
        calibration: Calibration,
        unknowns: Unknowns,
        about: Setup | None = None,
        apart: Apart = UNSEEN,
    ) -> None:
        model = calibration.model
        self._calibration, self._about = calibration, about
        self.task, self.data, self.unknowns, self.apart = task, data, unknowns, apart
        self.poses = pose_numbers(data.readings, data.group)
        self._known, self._row_of_base = model.setup, model.constants[0]
        if is_part_of(task.selection, calibration.selection):
            self._known = part_of(model.setup, task.selection, calibration.selection)
        self.inputs = model_inputs(task.arm, data, task.options.features)
        self.parameters = model.parameters(self.inputs)
        self._in_passing = self._by_cause()
        self._by_arm = unknowns.directions + self._in_passing
        self.measured = core_set(task.arm.robot, data, task.selection, task.groups)
        self.problem: Problem = task.problem(self.measured, range(task.arm.table.size))
        self.number = np.array([task.groups.index(name) for name in data.group])
        self.orientation = np.array([False] * (3 * len(task.selection.targets)) + [True] * self._turns)
        self.seen = self._seen()

    def first(self) -> State:
        """Nothing moved but what is found anew; all else is where the calibration has it."""
        setup = self._with_known(self.found_free, self.unknowns.anew)
        return State(np.zeros(len(self.unknowns.arm_names)), setup)

    def about(self, setup: Setup | None, apart: Apart) -> "Scene":
        """The same rows, with what is found anew held at other set-ups, and visits so far apart."""
        return Scene(self.task, self.data, self._calibration, self.unknowns, setup, apart)

    def begun(self, state: State) -> "Scene":
        """The same rows, with what is found anew held where it is in a state, and visits to a pose as far
        apart as it leaves them.
        """
        _, residual = linearise(self.problem, self._moved_parameters(state), state.setup)
        noise, stated, finest = (np.diagonal(each, axis1=-2, axis2=-1) for each in self._noise(state))
        variances = np.maximum(noise, finest), stated + finest
        apart = Apart.of(residual, self.seen, self.poses, variances, self.orientation)
        if apart.part >= 1.0 and any(apart.seen):
            expected = np.full(self.seen.shape, np.nan)
            expected[self.seen] = np.diagonal(self.covariance(state))
            apart = apart.limited(expected, self.orientation)
        return self.about(state.setup, apart)

    @property
    def visit_by_visit(self) -> "Scene":
        """The same rows, with visits to a pose that vouch for one another as poses do."""
        apart = self.apart.without_common
        return self if apart == self.apart else self.about(self._about, apart)

    @property
    def pose_count(self) -> int:
        """How many poses the rows are visits to."""
        return len(np.unique(self.poses))

    @cached_property
    def found_free(self) -> Setup:
        """Set-ups that the unchanged arm finds in the rows, whatever is known of them.

        A part that they hardly tell, as a SCARA's height, is metres off where an offset changed.
        """
        with core_errors(self.data):
            options = fit_options(self.task.threads, parameters=self.parameters)
            return fit_constant(self.task.problem(self.measured, []), options).setup

    def unchanged(self, state: State) -> State:
        """The state in which only what says nothing about a change may differ from what was known."""
        return State(np.zeros_like(state.arm), self._with_known(state.setup, self.unknowns.anew))

    def in_passing(self, change: Floats) -> Floats:
        """How parameters (n, L, 5) differ by what of a change (a,) of the arm's unknowns is no constant."""
        return np.asarray((self._in_passing @ change).reshape(self.parameters.shape))

    def moved(self, state: State, step: Floats) -> State:
        """The state after a step (u,)."""
        count = len(state.arm)
        turned = step[count:].reshape(len(self.task.groups), -1)
        return State(state.arm + step[:count], step_setup(self.problem, state.setup, turned))

    def linear(self, state: State) -> Linear:
        """Residuals and derivatives at a state."""
        parameters = self._moved_parameters(state)
        arm, residual = linearise(self.problem, parameters, state.setup)
        jacobian = np.concatenate([arm @ self._by_arm, self._setup_jacobian(state)], axis=2)
        seen = self.seen
        visit, part = np.nonzero(seen)
        pose = np.arange(len(seen)) if self.apart.contradict else self.poses
        _, quantity = np.unique(pose[visit] * seen.shape[1] + part, return_inverse=True)
        departure = self.departure(state)
        return Linear(
            residual[seen], jacobian[seen], departure, visit, self.poses[visit], quantity.reshape(-1)
        )

    def departure(self, state: State) -> Floats:
        """How far the unknowns (u,) of a state are from where their priors have them.

        Those found anew are held, ever so gently, where the search began: rows of few directions do not tell
        all of them, such as the height of a SCARA's device from that of its target.
        """
        about = self.found_free if self._about is None else self._about
        found = np.zeros(len(self.unknowns.std))
        found[: len(state.arm)] = state.arm
        for k, number in enumerate(self.unknowns.known):
            place = self.unknowns.group(k)
            gentle = self._between(about, k, state.setup, k)
            known = gentle if number is None else self._between(self._known, number, state.setup, k)
            found[place] = np.where(self.unknowns.anew[place], gentle, known)
        return found

    def motion(self, state: State, number: int) -> tuple[Floats | None, Floats | None]:
        """How far frame (6,) and tool of set-up `number` are from the calibration's; None where unknown."""
        known = self.unknowns.known[number]
        if known is None:
            return None, None
        moved = self._between(self._known, known, state.setup, number)
        frame = self.task.arm.frame_unknowns
        return (moved[:frame] if frame else None), moved[frame:]

    def base_motion(self, change: Floats) -> Floats:
        """How far (6,) changes (5,) of its row move the base of a known world."""
        convention, row = self.task.arm.robot.convention, self._row_of_base
        return motion_between(row_transform(row, convention), row_transform(row + change, convention))

    def covariance(self, state: State) -> Floats:
        """Covariance (R, R) of the residuals of an unchanged arm, without what is found anew.

        What a frame or tool found anew can make up for is its own: along these directions an arm's parameters
        and the old set-up may be unknown by metres, each known with the other alone (the height of a SCARA
        and of its tool).
        """
        whole = self._calibration.spread.joint(
            self.inputs, self.arm_jacobian(state), self.tied_jacobian(state)
        )
        anew, seen = self.linear(state).jacobian[:, self.unknowns.anew], self.seen.reshape(-1)
        return self._widened**2 * without(whole[np.ix_(seen, seen)], anew) + self.scatter(state)

    def scatter(self, state: State) -> Floats:
        """Covariance (R, R) of what rows show anew: noise, and what the device says of itself.

        What no constants explain, or a joint does not repeat, is partly the pose's: its visits share it.
        """
        noise, stated, finest = self._noise(state)
        seen = self.seen.reshape(-1)
        whole = block_diag(*(self.apart.noise(noise, stated, self.orientation) + finest))
        whole += self.apart.in_common(noise, self.poses)
        return np.asarray(whole[np.ix_(seen, seen)])

    def _noise(self, state: State) -> tuple[Floats, Floats, Floats]:
        """Covariances (n, m, m) of what each row shows anew, the noise and what it states beyond that, and
        the least (m, m) there is.

        Noise of computed rows is next to nothing; that they are off by less than FINEST tells of no arm.
        """
        noise = self._calibration.spread.noise(self.arm_jacobian(state), self.orientation)
        stated = self._stated_beyond_noise(state)
        finest = FINEST**2 * np.eye(len(self.orientation))
        return self._widened**2 * noise, self._widened**2 * stated, finest

    def _stated_beyond_noise(self, state: State) -> Floats:
        """Covariances (n, m, m) of what rows state as their sigma, beyond the noise that holds the device's
        already.

        It does where most of the calibration's own rows stated none: then the larger of both counts. What
        constants alone leave is mostly the arm's, and holds no sigma. Rows that state none are as those of
        the calibration were, whose noise is what they left beyond their own.
        """
        task, details = self.task, self._calibration.variable
        own = stated_data(self._calibration, self.data)
        points = own_covariances(own, task.groups, state.setup.frames)
        turns = np.square(sigmas_of_turns(own))
        learned = self._calibration.learned_from
        if details is not None and learned is not None:
            noises = [details.inflation * noise for noise in noises_of(details.hyper)]
            if usual_sigma(learned.data.stated_sigma_m) == 0.0:
                points *= _beyond(np.square(own.stated_sigma_m), noises[0])[:, None, None]
            if usual_sigma(sigmas_of_turns(learned.data)) == 0.0:
                turns *= _beyond(turns, noises[1])
        stated = np.zeros((len(own), *2 * self.orientation.shape))
        size = AXES * len(task.selection.targets)
        stated[:, :size, :size] = of_all_targets(points, len(task.selection.targets))
        stated[:, self.orientation, self.orientation] = turns[:, None]
        return stated

    @property
    def _widened(self) -> float:
        return known_scale(self._calibration).widened

    def _moved_parameters(self, state: State) -> Floats:
        """Parameters (n, L, 5) of the arm in a state."""
        change = (self._by_arm @ state.arm).reshape(self.parameters.shape)
        return np.ascontiguousarray(self.parameters + change)

    def _by_cause(self) -> Floats:
        """Derivatives (n, 5 L, a) of the chain's parameters by what of the arm's unknowns is no constant."""
        arm, unknowns = self.task.arm, self.unknowns
        found = np.zeros((len(self.data), *unknowns.directions.shape))
        found[:, :, unknowns.caused[: found.shape[2]]] = unknowns.cause.passing(arm, self.data.readings)
        return found

    @property
    def _turns(self) -> int:
        return 3 if self.task.selection.orientation else 0

    def _seen(self) -> Mask:
        """Which values (n, m) were measured."""
        seen = np.repeat(self.data.seen(self.task.selection.targets), 3, axis=1)
        turned = np.isfinite(rotations(self.data)[:, 0, :1])
        return np.hstack([seen, np.repeat(turned, self._turns, axis=1)])

    def _with_known(self, setup: Setup, free: Mask) -> Setup:
        """A set-up with the known parts put in where they are not free."""
        frames, targets, rotations = (part.copy() for part in (setup.frames, setup.targets, setup.rotations))
        known = self._known
        for k, number in enumerate(self.unknowns.known):
            place = self.unknowns.group(k)
            if number is None:
                continue
            frame, tool = self.unknowns.frame[place], self.unknowns.tool[place]
            if frame.any() and not free[place][frame].any():
                frames[k] = known.frames[number]
            if not free[place][tool].any():
                targets[k], rotations[k] = known.targets[number], known.rotations[number]
        return Setup(frames, targets, rotations, setup.anchors)

    def _between(self, before: Setup, number: int, now: Setup, k: int) -> Floats:
        """How far set-up k is from set-up `number` of another state (W,)."""
        parts = []
        if not self.task.arm.world_is_known:
            parts.append(motion_between(before.frames[number], now.frames[k]))
        parts.append((now.targets[k] - before.targets[number]).reshape(-1))
        if self._turns:
            turn = before.rotations[number].T @ now.rotations[k]
            parts.append(rotation_vector_from_matrix(turn))
        return np.concatenate(parts)

    def arm_jacobian(self, state: State) -> Floats:
        """Derivatives (n, m, 5 L) of what rows show by the chain's parameters."""
        return linearise(self.problem, self._moved_parameters(state), state.setup)[0]

    def tied_jacobian(self, state: State) -> Floats:
        """Derivatives (n, m, S') by the calibration's own set-ups, as far as they are not found anew."""
        return self._setup_jacobian(state) @ self.tied

    @cached_property
    def tied(self) -> Floats:
        """One where an unknown of these set-ups is not found anew, but from its place before (S, S')."""
        unknowns, calibration = self.unknowns, self._calibration
        first = len(unknowns.arm_names)
        found = np.zeros((len(unknowns.std) - first, setup_unknowns(task_of(calibration))))
        width = found.shape[1] // len(calibration.groups)
        for k, number in enumerate(unknowns.known):
            if number is not None:
                group = unknowns.group(k)
                rows = np.arange(group.start, group.stop) - first
                columns = places_of(self.task.arm, self.task.selection, calibration.selection)
                found[rows, number * width + columns] = ~unknowns.anew[group]
        return found

    def _setup_jacobian(self, state: State) -> Floats:
        """Derivatives (n, m, S) by the unknowns of all set-ups."""
        own = setup_jacobian(self.problem, self._moved_parameters(state), state.setup)
        chosen = self.number[:, None] == np.arange(len(self.task.groups))
        return np.asarray((own[:, :, None] * chosen[:, None, :, None]).reshape(*own.shape[:2], -1))


def _beyond(squares: Floats, noise: float) -> Floats:
    """Parts (n,) of variances (n,) that are beyond that of a noise."""
    return np.asarray(np.maximum(1.0 - noise**2 / np.where(squares > 0.0, squares, np.inf), 0.0))


def motion_between(before: Floats, after: Floats) -> Floats:
    """How far a frame moved (6,) between two transforms (4, 4): shift in its own axes, rotation vector."""
    between = rigid_inverse(before) @ after
    return np.concatenate([between[:3, 3], rotation_vector_from_matrix(between[:3, :3])])


def without(covariance: Floats, columns: Floats) -> Floats:
    """A covariance (R, R) without its parts along the columns (R, k)."""
    if columns.shape[1] == 0:
        return covariance
    along, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    along = along[:, sizes > RANK * sizes[0]]
    part = along @ (along.T @ covariance)
    rest = covariance - part
    return np.asarray(rest - (rest @ along) @ along.T)
