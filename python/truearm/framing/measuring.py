"""A tool from measured poses or points of it: where the device stands is found along with it."""

import numpy as np

from truearm.calibration import Calibration
from truearm.doubts.turning_sense import check_turns
from truearm.errors import WorkError
from truearm.fits.core_set import Selection, select
from truearm.fits.enough_values import frame_unknowns, measured_values
from truearm.fits.fitting import Task, fit_setup
from truearm.fits.measured_parts import held_parts
from truearm.framing.agreement import check_agreement, far_rows
from truearm.framing.calibrated import calibrated_poses
from truearm.framing.identified_frame import IdentifiedFrame
from truearm.framing.turning import check_turned
from truearm.judgement.judging import model_inputs
from truearm.measurements import Measurements
from truearm.rotations import rigid_motion
from truearm.types import Floats


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
    selection = _selection(calibration, data, stated=orientation is not None)
    task = Task(calibration.arm, selection, data.groups, calibration.options)
    first, width = frame_unknowns(task), 6 if selection.orientation else 3
    noun = "poses" if selection.orientation else "points"
    _check_told(calibration, data, measured_values(task, data) - first - width, f"measured {noun}")
    model = calibration.model
    parameters = model.parameters(model_inputs(task.arm, data, task.options.features))
    fit = fit_setup(task, data, parameters)
    residuals = np.asarray(fit.residuals).reshape(len(data), width)
    transform, covariance = np.eye(4), np.zeros((6, 6))
    transform[:3, 3] = fit.setup.targets[0, 0]
    turned = np.eye(6)
    if selection.orientation:
        transform[:3, :3] = turned[3:, 3:] = fit.setup.rotations[0]
    elif orientation is not None:
        transform[:3, :3] = orientation
    own = fit.covariance[first : first + width, first : first + width]
    covariance[:width, :width] = turned[:width, :width] @ own @ turned[:width, :width].T
    noise, rows = fit.noise[0], data.rows
    freedom = 3 * int(held_parts(data, selection).sum()) - first - width
    what = f"{len(data)} measured {noun} of it"
    notices = far_rows(residuals[:, :3], _by_frame_and_tip(calibration, data, transform), rows)
    check_agreement(noise, notices)
    return IdentifiedFrame(
        "tool", transform, covariance, residuals[:, :3], rows, noise, freedom, what, tuple(notices)
    )


def _selection(calibration: Calibration, data: Measurements, *, stated: bool) -> Selection:
    """What of the rows is used: they have to tell how the tool is turned, unless that is stated."""
    selection = select(data, "pose" if data.orientations is not None else "position")
    if len(data.groups) != 1:
        raise WorkError(f"{len(data.groups)} set-ups", rule="A tool is found from one set-up")
    if not selection.orientation and not stated:
        raise WorkError(
            "only points of the tool were measured",
            rule="They do not tell how it is turned",
            way_out="Measure that too, or state it: orientation=np.eye(3) where it is turned like the flange",
        )
    if selection.orientation:
        check_turns(data, calibration.robot)
    return selection


def _check_told(calibration: Calibration, data: Measurements, spare: int, noun: str) -> None:
    """Raise WorkError where rows do not tell the tool, by their values to spare and by how they turn it.

    The fit itself does not fail there: it holds targets near the flange.
    """
    if spare <= 0:
        raise WorkError(
            f"{len(data)} {noun} of the tool tell no more than is unknown",
            rule="There must be more measured values than unknowns",
            way_out=f"Give more {noun}, with the tool turned about two axes between them",
        )
    if not calibration.arm.world_is_known:
        turns = calibrated_poses(calibration, data, np.eye(4))[:, :3, :3]
        check_turned(turns - turns.mean(axis=0), noun)


def _by_frame_and_tip(calibration: Calibration, data: Measurements, flange_from_tool: Floats) -> Floats:
    """Derivatives (n, 3, 9) of what each row leaves by the frame of the device and by the tip."""
    turns = calibrated_poses(calibration, data, np.eye(4))[:, :3, :3]
    points = calibrated_poses(calibration, data, flange_from_tool)[:, :3, 3]
    return np.concatenate([rigid_motion(points), turns], axis=2)
