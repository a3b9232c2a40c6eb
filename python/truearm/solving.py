"""Models of an arm in the core's terms, and readings for poses: inverse kinematics from a seed."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from truearm._core import ArmModel, CoreError, Solver
from truearm.arrays import as_rows, as_transforms
from truearm.certainty.learnt_features import learnt_spans
from truearm.certainty.uncertainty import ConstantSpread
from truearm.errors import InputError, Notice, UsageError, WorkError, count_of, list_rows
from truearm.fits.endpoints import at_tool
from truearm.inputs import feature_columns
from truearm.limits import TASKS, Limits, Task
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.searching import Search
from truearm.types import Floats, Whole

if TYPE_CHECKING:
    from truearm._core import CorrectorOptions
    from truearm.calibration import Calibration


FEATURE_RANGE: Final = "feature_range"
MARGIN: Final = 0.02
"""A feature may lie outside of what was learnt by so much of its range: curves go on smoothly there."""


def plain_model(robot: Robot) -> ArmModel:
    """The arm as its file describes it."""
    return ArmModel(robot.flange_chain, robot.table, robot.coupling)


def calibrated_model(calibration: "Calibration") -> ArmModel:
    """The arm as identified, with what is known of its uncertainty.

    Raises:
        UsageError: If the calibration is of one of the paper's schemes.
    """
    if calibration.scheme is not None:
        raise UsageError(
            f"this calibration is of the scheme {calibration.model_name}",
            rule="Compensation knows constant and variable models",
            way_out="Calibrate with --model variable or constant",
        )
    model, exact, bounds = calibration.model, None, None
    if model.field is None:
        spread = ConstantSpread.of(calibration)
        exact = spread.columns, np.ascontiguousarray(spread.with_setup)
    elif calibration.has_conservative:
        bounds = calibration.conservative
    return ArmModel(
        calibration.arm.flange_chain,
        model.constants,
        calibration.robot.coupling,
        model.field,
        len(calibration.options.features) if model.field is not None else 0,
        exact,
        bounds,
    )


def moving_joints(robot: Robot, moving: Sequence[int] | Whole | None) -> tuple[int, ...] | None:
    """Joints that may change, counted from 1; None where all may.

    Raises:
        UsageError: If there is no such joint, or one is named twice.
    """
    if moving is not None and not isinstance(moving, Sequence | np.ndarray):
        raise UsageError(f"{moving!r}", where="moving", rule="A list of joints, counted from 1")
    if moving is None:
        return None
    joints, known = list(moving), range(1, robot.joint_count + 1)
    if not joints or len(set(joints)) < len(joints) or not set(joints) <= set(known):
        raise UsageError(
            f"joints {joints}",
            where="moving",
            rule=f"Some of the joints 1 to {robot.joint_count} of {robot.name}, each once",
        )
    return tuple(int(joint) for joint in joints)


def core_options(
    robot: Robot, task: Task, moving: tuple[int, ...] | None, limits: Limits
) -> "CorrectorOptions":
    """The core's options, with joints counted from 0.

    Args:
        robot: The arm.
        task: What is to be met.
        moving: Joints that may change, those of `moving_joints`.
        limits: Bounds.

    Raises:
        UsageError: If there is no such task.
    """
    if task not in TASKS:
        raise UsageError(f'"{task}" is not known', where="task", rule=f"One of {', '.join(TASKS)}")
    chosen = None if moving is None else sorted(joint - 1 for joint in moving)
    return {"task": task, "moving": chosen, **limits.core(robot)}


def feature_values(calibration: "Calibration", given: Mapping[str, float] | None) -> tuple[float, ...]:
    """The features of a calibration, one number each.

    Raises:
        UsageError: If one is missing, or is not needed.
    """
    return tuple(feature_columns(given, feature_names(calibration), 1)[0].tolist())


def feature_names(calibration: "Calibration") -> tuple[str, ...]:
    """Features whose values a calibration needs, in its order."""
    return calibration.options.features if calibration.model.field is not None else ()


def beyond_learnt(calibration: "Calibration", values: ArrayLike) -> list[str]:
    """In words, which features lie beyond those that a calibration learned from, by MARGIN, and these.

    Args:
        calibration: What learned.
        values: Features (F,) in its order, or those of each row (n, F).
    """
    names, spans = feature_names(calibration), learnt_spans(calibration)
    if not names or not spans:
        return []
    found = []
    columns = np.atleast_2d(np.asarray(values, dtype=np.float64)).T
    for name, given, (low, high) in zip(names, columns, spans, strict=True):
        margin = MARGIN * (high - low)
        sides = (given[given < low - margin], given[given > high + margin])
        values_beyond = " and ".join(_span(side) for side in sides if len(side))
        if values_beyond:
            found.append(
                f"{name} = {values_beyond} lies beyond {low:.10g} to {high:.10g}, where it was learnt"
            )
    return found


def _span(values: Floats) -> str:
    """From the least to the largest of values (n,), in words."""
    return " to ".join(dict.fromkeys(f"{end:.10g}" for end in (values.min(), values.max())))


def beyond_notices(calibration: "Calibration", values: ArrayLike) -> list[Notice]:
    """Warnings of features, (F,) or (n, F), that lie beyond those that a calibration learned from."""
    found = beyond_learnt(calibration, values)
    return [Notice(FEATURE_RANGE, f"{each}: corrections are guesses there.") for each in found]


def rows_beyond_learnt(calibration: "Calibration", data: Measurements) -> list[Notice]:
    """The same of the features that measurements hold; none where one of them is missing."""
    names = list(feature_names(calibration))
    if not set(names) <= set(data.features.columns):
        return []
    return beyond_notices(calibration, data.features[names].to_numpy(np.float64))


def as_seed(robot: Robot, seed: ArrayLike, count: int) -> Floats:
    """A seed (N,) for a path, or (count, N) for each pose.

    Raises:
        InputError: If it is neither.
    """
    rows, single = as_rows(seed, robot.joint_count, what="seed readings")
    if single:
        return rows.reshape(-1)
    if len(rows) != count:
        raise InputError(
            f"{count_of(len(rows), 'seed')} for {count_of(count, 'pose')}",
            rule="One for each, or one for the first: the others then follow each other",
        )
    return rows


def solve(
    calibration: "Calibration",
    base_from_tool: ArrayLike,
    seed: ArrayLike,
    *,
    tool: ArrayLike | None,
    task: Task,
    features: Mapping[str, float] | None,
) -> Floats:
    """Readings for which the calibrated arm puts the tool at poses, see Calibration.solve."""
    robot = calibration.robot
    poses, single = as_transforms(base_from_tool, what="the poses")
    seeds = as_seed(robot, seed, len(poses))
    options = core_options(robot, task, None, Limits())
    values = feature_values(calibration, features)
    try:
        flange_from_tool = at_tool(robot, tool)
        solver = Solver(calibrated_model(calibration), flange_from_tool, options)
        readings, refused = Search(robot, solver, task, flange_from_tool, values).near(poses, seeds)
    except CoreError as error:
        raise InputError(str(error)) from None
    if refused:
        _, reason = refused[min(refused)]
        raise WorkError(
            f"{list_rows([place + 1 for place in sorted(refused)], 'pose')} cannot be reached: {reason}",
            rule="A solution lies within the joint limits, on the seed's branch",
            way_out="Give a seed nearer to the solution; truearm.inverse.Inverse(robot) finds the flange's",
        )
    return readings[0] if single else readings
