"""Compensation: readings to command so that the real tool goes where the program means it."""

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from threading import Lock
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truearm._core import CoreError, Corrector, Solver
from truearm.arrays import as_numbers, as_rows, as_transforms, check_finite
from truearm.calibration import Calibration
from truearm.errors import InputError, WorkError, count_of
from truearm.fits.endpoints import at_tool
from truearm.kinds import required
from truearm.limits import Limits, Task
from truearm.named_values import check_readings
from truearm.robot import Robot
from truearm.searching import Search
from truearm.solving import (
    as_seed,
    calibrated_model,
    core_options,
    feature_names,
    feature_values,
    moving_joints,
    plain_model,
)
from truearm.types import Floats, Whole
from truearm.units import MM_PER_METRE, MRAD_PER_RAD

TO_SHOWN: Final = np.array([MM_PER_METRE, MRAD_PER_RAD, MM_PER_METRE, MRAD_PER_RAD, MM_PER_METRE])
TOOLS_KEPT: Final = 16
NOT_FINITE: Final = 1
"""Code of a refusal for a reading that is no finite number, see Refusal."""


@dataclass(frozen=True)
class Refusal:
    """A waypoint that must not be corrected.

    Attributes:
        number: Which, from 1.
        reason: Why, for people.
        code: Why, for programs: 1 not finite, 2 position or 3 orientation not reached, 4 joint limit, 5 joint
            correction, 6 shift, 7 turn, 8 standard deviation, 9 change of the shift or 10 of the turn along
            the path, 11 another branch.
    """

    number: int
    reason: str
    code: int


@dataclass(frozen=True, eq=False)
class Compensated:
    """Corrected waypoints of a path, n rows; a waypoint that was given alone is a path of one, n = 1.

    Attributes:
        q: Corrected readings (n, N), rad and m; NaN where the waypoint is refused.
        nominal: Readings (n, N) that were corrected: a copy of the program's, or the programming model's for
            its poses.
        residual_mm: How far from its target the calibrated model puts the tool, (n,): more than rounding for
            an arm that cannot leave a plane.
        residual_mrad: How far turned from it, (n,).
        correction_mm: How far the correction shifts the tool, (n,), as the programming model sees it.
        correction_mrad: How far it turns it, (n,).
        std_mm: Standard deviation of the tool's position, (n,): root of the sum of the variances of x, y, z.
            With constants alone it is exact; with a variable model its bound, `Calibration.conservative_std`,
            and NaN where the file has none.
        refusals: The refused waypoints, ascending.
    """

    q: Floats
    nominal: Floats
    residual_mm: Floats
    residual_mrad: Floats
    correction_mm: Floats
    correction_mrad: Floats
    std_mm: Floats
    refusals: tuple[Refusal, ...]

    def __repr__(self) -> str:
        return f"<Compensated: {count_of(len(self.q), 'waypoint')}, {len(self.refusals)} refused>"

    @cached_property
    def refused(self) -> NDArray[np.bool_]:
        """Which waypoints are refused, (n,)."""
        refused = np.zeros(len(self.q), dtype=np.bool_)
        refused[[refusal.number - 1 for refusal in self.refusals]] = True
        return refused


