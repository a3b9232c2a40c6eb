"""Reading a URDF: the chain from base link to tip link as standard Denavit-Hartenberg rows.

Meshes, inertias and limits of effort are not read.
"""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from truearm.dh_from_axes import Axis, dh_from_axes
from truearm.errors import InputError, did_you_mean, list_names
from truearm.files import read_text
from truearm.robot_checks import MAX_LENGTH_M, NO_LONGER
from truearm.urdf_checks import check_urdf
from truearm.urdf_names import UrdfNames

Floats = NDArray[np.float64]
Kind = Literal["revolute", "prismatic"]
MOVING: Final[Mapping[str, Kind]] = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
}


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
    """

    name: str
    names: UrdfNames
    joints: tuple[Kind, ...]
    table: Floats
    base: Floats
    flange: Floats
    limits: Floats


def read_urdf(path: Path, base_link: str | None = None, tip_link: str | None = None) -> UrdfChain:
    """The chain from `base_link` (the root by default) to `tip_link` (the only leaf by default).

    Raises:
        InputError: If the file is no URDF, a link is unknown, several leaves leave the tip open, or
            the chain has no joint that moves or one that is neither revolute nor prismatic.
    """
    return urdf_chain(read_text(path), base_link, tip_link, where=str(path))


def urdf_chain(text: str, base_link: str | None, tip_link: str | None, *, where: str) -> UrdfChain:
    """The same of the text of a URDF; `where` names it in messages.

    Raises:
        InputError: As :func:`read_urdf`.
    """
    try:
        return _read(text, base_link, tip_link)
    except InputError as error:
        raise error.at(where) from None


def _read(text: str, base_link: str | None, tip_link: str | None) -> UrdfChain:
    robot = _parse(text)
    joint_to = {joint.child: joint for joint in robot.joints}
    parents = {joint.parent for joint in robot.joints}
    links = [link.name for link in robot.links]
    base = base_link or _only([name for name in links if name not in joint_to], "base_link", links)
    leaves = [name for name in links if name not in parents]
    tip = tip_link or _only(leaves, "tip_link", links)
    for name in (base, tip):
        if name not in links:
            hint = did_you_mean(name, links) or f"Its links end in {list_names(leaves)}"
            raise InputError(f'there is no link "{name}"', rule=hint)
    joints = _path(joint_to, base, tip)
    axes, base_from_tip = _axes(joints)
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
        limits=np.array([_limits(joint) for joint in moving]),
    )


def _parse(text: str) -> Any:  # noqa: ANN401
    """The parser's robot: links and joints with their origins, axes and limits."""
    from yourdfpy import URDF  # noqa: PLC0415

    check_urdf(text)
    try:
        model = URDF.load(io.BytesIO(text.encode()), build_scene_graph=False, load_meshes=False)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"the URDF cannot be read: {error}",
            rule="Every joint needs a name, a type, a parent, a child and numbers in its attributes",
        ) from None
    return model.robot


def _only(candidates: Sequence[str], argument: str, links: Sequence[str]) -> str:
    if len(candidates) == 1:
        return candidates[0]
    if not candidates:
        raise InputError(f"its {len(links)} links form no tree")
    way_out = f'Name one: {argument}=..., or "FILE.urdf#TIP" or "FILE.urdf#BASE,TIP" where a robot is named'
    raise InputError(
        f"the chain may {'end' if argument == 'tip_link' else 'start'} at {list_names(candidates, 'or')}",
        way_out=way_out,
    )


def _path(joint_to: Mapping[str, Any], base: str, tip: str) -> list[Any]:
    """Joints from `base` to `tip`, in this order."""
    joints: list[Any] = []
    link = tip
    while link != base:
        if link not in joint_to or len(joints) > len(joint_to):
            raise InputError(f'link "{tip}" is not behind link "{base}"')
        joints.insert(0, joint_to[link])
        link = joint_to[link].parent
    return joints


def _axes(joints: Sequence[Any]) -> tuple[list[Axis], Floats]:
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
                    way_out="Describe the arm in a robot file with [coupling]",
                )
            axes.append(Axis(MOVING[joint.type], frame[:3, 3], frame[:3, :3] @ _direction(joint)))
        elif joint.type != "fixed":
            raise InputError(
                f"its type is {joint.type}",
                where=f'joint "{joint.name}"',
                rule="The chain may have revolute, continuous, prismatic and fixed joints",
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


def _limits(joint: Any) -> tuple[float, float]:  # noqa: ANN401
    limit = joint.limit
    if joint.type == "continuous" or limit is None:
        return -np.inf, np.inf
    if limit.lower is None and limit.upper is None:
        return -np.inf, np.inf
    lower, upper = limit.lower or 0.0, limit.upper or 0.0
    if lower >= upper:
        raise InputError(
            f"limits {lower:g} to {upper:g}",
            where=f'joint "{joint.name}"',
            rule="The lower limit must be below the upper one",
        )
    return lower, upper
