"""What is left when the model has said all it knows: noise of the instrument and of the joints."""

import numpy as np

from truearm._core import FieldFit
from truearm.fits.fitting import Task
from truearm.measurements import Measurements
from truearm.types import AXES, Floats


def unexplained(task: Task, fit: FieldFit, data: Measurements) -> float:
    """Standard deviation of a coordinate of the targets, m, root mean square over all that `data` hold.

    It adds up the noise of positions and what the joints, each for itself, miss anew at every pose, as the
    fit's posterior has it: the more, the farther the target of a row is from the joints.
    """
    squares, count = 0.0, 0
    for number, group in enumerate(task.groups):
        own = data.group == group
        for place, target in enumerate(task.selection.targets):
            rows = data.select(own & data.seen(target))
            if len(rows):
                squares += _missed_anew(task, fit, rows, fit.setup.targets[number, place])
                count += len(rows)
    return float(np.sqrt(fit.hyper["noise_position"][0] ** 2 + squares / (AXES * max(count, 1))))


def _missed_anew(task: Task, fit: FieldFit, rows: Measurements, point: Floats) -> float:
    """What joints miss anew of a point (3,) of the flange: variances of rows and coordinates, added, m^2."""
    end = np.eye(4)
    end[:AXES, 3] = point
    chain = task.arm.chain(task.arm.robot.flange @ end)
    joints = task.arm.robot.joints_from_readings(rows.readings)
    jacobian = chain.parameter_jacobian(joints, fit.parameters)[:, :, list(task.arm.candidates.columns)]
    missed = fit.posterior.repeatability(np.ascontiguousarray(jacobian))
    return float(np.einsum("nii->", missed))
