"""The constant part as a kinematics file of Universal Robots' ROS driver."""

import math
from typing import Any, Final

import numpy as np
import yaml

from truearm.errors import InputError
from truearm.exporting.losses import as_comments
from truearm.exporting.origins import joint_origins, roll_pitch_yaw
from truearm.exporting.parity import checked
from truearm.robot import Robot
from truearm.rotations import quaternion_from_matrix
from truearm.types import Floats
from truearm.ur_kinematics import LINKS, NUMBERS, URDF_CONVENTION, has_ur_structure, robot_from_yaml

NOTHING: Final = 1e-12


def yaml_text(
    robot: Robot, nominal: Robot, kinematics_hash: str, notes: list[str]
) -> tuple[str, list[str], float]:
    """Text of the file, what beside `notes` it cannot hold, and how far its kinematics are from ours, m.

    Args:
        robot: The calibrated arm.
        nominal: As it was designed.
        kinematics_hash: What the driver compares with the hash of the arm's own kinematics.
        notes: What the file cannot hold; goes into comments.

    Raises:
        InputError: If the nominal arm has not the axes of Universal Robots' arms.
        WorkError: If the text read again is not the robot.
    """
    if not has_ur_structure(nominal):
        raise InputError(
            f"{nominal.name} is no arm of Universal Robots",
            rule="The file holds six joints that turn one by one: axes 2, 3 and 4 parallel, 1 meeting 2, 4 "
            "meeting 5 and 5 meeting 6 at a right angle",
            way_out="Use --to urdf",
        )
    origins, rest = joint_origins(robot)
    along_axis, rest = _split_axis(rest)
    origins[-1] = origins[-1] @ along_axis
    left = _rest_in_words(rest)
    kinematics: dict[str, Any] = {
        link: dict(zip(NUMBERS, _numbers(origin), strict=True))
        for link, origin in zip(LINKS, origins, strict=True)
    }
    kinematics["hash"] = kinematics_hash
    content = {"convention": URDF_CONVENTION, "kinematics": kinematics}
    text = as_comments([*notes, *left]) + yaml.safe_dump(content, sort_keys=False)
    again = robot_from_yaml(text, where="the YAML")
    return text, left, checked(robot, lambda q: again.pose(q) @ rest, "the YAML")


def _split_axis(transform: Floats) -> tuple[Floats, Floats]:
    """A motion about and along z, and what is left of a transform behind it."""
    angle = math.atan2(transform[1, 0] - transform[0, 1], transform[0, 0] + transform[1, 1])
    first = np.eye(4)
    c, s = math.cos(angle), math.sin(angle)
    first[:2, :2] = [[c, -s], [s, c]]
    first[2, 3] = transform[2, 3]
    left = np.linalg.inv(first) @ transform
    return (first @ left, np.eye(4)) if np.abs(left - np.eye(4)).max() < NOTHING else (first, left)


def _rest_in_words(rest: Floats) -> list[str]:
    if np.array_equal(rest, np.eye(4)):
        return []
    xyz = ", ".join(repr(float(x)) for x in rest[:3, 3])
    quaternion = ", ".join(repr(float(x)) for x in quaternion_from_matrix(rest[:3, :3]))
    return [
        f"The file ends at the axis of wrist 3: the calibrated flange is at xyz = [{xyz}] m, quaternion wxyz "
        f"= [{quaternion}] of wrist_3_link. Put that before the tool"
    ]


def _numbers(origin: Floats) -> list[float]:
    return [float(x) + 0.0 for x in (*origin[:3, 3], *roll_pitch_yaw(origin[:3, :3]))]