class Compensator:
    """Corrects what a program says for the arm that will run it; several threads may share one.

    The corrected readings q^c put the tool of the calibrated arm where the programming model puts it for the
    program's readings q^n: equation (3) of the paper, q^c = q^n - dq, carried to convergence. What it was
    made of cannot be set afterwards: other limits need another compensator.
    """

    def __init__(
        self,
        calibration: Calibration,
        *,
        programming: Robot | None = None,
        task: Task = "pose",
        moving: Sequence[int] | Whole | None = None,
        limits: Limits | None = None,
        features: Mapping[str, float] | None = None,
    ) -> None:
        """Prepare a compensation.

        Args:
            calibration: What the arm is.
            programming: What the program's author took it for; the calibration's nominal robot by default.
            task: What is to be met: "pose": position and orientation; "axis": position and the tool's z axis;
                "position". With fewer moving joints than that needs, the position is met first and the rest
                as near as the arm can.
            moving: Joints that may change, counted from 1; all by default. Where they are more than the task
                needs, the change is the smallest.
            limits: Bounds; Limits() by default.
            features: Values of the features that the calibration depends on.

        Raises:
            UsageError: If the task, a joint or the features are not those of the arm and the calibration.
            InputError: If the programming model is of another arm.
        """
        self._calibration = required(calibration, Calibration, "the calibration")
        self._programming = required(programming or calibration.robot, Robot, "the programming model")
        self._task: Task = task
        self._limits = required(limits or Limits(), Limits, "the limits")
        self._check_joints(self.programming)
        self._moving = moving_joints(calibration.robot, moving)
        self._options = core_options(calibration.robot, task, self._moving, self.limits)
        self._features = feature_values(calibration, features)
        self._plain = plain_model(self.programming)
        self._calibrated = calibrated_model(calibration)
        self._correctors: OrderedDict[tuple[bytes | str, ...], Corrector] = OrderedDict()
        self._keeping = Lock()

    @property
    def calibration(self) -> Calibration:
        """The calibrated model."""
        return self._calibration

    @property
    def programming(self) -> Robot:
        """The model that the program was written with."""
        return self._programming

    @property
    def task(self) -> Task:
        """What is met: "pose", "axis" or "position"."""
        return self._task

    @property
    def limits(self) -> Limits:
        """Bounds of the correction."""
        return self._limits

    @property
    def moving(self) -> tuple[int, ...] | None:
        """Joints that may change, counted from 1; None where all may."""
        return self._moving

    @property
    def moving_count(self) -> int:
        """How many joints may change."""
        return self.calibration.robot.joint_count if self._moving is None else len(self._moving)

    def __repr__(self) -> str:
        name, model = self.programming.name, self.calibration.model_name
        return f"<Compensator of {name} by the {model} model, {self.task}>"

    def __reduce__(self) -> tuple[object, ...]:
        made = partial(
            type(self),
            programming=self.programming,
            task=self.task,
            moving=self._moving,
            limits=self.limits,
            features=self.named_features,
        )
        return made, (self.calibration,)

    def joints(
        self, q: ArrayLike, *, tool: ArrayLike | None = None, author: Robot | None = None
    ) -> Compensated:
        """Correct the joint targets of a path.

        Args:
            q: Readings (n, N) of the program, or (N,) for one, which is a path of one: the result has rows
                (1, N).
            tool: flange_from_tool (4, 4), or a point (3,); the programming model's own by default.
            author: The arm that with `tool` on its flange is, for readings `q`, where the author meant the
                tool; the programming model by default. An author who took the tool, or the place of a work
                object, for another than it is had an arm whose flange, or base, is shifted by as much.

        Raises:
            InputError: If readings or tool are not finite numbers of these shapes, or the author's arm has
                other joints.
        """
        rows, _ = as_rows(q, self.programming.joint_count, what="joint readings")
        meant = None if author is None else required(author, Robot, "the author's arm")
        return self._corrected(np.array(rows), self._tool(tool), {}, meant)

    def poses(
        self, base_from_tool: ArrayLike, seed: ArrayLike, *, tool: ArrayLike | None = None
    ) -> Compensated:
        """Correct the Cartesian targets of a path: the programming model's readings for them, corrected.

        Args:
            base_from_tool: Targets (n, 4, 4), or (4, 4) for one, which is a path of one as in `joints`.
            seed: Readings (n, N), near which the solution of each target is looked for; or (N,), near which
                that of the first is, and of each other one near the one before. A solution on another branch
                of a six-axis arm is refused. A seed within 0.01 deg of a singularity is on the branches of
                both its sides. On which turn a joint is, the search from the seed tells.
            tool: As for `joints`.

        Raises:
            InputError: If targets, seed or tool are not finite numbers of these shapes, or not rigid.
        """
        poses, _ = as_transforms(base_from_tool, what="the poses")
        seeds, flange_from_tool = as_seed(self.programming, seed, len(poses)), self._tool(tool)
        options = core_options(self.programming, self.task, None, self.limits)
        try:
            solver = Solver(self._plain, flange_from_tool, options)
            search = Search(self.programming, solver, self.task, flange_from_tool, [])
            rows, refused = search.near(poses, seeds)
        except CoreError as error:
            raise InputError(str(error)) from None
        unsolved = {place: Refusal(place + 1, reason, code) for place, (code, reason) in refused.items()}
        return self._corrected(rows, flange_from_tool, unsolved)

    def correct(self, q: ArrayLike, *, tool: ArrayLike | None = None) -> Floats:
        """Correct one waypoint, readings (N,), in microseconds; the path it may belong to is not looked at.

        Raises:
            WorkError: If it is refused.
            InputError: If readings or tool are not finite numbers of these shapes.
        """
        try:
            readings = as_numbers(q, what="joint readings")
            check_readings(q, what="joint readings")
            if readings.ndim != 1:
                raise ValueError(f"shape {readings.shape}: one waypoint has (N,), joints() takes many")
            corrected, refusal = self._corrector(self._tool(tool)).one(readings, self._features)
        except ValueError as error:
            raise InputError(str(error), where="joint readings") from None
        if refusal is not None:
            code, reason = refusal
            if code == NOT_FINITE:
                check_finite(readings[None], what="joint readings")
            raise WorkError(reason, where="waypoint")
        return corrected

    def _tool(self, tool: ArrayLike | None) -> Floats:
        return self.programming.tool if tool is None else at_tool(self.programming, tool)

    @property
    def feature_names(self) -> tuple[str, ...]:
        """Features that the calibration depends on, in its order."""
        return feature_names(self.calibration)

    @property
    def features(self) -> tuple[float, ...]:
        """Values of the features that the calibration depends on, in its order."""
        return self._features

    @property
    def named_features(self) -> dict[str, float]:
        """Values of the features that the calibration depends on, by name."""
        return dict(zip(self.feature_names, self._features, strict=True))

    def corrector(self, tool: ArrayLike | None = None) -> Corrector:
        """Internal: the core's corrector for a tool, flange_from_tool (4, 4) or a point (3,)."""
        return self._corrector(self._tool(tool))

    def _check_joints(self, programming: Robot) -> None:
        """Raise InputError where an author's arm has other joints than the calibrated one."""
        if programming.joints != self.calibration.robot.joints:
            raise InputError(
                f"the programming model {programming.name} has joints {programming.joints}",
                rule=f"{self.calibration.robot.name} was calibrated with {self.calibration.robot.joints}",
            )

    def _corrector(self, flange_from_tool: Floats, author: Robot | None = None) -> Corrector:
        """The corrector of a tool, for an author's arm; all threads keep the same last TOOLS_KEPT."""
        if author is not None:
            self._check_joints(author)
        key = (flange_from_tool.tobytes(), *(() if author is None else _kinematics(author)))
        with self._keeping:
            kept = self._correctors.get(key)
            if kept is not None:
                self._correctors.move_to_end(key)
                return kept
        programming = self._plain if author is None else plain_model(author)
        tool = np.ascontiguousarray(flange_from_tool)
        made = Corrector(self._calibrated, programming, tool, self._options)
        with self._keeping:
            self._correctors[key] = made
            if len(self._correctors) > TOOLS_KEPT:
                self._correctors.popitem(last=False)
        return made

    def _corrected(
        self,
        rows: Floats,
        flange_from_tool: Floats,
        unsolved: Mapping[int, Refusal],
        author: Robot | None = None,
    ) -> Compensated:
        try:
            corrector = self._corrector(flange_from_tool, author)
        except CoreError as error:
            raise InputError(str(error)) from None
        q, numbers, refused = corrector.path(rows, self._features)
        numbers *= TO_SHOWN
        residual, turned, shift, turn, std = numbers.T
        refusals = (
            unsolved.get(place) or Refusal(place + 1, reason, code) for place, code, reason in refused
        )
        return Compensated(q, rows, residual, turned, shift, turn, std, tuple(refusals))


def _kinematics(arm: Robot) -> tuple[bytes | str, ...]:
    """What tells where an arm with given kinds of joints goes, for comparison with another's."""
    numbers = arm.base, arm.flange, arm.table, arm.coupling
    return arm.convention, *(part.tobytes() for part in numbers)
