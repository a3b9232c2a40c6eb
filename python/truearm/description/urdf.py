"""Reading a URDF: the chain from base link to tip link as standard Denavit-Hartenberg rows.

Meshes, inertias and limits of effort are not read.
"""

import io
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET

import numpy as np

from truearm.description.dh_from_axes import Axis, dh_from_axes
from truearm.description.robot_checks import MAX_LENGTH_M, NO_LONGER
from truearm.description.urdf_checks import check_urdf
from truearm.description.urdf_ends import MOVING, Kind, chain_between
from truearm.description.urdf_limits import joint_limits
from truearm.description.urdf_names import UrdfNames
from truearm.description.urdf_rounding import rounded_by
from truearm.description.xml_as_written import xml_as_written
from truearm.errors import InputError, TruearmError
from truearm.files import read_text
from truearm.types import Floats

READ: Final = {"origin": ("xyz", "rpy"), "axis": ("xyz",), "limit": ("lower", "upper"), "mimic": ("joint",)}
"""Elements of a joint that are read, and their attributes."""


@dataclass(frozen=True)
class UrdfChain:
    """A serial chain of a URDF in standard Denavit-Hartenberg form, SI units.

    Attributes:
        name: Name of the robot in the file.
        names: Names of the chain's links and joints.
        joints: Kind of each of the N joints that move.
        table: Parameters (N, 5).
        base: Transform (4, 4) from the base link to the first row.
        flange: Transform (4, 4) from the last row to the tip link.
        limits: Lowest and highest joint value (N, 2).
        rounded_rad: By how much right angles of the chain are rounded at most.
    """

    name: str
    names: UrdfNames
    joints: tuple[Kind, ...]
    table: Floats
    base: Floats
    flange: Floats
    limits: Floats
    rounded_rad: float


def read_urdf(path: Path, base_link: str | None = None, tip_link: str | None = None) -> UrdfChain:
    """The chain from `base_link` (by default the root) to `tip_link` (by default the only leaf that moves).

    Raises:
        InputError: If the file is no URDF, a link is unknown, several leaves leave the tip open, or
            the chain has no joint that moves or one that is neither revolute nor prismatic.
    """
    return urdf_chain(read_text(path), base_link, tip_link, where=str(path))


def urdf_chain(text: str, base_link: str | None, tip_link: str | None, *, where: str) -> UrdfChain:
    """The chain of a URDF that is given as text; `where` names it in messages.

    Raises:
        InputError: As :func:`read_urdf`.
    """
    try:
        return _read(text, base_link, tip_link)
    except TruearmError as error:
        raise error.at(where) from None


def _read(text: str, base_link: str | None, tip_link: str | None) -> UrdfChain:
    check_urdf(text)
    written = xml_as_written(text)
    robot = _parse(written)
    base, tip, joints = chain_between([link.name for link in robot.links], robot.joints, base_link, tip_link)
    axes, base_from_tip = _axes(joints, tip)
    if not axes:
        raise InputError(f'no joint moves between "{base}" and "{tip}"')
    base_transform, table, flange = dh_from_axes(axes, base_from_tip)
    moving = [joint for joint in joints if joint.type in MOVING]
    return UrdfChain(
        name=robot.name,
        names=UrdfNames(
            base_link=base,
            joints=tuple(joint.name for joint in moving),
            links=tuple(joint.child for joint in moving),
            tip_link=tip,
        ),
        joints=tuple(axis.kind for axis in axes),
        table=table,
        base=base_transform,
        flange=flange,
        limits=np.array([joint_limits(joint) for joint in moving]),
        rounded_rad=rounded_by(_angles(written, {joint.child for joint in joints})),
    )


def _parse(written: ET.Element) -> Any:  # noqa: ANN401
    """The parser's robot: links and joints with their origins, axes and limits."""
    from yourdfpy import URDF  # noqa: PLC0415

    try:
        model = URDF.load(
            io.BytesIO(ET.tostring(_kinematics(written))), build_scene_graph=False, load_meshes=False
        )
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"the URDF cannot be read: {error}",
            rule="Every joint needs a name, a type, a parent, a child and numbers in its attributes",
        ) from None
    return model.robot


def _angles(robot: ET.Element, children: Collection[str]) -> list[str]:
    """What the joints that lead to these links say of roll, pitch and yaw."""
    joints = [joint for joint in robot.findall("joint") if _link(joint, "child") in children]
    origins = [origin for joint in joints if (origin := joint.find("origin")) is not None]
    return [origin.get("rpy", "") for origin in origins]


def _link(joint: ET.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _kinematics(robot: ET.Element) -> ET.Element:
    """Links and joints without shapes, masses, motors and what other programs add, which are not read."""
    kept = ET.Element("robot", name=robot.get("name", ""))
    for link in robot.findall("link"):
        ET.SubElement(kept, "link", name=link.get("name", ""))
    for joint in robot.findall("joint"):
        copy = ET.SubElement(kept, "joint", name=joint.get("name", ""), type=joint.get("type", ""))
        for name, attributes in {"parent": ("link",), "child": ("link",), **READ}.items():
            element = joint.find(name)
            if element is not None:
                written = {key: element.attrib[key] for key in attributes if key in element.attrib}
                ET.SubElement(copy, name, written)
    return kept


def _axes(joints: Sequence[Any], tip: str) -> tuple[list[Axis], Floats]:
    """Axes of the joints that move, and base_from_tip (4, 4), all joints at zero."""
    frame = np.eye(4)
    axes = []
    for joint in joints:
        if joint.origin is not None:
            _check_length(joint)
            frame = frame @ joint.origin
        if joint.type in MOVING:
            if joint.mimic is not None:
                raise InputError(
                    f'it follows joint "{joint.mimic.joint}"',
                    where=f'joint "{joint.name}"',
                    rule="Every joint of the chain must move by itself",
                    way_out=f'End the chain before it: "FILE.urdf#{joint.parent}", or describe the arm in a '
                    "robot file with [coupling]",
                )
            axes.append(Axis(MOVING[joint.type], frame[:3, 3], frame[:3, :3] @ _direction(joint)))
        elif joint.type != "fixed":
            raise InputError(
                f"its type is {joint.type}",
                where=f'joint "{joint.name}"',
                rule="The chain may have revolute, continuous, prismatic and fixed joints",
                way_out=f'Begin the chain behind it: "FILE.urdf#{joint.child},{tip}"'
                if joint.child != tip
                else "",
            )
    return axes, frame


def _check_length(joint: Any) -> None:  # noqa: ANN401
    """Raise InputError where a joint is farther from the one before than any link of an arm is long."""
    away = float(np.linalg.norm(joint.origin[:3, 3]))
    if away > MAX_LENGTH_M:
        raise InputError(
            f"its origin is {away:.6g} m from the joint before",
            where=f'joint "{joint.name}"',
            rule=f"{NO_LONGER}, and a URDF is in metres",
            way_out="If these are millimetres, divide all xyz, and limits of prismatic joints, by 1000",
        )


def _direction(joint: Any) -> Floats:  # noqa: ANN401
    length = np.linalg.norm(joint.axis)
    if joint.axis.shape != (3,) or not 0.0 < length < np.inf:
        raise InputError(f"axis {joint.axis} has no direction", where=f'joint "{joint.name}"')
    return np.asarray(joint.axis / length)
