"""Errors of fitted models on rows, at the target that they are judged at."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from truearm._core import Setup
from truearm.core_set import Selection
from truearm.fitting import Task, feature_values
from truearm.identified import IdentifiedArm
from truearm.measurements import Measurements
from truearm.models import ArmModel
from truearm.validation import RowErrors, row_errors

Floats = NDArray[np.float64]


def model_inputs(arm: IdentifiedArm, data: Measurements, features: tuple[str, ...]) -> Floats:
    """Inputs (n, I) of a field at measured rows: joint values, then features."""
    values = arm.robot.joints_from_readings(data.readings)
    return np.hstack([values, feature_values(data, features)])


def judge(
    task: Task, models: Mapping[str, ArmModel], data: Measurements, fitted: Measurements
) -> dict[str, RowErrors]:
    """Errors of each model at every row of `data`.

    Args:
        task: What was fitted.
        models: The models, with the set-ups of `task.groups`.
        data: Rows to judge.
        fitted: Rows that find the point of a judged target that took no part in the fit.
    """
    features = task.options.features
    found = {}
    for name, model in models.items():
        selection, setup = task.selection, model.setup
        if selection.judges_another:
            at = model.parameters(model_inputs(task.arm, fitted, features))
            setup = setup_of_judged(task, fitted, at, model.setup)
            selection = Selection((selection.judge,), selection.orientation, judge=selection.judge)
        parameters = model.parameters(model_inputs(task.arm, data, features))
        found[name] = row_errors(task.arm, data, selection, task.groups, parameters, setup)
    return found


def setup_of_judged(task: Task, data: Measurements, parameters: Floats, setup: Setup) -> Setup:
    """The set-up with the judged target as its only one, its point found from rows and nothing else moved.

    Args:
        task: What was fitted.
        data: Rows, n of them.
        parameters: The model's parameters there (n, L, 5).
        setup: Frames of the fit.
    """
    joints = task.arm.robot.joints_from_readings(data.readings)
    base_from_flange = task.arm.flange_chain.pose(joints, np.ascontiguousarray(parameters))
    frames = setup.frames
    points = np.empty((len(task.groups), 1, 3))
    for number, group in enumerate(task.groups):
        rows = data.group == group
        world_from_flange = frames[number] @ base_from_flange[rows]
        offset = data.targets[rows, task.selection.judge] - world_from_flange[:, :3, 3]
        in_flange = np.einsum("nji,nj->ni", world_from_flange[:, :3, :3], offset)
        points[number, 0] = in_flange[np.isfinite(in_flange).all(axis=1)].mean(axis=0)
    return Setup(frames, points, setup.rotations, setup.anchors)
