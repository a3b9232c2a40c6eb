"""What is left when the model has said all it knows: noise of the instrument and of the joints."""

import numpy as np
from numpy.typing import NDArray

from truearm._core import ANGLE_ARM_M, FieldFit
from truearm.fitting import Task
from truearm.measured_parts import MeasuredParts
from truearm.measurements import Measurements

Floats = NDArray[np.float64]


def unexplained(task: Task, fit: FieldFit, data: Measurements) -> float:
    """Standard deviation of a coordinate of the first target that was measured, m, over the rows of `data`.

    It adds up the noise of positions and what the joints, each for itself, miss anew at every pose.
    """
    end = np.eye(4)
    measured = MeasuredParts.of(data, task.selection, task.groups)
    end[:3, 3] = measured.points(fit.setup.targets)[0]
    chain = task.arm.chain(task.arm.robot.flange @ end)
    jacobian = chain.joint_jacobian(task.arm.robot.joints_from_readings(data.readings))
    levers = np.where(np.array(task.arm.robot.joints) == "prismatic", ANGLE_ARM_M, 1.0)
    # Files from before joints had factors of their own hold none.
    uneven = np.array(fit.hyper["unevenness"] or 1.0)
    missed = fit.hyper["repeatability"][0] * uneven * jacobian * levers
    variance = np.square(missed).sum(axis=(1, 2)).mean() / 3.0
    return float(np.sqrt(fit.hyper["noise_position"][0] ** 2 + variance))
