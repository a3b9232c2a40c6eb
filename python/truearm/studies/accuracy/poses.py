"""What methods see of a pose, and what all of them learn from: the residuals of constant parameters."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from truearm._core import Chain, Setup, linearise, setup_jacobian
from truearm.fits.core_set import Selection, core_set
from truearm.fits.fitting import Fits, Task, fit_rows
from truearm.fits.identified import IdentifiedArm
from truearm.fits.models import CONSTANT, ArmModel
from truearm.fits.options import CalibrationOptions
from truearm.fits.parameters import KIND_COUNT, D
from truearm.judgement.judging import model_inputs, setup_of_judged
from truearm.measurements import Measurements
from truearm.studies.accuracy.cells import Cell
from truearm.studies.accuracy.sets import read_set
from truearm.studies.accuracy.splits import rows_of
from truearm.types import Floats

THREADS = 1
"""A method's time is that of one thread."""


@dataclass(frozen=True, eq=False)
class Poses:
    """What a correction of the constant model may look at, of n poses. SI units, base frame.

    Attributes:
        joints: Joint values (n, N).
        points: Where the constant model puts the target (n, 3).
        rotations: base_from_flange rotations (n, 3, 3).
        jacobian: Derivatives of the points with respect to all parameters of the L links (n, 3, 5 L).
        setup: Derivatives of the points with respect to shift and turn of the base and shift of the target
            (n, 3, 9).
        revolute: Whether each joint turns (N,).
        links: The link that each joint moves (N,).
        heights: Derivative of the height of each link's end with respect to each joint (n, L, N).
    """

    joints: Floats
    points: Floats
    rotations: Floats
    jacobian: Floats
    setup: Floats
    revolute: NDArray[np.bool_]
    links: NDArray[np.int64]
    heights: Floats

    def __len__(self) -> int:
        return len(self.joints)

    def select(self, rows: NDArray[np.int64]) -> "Poses":
        """Those of some rows."""
        return Poses(
            self.joints[rows],
            self.points[rows],
            self.rotations[rows],
            self.jacobian[rows],
            self.setup[rows],
            self.revolute,
            self.links,
            self.heights[rows],
        )

    def joint_columns(self) -> Floats:
        """Derivatives of the points with respect to the joint values (n, 3, N)."""
        columns = KIND_COUNT * self.links + np.where(self.revolute, 0, D)
        return self.jacobian[:, :, columns]


@dataclass(frozen=True, eq=False)
class Prepared:
    """A cell with its rows and what all methods start from.

    Attributes:
        cell: The question.
        task: How constants are fitted; positions of target 1 alone.
        train: Training rows, which hold target 1.
        held: Held-out rows, which hold the target that is judged.
        fits: Frame and tool alone, and constants, of the training rows.
    """

    cell: Cell
    task: Task
    train: Measurements
    held: Measurements
    fits: Fits

    @property
    def constant(self) -> ArmModel:
        """The constant model."""
        return self.fits.models(self.task.arm)[CONSTANT]

    @cached_property
    def train_poses(self) -> Poses:
        """What is seen of the training poses."""
        return self.poses(self.train, 0)

    @cached_property
    def residuals(self) -> Floats:
        """Measured minus constant model at the training poses, base frame (n, 3), m."""
        return self.fits.constant.residuals.reshape(len(self.train), 3)

    def selection(self, target: int) -> Selection:
        """What is fitted, or what is judged at a target from 0."""
        return Selection((target,), judge=target)

    def setup(self, model: ArmModel, target: int) -> Setup:
        """The model's set-up with one target; of another than the first the training rows find the point."""
        if target == 0:
            return model.setup
        judging = Task(self.task.arm, Selection((0,), judge=target), self.task.groups, self.task.options)
        parameters = model.parameters(model_inputs(self.task.arm, self.train, ()))
        return setup_of_judged(judging, self.train, parameters, model.setup)

    def poses(self, data: Measurements, target: int) -> Poses:
        """What is seen of measured rows, for a target from 0."""
        arm, model = self.task.arm, self.constant
        setup = self.setup(model, target)
        joints = arm.robot.joints_from_readings(data.readings)
        flange = arm.flange_chain.pose(joints, model.constants)
        number = [list(self.task.groups).index(name) for name in data.group]
        points = np.einsum("nij,nj->ni", flange[:, :3, :3], setup.targets[number, 0]) + flange[:, :3, 3]
        measured = core_set(arm.robot, data, self.selection(target), self.task.groups)
        problem = self.task.problem(measured, range(KIND_COUNT * len(arm.joints)))
        jacobian, _ = linearise(problem, model.constants, setup)
        moving = np.array([kind != "fixed" for kind in arm.joints])
        return Poses(
            joints=joints,
            points=points,
            rotations=flange[:, :3, :3],
            jacobian=jacobian,
            setup=setup_jacobian(problem, model.constants, setup),
            revolute=np.array([kind == "revolute" for kind in arm.joints])[moving],
            links=np.flatnonzero(moving),
            heights=_heights(arm, joints, model.constants),
        )


def prepare(cell: Cell) -> Prepared:
    """Divide the rows of a cell, and fit constants to its training rows.

    Raises:
        InputError: If the rows cannot be divided.
        WorkError: If they are too few or too alike.
    """
    read = read_set(cell.data_set)
    split = rows_of(cell.data_set, cell.cut, cell.seed, cell.poses)
    train, held = read.data.select(split.train), read.data.select(split.holdout)
    options = CalibrationOptions(model="constant", use="position")
    arm = IdentifiedArm(read.robot, options.frame, options.parallel_within_deg)
    task = Task(arm, Selection((0,)), train.groups, options, THREADS)
    return Prepared(cell, task, train, held, fit_rows(task, train))


def _heights(arm: IdentifiedArm, joints: Floats, constants: Floats) -> Floats:
    """Derivative of the height of each link's end with respect to each joint (n, L, N).

    It is what a mass of one newton there asks of the joint, where the base's z axis points upwards.
    """
    count, moved = len(arm.joints), 0
    found = np.zeros((len(joints), count, joints.shape[1]))
    for link, kind in enumerate(arm.joints):
        moved += kind != "fixed"
        if moved:
            rows = constants[: link + 1].copy()
            chain = Chain(arm.robot.convention, arm.joints[: link + 1], rows, arm.robot.base, np.eye(4))
            found[:, link, :moved] = chain.joint_jacobian(np.ascontiguousarray(joints[:, :moved]))[:, 2]
    return found
