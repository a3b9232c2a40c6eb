"""A tool from measured poses or points of it: where the device stands is found along with it."""

import numpy as np
from numpy.typing import NDArray

from truearm._core import fit_constant
from truearm.calibration import Calibration
from truearm.core_set import core_set, select
from truearm.errors import WorkError
from truearm.fitting import Task, core_errors, fit_options
from truearm.framing.identified_frame import IdentifiedFrame, far_rows
from truearm.judging import model_inputs
from truearm.measurements import Measurements

Floats = NDArray[np.float64]


def tool_from_measurements(
    calibration: Calibration, data: Measurements, orientation: Floats | None
) -> IdentifiedFrame:
    """The tool whose pose, or whose point, a device measured; the arm's parameters do not move.

    Args:
        calibration: The arm.
        data: Measurements of target 1, n rows of one set-up.
        orientation: Orientation of the tool, flange_from_tool (3, 3), where only points were measured.

    Raises:
        WorkError: If there are several set-ups, the rows determine too little, or only points were measured
            and no orientation is given.
    """
    selection = select(data, "pose" if data.orientations is not None else "position")
    if len(data.groups) != 1:
        raise WorkError(f"{len(data.groups)} set-ups", rule="A tool is found from one set-up")
    if not selection.orientation and orientation is None:
        raise WorkError("only points of the tool were measured", rule="They do not tell how it is turned")
    task = Task(calibration.arm, selection, data.groups, calibration.options)
    model = calibration.model
    parameters = model.parameters(model_inputs(task.arm, data, task.options.features))
    measured = core_set(task.arm.robot, data, selection, task.groups)
    with core_errors(data):
        fit = fit_constant(task.problem(measured, []), fit_options(task, parameters=parameters))
    width = 6 if selection.orientation else 3
    residuals = np.asarray(fit.residuals).reshape(len(data), width)
    transform, covariance = np.eye(4), np.zeros((6, 6))
    transform[:3, 3] = fit.setup.targets[0, 0]
    first = 0 if task.arm.world_is_known else 6
    turned = np.eye(6)
    if selection.orientation:
        transform[:3, :3] = turned[3:, 3:] = fit.setup.rotations[0]
    elif orientation is not None:
        transform[:3, :3] = orientation
    own = fit.covariance[first : first + width, first : first + width]
    covariance[:width, :width] = turned[:width, :width] @ own @ turned[:width, :width].T
    freedom = residuals.size - first - width
    noise, rows = fit.noise[0], data.rows
    what = f"{len(data)} measured {'poses' if selection.orientation else 'points'} of it"
    notices = tuple(far_rows(residuals[:, :3], rows, noise, freedom))
    return IdentifiedFrame(
        "tool", transform, covariance, residuals[:, :3], rows, noise, freedom, what, notices
    )
