"""An existing URDF with the origins of one chain corrected; all else, meshes and names included, stays."""

import math
from collections.abc import Mapping, Sequence
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np

from truearm.description.dh_from_axes import Axis
from truearm.description.joint_axes import axes_at_zero
from truearm.description.robot_data import RobotData
from truearm.description.urdf_ends import MOVING
from truearm.description.urdf_names import UrdfNames
from truearm.description.xml_as_written import xml_as_written
from truearm.errors import WorkError
from truearm.exporting.losses import is_directed
from truearm.exporting.new_urdf import set_origin
from truearm.rotations import matrix_from_euler, matrix_from_rotation_vector, rigid_inverse
from truearm.types import Floats

SAME: Final = 1e-12
DEFAULT_AXIS: Final = "1 0 0"


def patched_urdf(text: str, names: UrdfNames, robot: RobotData) -> ET.Element:
    """The <robot> of a URDF, its chain moved onto the axes of a calibrated robot.

    With the joints at zero, each moving joint's frame is turned and moved as little as puts its axis where
    the calibrated axis is, and the tip where the calibrated flange is; fixed joints on the way stay as they
    are, but for the first behind the last axis. Origins of joints beside the chain stay too.

    Args:
        text: The URDF, known to be well formed.
        names: The chain in it.
        robot: The calibrated arm; nominal, it has the URDF's forward kinematics.

    Raises:
        WorkError: If the arm's readings are coupled, or the tip is the last moving link itself and the
            calibrated flange is not on its axis.
    """
    if not is_directed(robot):
        raise WorkError(
            f"the readings of {robot.name} are coupled",
            rule="The joints of a URDF move one by one",
            way_out="Leave --urdf out: the joints of a new URDF are Denavit-Hartenberg joints",
        )
    root = xml_as_written(text)
    path = _path(root, names)
    lines, tip = axes_at_zero(robot)
    signs = np.diag(robot.coupling)
    targets = [_signed(line, sign) for line, sign in zip(lines, signs, strict=True)]
    moving = [joint for joint in path if joint.get("type") in MOVING]
    frames = dict(zip(map(id, moving), _frames(path, targets), strict=True))
    trailing = path[path.index(moving[-1]) + 1 :]
    if not trailing:
        frames[id(moving[-1])] = _flange_on_axis(moving[-1], targets[-1], tip)
    here = np.eye(4)
    for joint in path:
        wanted = frames.get(id(joint))
        if wanted is not None:
            set_origin(joint, rigid_inverse(here) @ wanted)
        elif trailing and joint is trailing[0]:
            rest = _product(trailing[1:])
            set_origin(joint, rigid_inverse(here) @ tip @ rigid_inverse(rest))
        here = wanted if wanted is not None else here @ _origin(joint)
    return root


def _path(root: ET.Element, names: UrdfNames) -> list[ET.Element]:
    """Joints from base to tip, in this order."""
    joint_to: Mapping[str, ET.Element] = {
        child.get("link", ""): joint
        for joint in root.findall("joint")
        if (child := joint.find("child")) is not None
    }
    path, link = list[ET.Element](), names.tip_link
    while link != names.base_link:
        path.insert(0, joint_to[link])
        parent = joint_to[link].find("parent")
        link = "" if parent is None else parent.get("link", "")
    return path


def _frames(path: Sequence[ET.Element], targets: Sequence[Axis]) -> list[Floats]:
    """Frames of the moving joints at zero, each as near as can be to where it is, on its target axis."""
    here, found = np.eye(4), list[Floats]()
    for joint in path:
        here = here @ _origin(joint)
        if joint.get("type") in MOVING:
            found.append(_onto(here, here[:3, :3] @ _direction(joint), targets[len(found)]))
    return found


def _onto(frame: Floats, direction: Floats, target: Axis) -> Floats:
    """`frame` with its axis, `direction` in the base frame, turned and moved onto another."""
    z, across = target.direction_in_base, np.cross(direction, target.direction_in_base)
    sine = float(np.linalg.norm(across))
    angle = math.atan2(sine, float(direction @ z))
    turn = matrix_from_rotation_vector(across * (angle / sine if sine > 0.0 else 0.0))
    moved = np.eye(4)
    moved[:3, :3] = turn @ frame[:3, :3]
    between = frame[:3, 3] - target.point_in_base
    moved[:3, 3] = target.point_in_base + (between @ z) * z
    return moved


def _flange_on_axis(joint: ET.Element, axis: Axis, tip: Floats) -> Floats:
    """The flange's frame as that of the last moving joint."""
    offset = np.cross(tip[:3, 3] - axis.point_in_base, axis.direction_in_base)
    tilt = tip[:3, :3] @ _direction(joint) - axis.direction_in_base
    apart = max(float(np.linalg.norm(offset)), float(np.linalg.norm(tilt)))
    if apart > SAME:
        child = joint.find("child")
        name = "" if child is None else child.get("link", "")
        raise WorkError(
            f'the calibrated flange is {apart:.1e} m or rad off the axis of joint "{joint.get("name")}", '
            f'and link "{name}" is the tip',
            rule="A URDF holds that in a fixed joint behind the last axis",
            way_out="Add one to the URDF, and name the link behind it: --urdf FILE.urdf#TIP",
        )
    return tip


def _signed(line: Axis, sign: float) -> Axis:
    return Axis(line.kind, line.point_in_base, sign * line.direction_in_base)


def _product(joints: Sequence[ET.Element]) -> Floats:
    product = np.eye(4)
    for joint in joints:
        product = product @ _origin(joint)
    return product


def _origin(joint: ET.Element) -> Floats:
    frame, element = np.eye(4), joint.find("origin")
    if element is not None:
        frame[:3, :3] = matrix_from_euler(_three(element.get("rpy", "0 0 0")), "xyz")
        frame[:3, 3] = _three(element.get("xyz", "0 0 0"))
    return frame


def _direction(joint: ET.Element) -> Floats:
    element = joint.find("axis")
    axis = _three(DEFAULT_AXIS if element is None else element.get("xyz", DEFAULT_AXIS))
    return np.asarray(axis / np.linalg.norm(axis))


def _three(text: str) -> Floats:
    return np.array([float(part) for part in text.split()])
