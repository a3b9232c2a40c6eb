"""A robot as fixed origins and pure joint motions, the way URDF and UR's kinematics files describe one."""

import math

import numpy as np

from truearm.description.dh_row import row_transform
from truearm.description.robot_data import RobotData
from truearm.types import Floats


def joint_origins(robot: RobotData) -> tuple[list[Floats], Floats]:
    """The origins (4, 4) of the N joints and what follows the last, all exact.

    base_from_flange = origins[0] . M1(q1) ... origins[N - 1] . MN(qN) . last, where Mj turns about or moves
    along z by the joint value alone.
    """
    behind, origins = robot.base, list[Floats]()
    for row in robot.table:
        before, after = _split(row, robot.convention)
        origins.append(behind @ before)
        behind = after
    return origins, behind @ robot.flange


def _split(row: Floats, convention: str) -> tuple[Floats, Floats]:
    """What of a row comes before its joint's motion, and what behind it."""
    if convention == "modified":
        return row_transform(row, convention), np.eye(4)
    on_axis, across = row.copy(), row.copy()
    on_axis[2:], across[:2] = 0.0, 0.0
    return row_transform(on_axis, convention), row_transform(across, convention)


def roll_pitch_yaw(rotation: Floats) -> tuple[float, float, float]:
    """Angles about the fixed x, y and z, in this order, of a rotation matrix (3, 3): R = Rz(y) Ry(p) Rx(r).

    Where pitch is a quarter turn yaw is as good as any, and roll makes up for it, so that the matrix comes
    back to its last digits everywhere.
    """
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    pitch = math.atan2(-rotation[2, 0], c * rotation[0, 0] + s * rotation[1, 0])
    across = c * rotation[1] - s * rotation[0]
    return math.atan2(-across[2], across[1]), pitch, yaw
