"""Where a robot's joint axes are with all joint values at zero."""

import numpy as np

from truearm.description.dh_from_axes import Axis
from truearm.description.dh_row import row_transform
from truearm.description.robot_data import RobotData
from truearm.types import Floats


def axes_at_zero(robot: RobotData) -> tuple[list[Axis], Floats]:
    """The N axes in the base frame, and base_from_flange (4, 4), all Denavit-Hartenberg joint values zero.

    Each axis is given at its point nearest to that of the axis before: the common normal of nearly parallel
    axes, and with it the origin of a Denavit-Hartenberg frame, may be hundreds of metres away.
    """
    frame, axes = robot.base, list[Axis]()
    for kind, row in zip(robot.joints, robot.table, strict=True):
        behind = frame @ row_transform(row, robot.convention)
        on_axis = frame if robot.convention == "standard" else behind
        before = axes[-1].point_in_base if axes else robot.base[:3, 3]
        axes.append(Axis(kind, _nearest(on_axis, before), on_axis[:3, 2]))
        frame = behind
    return axes, frame @ robot.flange


def _nearest(frame: Floats, point: Floats) -> Floats:
    """The point on z of `frame` that is nearest to a point."""
    origin, z = frame[:3, 3], frame[:3, 2]
    return np.asarray(origin + ((point - origin) @ z) * z)
