"""Errors of fitted models on rows, at the target that they are judged at."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from truearm._core import Setup
from truearm.core_set import Selection
from truearm.errors import InputError, list_names
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


def check_judged(data: Measurements, selection: Selection) -> None:
    """Check that rows of each set-up show where a judged target sits that takes no part in the fit.

    Args:
        data: The rows that are to find its point.
        selection: What is used of them.

    Raises:
        InputError: If a set-up has no row with it; names the set-ups.
    """
    if not selection.judges_another:
        return
    held = np.isfinite(data.targets[:, selection.judge]).all(axis=1)
    seen = set(data.group[held].tolist())
    missing = [group for group in data.groups if group not in seen]
    if missing:
        raise InputError(
            f"target {selection.judge + 1} was measured in none of the rows of the set-up "
            f"{list_names(missing)} that would find it",
            where=", ".join(data.files),
            rule="Where errors are judged at a target that takes no part in the fit, each set-up needs rows "
            "with it",
            way_out="Measure it there, leave the set-up out, or judge at another target",
        )


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

    Raises:
        InputError: If a set-up has no row with the judged target.
    """
    check_judged(data, task.selection)
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
