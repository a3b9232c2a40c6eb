"""What is left when the model has said all it knows: noise of the instrument and of the joints."""

import numpy as np

from truearm._core import FieldFit
from truearm.fits.fitting import Task
from truearm.fits.measured_parts import MeasuredParts
from truearm.measurements import Measurements


def unexplained(task: Task, fit: FieldFit, data: Measurements) -> float:
    """Standard deviation of a coordinate of the first target that was measured, m, over the rows of `data`.

    It adds up the noise of positions and what the joints, each for itself, miss anew at every pose, as the
    fit's posterior has it.
    """
    end = np.eye(4)
    measured = MeasuredParts.of(data, task.selection, task.groups)
    end[:3, 3] = measured.points(fit.setup.targets)[0]
    chain = task.arm.chain(task.arm.robot.flange @ end)
    joints = task.arm.robot.joints_from_readings(data.readings)
    jacobian = chain.parameter_jacobian(joints, fit.parameters)[:, :, list(task.arm.candidates.columns)]
    missed = fit.posterior.repeatability(np.ascontiguousarray(jacobian))
    variance = float(np.einsum("nii->n", missed).mean()) / 3.0
    return float(np.sqrt(fit.hyper["noise_position"][0] ** 2 + variance))
