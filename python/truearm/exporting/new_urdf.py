"""A URDF of the chain alone: links without shape, joints with their origins, axes and limits."""

import re
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np

from truearm.description.robot_data import RobotData
from truearm.description.urdf_limits import UNLIMITED
from truearm.description.urdf_names import UrdfNames
from truearm.errors import list_rows
from truearm.exporting.losses import is_directed
from truearm.exporting.origins import joint_origins, roll_pitch_yaw
from truearm.types import Floats

UNITS: Final = {"revolute": "rad", "prismatic": "m"}


def new_urdf(robot: RobotData, names: UrdfNames) -> ET.Element:
    """The <robot>; the chain from names.base_link to names.tip_link is base to flange.

    A tool that is not the flange follows as a link "tool0" behind it.
    """
    directed = is_directed(robot)
    origins, last = joint_origins(robot)
    root = ET.Element("robot", name=_identifier(robot.name))
    links = [names.base_link, *names.links, names.tip_link]
    for j, origin in enumerate(origins):
        joint = _joint(names.joints[j], _type(robot, j, directed=directed), links[j], links[j + 1], origin)
        sign = robot.coupling[j, j] if directed else 1.0
        ET.SubElement(joint, "axis", xyz=_numbers([0.0, 0.0, sign]))
        _limit(joint, robot, j, directed=directed)
        root.append(joint)
    root.append(_joint(f"{names.tip_link}_fixed", "fixed", links[-2], links[-1], last))
    if not np.array_equal(robot.tool, np.eye(4)):
        tool = _free_name("tool0", links)
        root.append(_joint(f"{tool}_fixed", "fixed", links[-1], tool, robot.tool))
        links.append(tool)
    for position, link in enumerate(links):
        root.insert(position, ET.Element("link", name=link))
    return root


def default_names(robot: RobotData) -> UrdfNames:
    """Names of a chain that has none of its own."""
    numbers = range(1, robot.joint_count + 1)
    return UrdfNames(
        base_link="base_link",
        joints=tuple(f"joint_{j}" for j in numbers),
        links=tuple(f"link_{j}" for j in numbers),
        tip_link="flange",
    )


def unstated_limits(robot: RobotData) -> list[str]:
    """What numbers stand for that a URDF needs where a limit is open, or no calibration knows it."""
    notes = [
        "Limits of effort and velocity, which no calibration knows, are 0 here: put in the maker's, or "
        "correct the maker's URDF, which keeps its own"
    ]
    joints = range(robot.joint_count) if is_directed(robot) else ()
    for kind, unit in UNITS.items():
        open_ended = [
            j + 1
            for j in joints
            if _type(robot, j, directed=True) == kind and np.isinf(robot.limits[j]).any()
        ]
        if open_ended:
            notes.append(
                f"{list_rows(open_ended, 'joint').capitalize()} may go on without end one way or both, "
                f"where a URDF needs a number: {UNLIMITED[kind]:g} {unit} stand for no limit"
            )
    return notes


def set_origin(joint: ET.Element, origin: Floats) -> None:
    """Write the origin (4, 4) of a joint to its last digit."""
    element = joint.find("origin")
    if element is None:
        element = ET.Element("origin")
        joint.insert(0, element)
    element.set("xyz", _numbers(origin[:3, 3]))
    element.set("rpy", _numbers(roll_pitch_yaw(origin[:3, :3])))


def _joint(name: str, kind: str, parent: str, child: str, origin: Floats) -> ET.Element:
    joint = ET.Element("joint", name=name, type=kind)
    set_origin(joint, origin)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    return joint


def _type(robot: RobotData, j: int, *, directed: bool) -> str:
    """What a URDF calls the joint: continuous where it turns and has no limit at either end."""
    unlimited = not directed or not np.isfinite(robot.limits[j]).any()
    return "continuous" if robot.joints[j] == "revolute" and unlimited else robot.joints[j]


def _limit(joint: ET.Element, robot: RobotData, j: int, *, directed: bool) -> None:
    if joint.get("type") == "continuous":
        return
    bounds = robot.limits[j] if directed else np.array([-np.inf, np.inf])
    none = UNLIMITED[robot.joints[j]]
    lower, upper = np.clip(bounds, -none, none).tolist()
    ET.SubElement(joint, "limit", lower=repr(lower), upper=repr(upper), effort="0", velocity="0")


def _numbers(values: Floats | list[float] | tuple[float, ...]) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)


def _identifier(name: str) -> str:
    return re.sub(r"\W+", "_", name.casefold()).strip("_") or "arm"


def _free_name(wanted: str, taken: list[str]) -> str:
    while wanted in taken:
        wanted += "_tool"
    return wanted
