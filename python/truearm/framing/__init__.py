"""Tools and work objects taught again, through the calibrated arm instead of the controller's model of it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from truearm.arrays import as_numbers, check_finite, rotation_fault
from truearm.calibration import Calibration
from truearm.doubts.plausibility import check_points, check_readings
from truearm.errors import InputError, Notice, UsageError, count_of
from truearm.fits.endpoints import at_tool
from truearm.framing.calibrated import calibrated_poses
from truearm.framing.frames_toml import former_entry, tip_covariance, write_frame
from truearm.framing.identified_frame import IdentifiedFrame
from truearm.framing.measuring import tool_from_measurements
from truearm.framing.placing import object_from_points
from truearm.framing.touching import tool_from_touches
from truearm.kinds import required
from truearm.measurements import Measurements
from truearm.rotations import rigid_inverse
from truearm.types import Floats

BEHIND_FLANGE: Final = (0.0, 0.0, -0.1, 1.0)
"""A point of the wrist in the flange's frame, m."""
ROUNDING: Final = 1e-6
"""What a covariance may differ by from a symmetric one, in parts of its largest entry."""

__all__ = ["IdentifiedFrame", "find_object", "find_tool", "former_entry", "tip_covariance", "write_frame"]


def find_tool(
    calibration: Calibration,
    data: Measurements | Sequence[Measurements],
    *,
    orientation: ArrayLike | None = None,
    points: Sequence[str] | None = None,
) -> IdentifiedFrame:
    """A tool, from touches of a point or from what a device measured of it.

    Args:
        calibration: The arm.
        data: Readings alone: touches of one point, four or more. With positions, or poses, of target 1: those
            of the tool, in the frame of a device that stands anywhere; four positions or three poses, and
            better twice as many.
        orientation: Orientation of the tool, flange_from_tool (3, 3), unless poses were measured.
        points: Name of the point of each touch; one point by default.

    Raises:
        UsageError: If an orientation is needed and missing, or given and measured, or there are more or fewer
            names of points than touches.
        InputError: If the data is of another arm.
        WorkError: If the data determines too little.
    """
    calibration, data = required(calibration, Calibration, "the calibration"), Measurements.of(data)
    notices = check_readings(data, calibration.robot)
    turned = None if orientation is None else _rotation(orientation)
    if data.target_count and np.isfinite(data.targets).any():
        if data.orientations is not None and turned is not None:
            raise UsageError("the orientation of the tool was measured", way_out="Leave it out")
        check_points(data, calibration.robot)
        return _with(notices, tool_from_measurements(calibration, data, turned))
    if turned is None:
        raise UsageError(
            "touches of a point do not tell how the tool is turned", way_out="Give its orientation"
        )
    names = ["point"] * len(data) if points is None else list(points)
    if len(names) != len(data):
        raise UsageError(
            f"{count_of(len(names), 'name')} of points", where="points", rule=f"There are {len(data)} touches"
        )
    poses = calibrated_poses(calibration, data, np.eye(4))
    return _with(notices, tool_from_touches(poses, names, turned, data.rows))


def find_object(
    calibration: Calibration,
    data: Measurements | Sequence[Measurements],
    flange_from_tool: ArrayLike,
    covariance: ArrayLike | None = None,
) -> IdentifiedFrame:
    """A work object, from points of it that a tool's tip touched.

    Args:
        calibration: The arm.
        data: Readings, and as target 1 where the touched points are in the object's own frame; three or more.
        flange_from_tool: The tool (4, 4), or its tip (3,).
        covariance: Covariance of its tip along the flange's axes (3, 3), m^2.

    Raises:
        InputError: If the data is of another arm, or has no positions, or the covariance is none.
        WorkError: If the points do not tell where the object is.
    """
    calibration, data = required(calibration, Calibration, "the calibration"), Measurements.of(data)
    notices = check_readings(data, calibration.robot)
    if not data.target_count or not data.seen(0).all():
        raise InputError(
            "there is no place x, y, z of every touched point",
            where=", ".join(data.files),
            rule="Each row needs where the point truly is, in the object's own frame",
        )
    tool = at_tool(calibration.robot, flange_from_tool)
    in_tool = None if covariance is None else tool[:3, :3].T @ _covariance(covariance) @ tool[:3, :3]
    poses = calibrated_poses(calibration, data, tool)
    wrist = (rigid_inverse(tool) @ BEHIND_FLANGE)[:3]
    return _with(notices, object_from_points(poses, data.targets[:, 0], data.rows, wrist, in_tool))


def _with(notices: Sequence[Notice], found: IdentifiedFrame) -> IdentifiedFrame:
    return replace(found, notices=(*notices, *found.notices))


def _covariance(given: ArrayLike) -> Floats:
    covariance = as_numbers(given, what="the entries of the covariance")
    if covariance.shape != (3, 3):
        raise InputError(f"the covariance has shape {covariance.shape}", rule="That of a point's is (3, 3)")
    check_finite(covariance, what="the entries of the covariance")
    rounding = ROUNDING * float(np.abs(covariance).max())
    if np.abs(covariance - covariance.T).max() > rounding or np.linalg.eigvalsh(covariance)[0] < -rounding:
        raise InputError(
            "the covariance is none",
            rule="It is symmetric, and in no direction the square of a standard deviation is negative",
        )
    return covariance


def _rotation(orientation: ArrayLike) -> Floats:
    given = as_numbers(orientation, what="the entries of the orientation")
    if given.shape != (3, 3):
        raise InputError(f"the orientation has shape {given.shape}", rule="A rotation matrix is (3, 3)")
    check_finite(given, what="the entries of the orientation")
    fault = rotation_fault(given[None])
    if fault is not None:
        raise InputError(
            f"the orientation is no rotation matrix: {fault.why}", rule=fault.rule, way_out=fault.way_out
        )
    return given
