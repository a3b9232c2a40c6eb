"""Universal Robots' own kinematics of an arm: the ROS driver's YAML, and the controller's calibration.conf.

The YAML holds, for each of six links, the transform from the link before it (x y z in m; roll, pitch, yaw
in rad) that the joint's turn about z follows. UR's extraction tool (ur_calibration) takes roll, pitch and yaw
as turns about x, the new y and the new z; a URDF, into which the driver's description puts the same numbers,
as turns about the fixed x, y and z. The two differ by micrometres. What truearm writes is meant for the
URDF and says so by a key, `convention: urdf`; files without it are read as the tool meant them, because
they are asked what the controller computes with.

calibration.conf (in /root/.urcontrol, or a magic file of it) holds what the factory added to theta, a, d and
alpha of each row of the nominal Denavit-Hartenberg table.
"""

import configparser
import json
import math
import re
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, Final

import numpy as np
import yaml

from truearm.description.dh_from_axes import Axis, dh_from_axes
from truearm.description.joint_axes import axes_at_zero
from truearm.errors import InputError, list_names
from truearm.robot import Robot
from truearm.rotations import quaternion_from_euler, transform_from_parts
from truearm.types import Floats

LINKS: Final = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
NUMBERS: Final = ("x", "y", "z", "roll", "pitch", "yaw")
URDF_CONVENTION: Final = "urdf"
DELTAS: Final = {"delta_theta": 0, "delta_d": 1, "delta_a": 2, "delta_alpha": 3}
ONE_TURN_EACH_WAY: Final = (-2.0 * np.pi, 2.0 * np.pi)
PARALLEL: Final = (False, True, True, False, False)
"""Whether each axis is parallel to the next one, else they meet at a right angle."""
ABOUT_RAD: Final = 0.05
ABOUT_M: Final = 0.01
"""No arm is built so badly that its axes are further from what the drawing has."""


def has_ur_structure(robot: Robot) -> bool:
    """Whether an arm's six joints turn one by one about axes that lie as those of Universal Robots' arms do.

    Axes 2, 3 and 4 are parallel; 1 meets 2, 4 meets 5 and 5 meets 6 at a right angle.
    """
    if robot.joints != ("revolute",) * len(LINKS) or robot.is_coupled:
        return False
    axes, _ = axes_at_zero(robot)
    pairs = zip(pairwise(axes), PARALLEL, strict=True)
    return all(_are_parallel(*pair) if parallel else _meet_squarely(*pair) for pair, parallel in pairs)


def _are_parallel(one: Axis, other: Axis) -> bool:
    sine = np.linalg.norm(np.cross(one.direction_in_base, other.direction_in_base))
    return bool(sine < math.sin(ABOUT_RAD))


def _meet_squarely(one: Axis, other: Axis) -> bool:
    if abs(one.direction_in_base @ other.direction_in_base) > math.sin(ABOUT_RAD):
        return False
    normal = np.cross(one.direction_in_base, other.direction_in_base)
    between = (other.point_in_base - one.point_in_base) @ normal / np.linalg.norm(normal)
    return bool(abs(between) < ABOUT_M)


def robot_from_yaml(text: str, *, where: str, nominal: Robot | None = None) -> Robot:
    """The arm that a UR kinematics YAML describes, in the controller's base frame.

    Args:
        text: Text of the file.
        where: Its name, for messages.
        nominal: The arm it is of, for its name, limits and tool; without it a joint may turn once each way.

    Raises:
        InputError: If the text is no YAML, or a link or number is missing; names it.
    """
    content = _yaml(text, where)
    kinematics = content.get("kinematics")
    if not isinstance(kinematics, Mapping):
        raise InputError(
            'there is no "kinematics"',
            where=where,
            rule="A kinematics file of Universal Robots' ROS driver has it at its top",
        )
    urdf = content.get("convention") == URDF_CONVENTION
    origins = [_origin(kinematics, link, urdf=urdf, where=where) for link in LINKS]
    axes, frame = list[Axis](), np.eye(4)
    for origin in origins:
        frame = frame @ origin
        axes.append(Axis("revolute", frame[:3, 3], frame[:3, 2]))
    return _robot(axes, frame, source=f"{where}, {kinematics.get('hash', 'no hash')}", nominal=nominal)


def robot_from_conf(text: str, *, where: str, nominal: Robot | None) -> Robot:
    """The arm that UR's calibration.conf makes of the nominal one.

    Raises:
        InputError: If a list is missing or has not six numbers, or no nominal six-axis table was given.
    """
    if nominal is None:
        raise InputError(
            "calibration.conf says what the factory added to the nominal table, not the table",
            where=where,
            way_out="Name the arm as well",
        )
    if nominal.joint_count != len(LINKS) or nominal.convention != "standard":
        raise InputError(
            f"{nominal.name} has {nominal.joint_count} {nominal.convention} rows",
            where=where,
            rule="It must be an arm of Universal Robots: six rows in the standard convention",
        )
    section = _mounting(text, where)
    table = nominal.table.copy()
    for key, column in DELTAS.items():
        table[:, column] += _six_numbers(section, key, where)
    axes, end = axes_at_zero(_with_table(nominal, table))
    return _robot(axes, end, source=where, nominal=nominal)


def _with_table(robot: Robot, table: Floats) -> Robot:
    return Robot.from_dict({**robot.to_dict(), "table": table.tolist()})


def _robot(axes: list[Axis], end: Floats, *, source: str, nominal: Robot | None) -> Robot:
    base, table, flange = dh_from_axes(axes, end)
    count = len(axes)
    kept: dict[str, Any] = {"name": "UR", "tool": np.eye(4), "limits": np.tile(ONE_TURN_EACH_WAY, (count, 1))}
    if nominal is not None and nominal.joint_count == count:
        kept = {key: getattr(nominal, key) for key in (*kept, "payload")}
    return Robot(
        **kept,
        source=source,
        convention="standard",
        joints=tuple(axis.kind for axis in axes),
        table=table,
        base=base,
        flange=flange,
        base_row=None,
        coupling=np.eye(count),
    )


def _yaml(text: str, where: str) -> Mapping[str, Any]:
    try:
        content = yaml.safe_load(text)
    except yaml.YAMLError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"this is no YAML: {reason}", where=where) from None
    if not isinstance(content, Mapping):
        raise InputError("this YAML holds no keys", where=where, rule='It must have "kinematics" at its top')
    return content


def _origin(kinematics: Mapping[str, Any], link: str, *, urdf: bool, where: str) -> Floats:
    part = kinematics.get(link)
    if not isinstance(part, Mapping):
        raise InputError(f'there is no link "{link}"', where=where, rule=f"It needs {list_names(LINKS)}")
    values = np.array([_number(part, key, f"{where}, {link}") for key in NUMBERS])
    quaternion = quaternion_from_euler(values[None, 3:], "xyz" if urdf else "XYZ")[0]
    return transform_from_parts(values[:3], quaternion)


def _number(part: Mapping[str, Any], key: str, where: str) -> float:
    value = part.get(key)
    # YAML 1.1 takes 1e-05 without a dot for text.
    if isinstance(value, str) and re.fullmatch(r"[-+]?\d+[eE][-+]?\d+", value):
        value = float(value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise InputError(f"{key} is {value!r}", where=where, rule="It must be a number, in m or rad")
    return float(value)


def _mounting(text: str, where: str) -> Mapping[str, str]:
    parser = configparser.ConfigParser(inline_comment_prefixes=("#", ";"), interpolation=None, strict=False)
    try:
        parser.read_string(text)
    except configparser.Error as error:
        raise InputError(
            f"this is no calibration.conf: {' '.join(str(error).split())}", where=where
        ) from None
    if "mounting" not in parser:
        raise InputError(
            'there is no section "[mounting]"',
            where=where,
            rule="UR's calibration.conf keeps its lists there",
        )
    return parser["mounting"]


def _six_numbers(section: Mapping[str, str], key: str, where: str) -> Floats:
    given = section.get(key)
    if given is None:
        raise InputError(f'there is no "{key}"', where=where, rule=f"It needs {list_names(DELTAS)}")
    try:
        values = np.array(json.loads(given), dtype=np.float64)
    except (ValueError, TypeError):
        raise InputError(f"{key} is {given}", where=where, rule="It must be a list of six numbers") from None
    if values.shape != (len(LINKS),) or not np.isfinite(values).all():
        raise InputError(f"{key} is {given}", where=where, rule="It must be a list of six numbers")
    return values
