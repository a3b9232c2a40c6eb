"""Between the robot file as written and the fields of a Robot in SI units."""

import json
from collections.abc import Iterable
from typing import Any

import numpy as np

from truearm.description.dh_row import row_transform
from truearm.description.robot_data import Payload, RobotData
from truearm.description.robot_file import Link, PayloadSection, Placement, RobotFile, Row, UrdfSection
from truearm.description.urdf_names import UrdfNames
from truearm.rotations import quaternion_from_matrix, transform_from_parts
from truearm.types import Floats
from truearm.units import to_si


def fields_of(file: RobotFile) -> dict[str, Any]:
    """Fields of a Robot: lengths in m, angles in rad."""
    count = len(file.link)
    matrix = np.eye(count) if file.coupling is None else np.array(file.coupling.matrix)
    has_base_row = file.base.is_row and bool(file.base.model_fields_set)
    return {
        "name": file.name,
        "source": file.source,
        "convention": file.convention,
        "joints": tuple(link.joint for link in file.link),
        "table": np.array([_row(link, file) for link in file.link]),
        "base": _transform(file.base, file),
        "flange": _transform(file.flange, file),
        "tool": _transform(file.tool, file),
        "base_row": _row(file.base, file) if has_base_row else None,
        "coupling": matrix * np.array([link.direction for link in file.link], dtype=np.float64),
        "limits": np.array([_limits(link, file) for link in file.link]),
        "payload": None if file.payload is None else _payload_of(file.payload),
        "urdf_names": None if file.urdf is None else _names_of(file.urdf),
    }


def write(robot: RobotData) -> str:
    """Text of a robot file in m and rad that describes `robot`."""
    diagonal = np.diag(robot.coupling)
    directed = np.array_equal(robot.coupling, np.diag(diagonal)) and set(diagonal) <= {-1.0, 1.0}
    lines = [
        f"name = {_quoted(robot.name)}",
        f"source = {_quoted(robot.source)}",
        f'convention = "{robot.convention}"',
        'length_unit = "m"',
        'angle_unit = "rad"',
        *_placement("base", robot.base, robot.base_row),
    ]
    for index in range(robot.joint_count):
        lines += _link(robot, index, int(diagonal[index]) if directed else 1)
    lines += _placement("flange", robot.flange) + _placement("tool", robot.tool)
    if not directed:
        rows = ",\n".join(f"    {_list(row)}" for row in robot.coupling)
        lines += ["", "[coupling]", f"matrix = [\n{rows},\n]"]
    if robot.payload is not None:
        lines += _payload(robot.payload)
    if robot.urdf_names is not None:
        lines += _names(robot.urdf_names)
    return "\n".join(lines) + "\n"


def _payload_of(section: PayloadSection) -> Payload:
    if section.centre_of_gravity_mm is None:
        return Payload(section.mass_kg)
    x, y, z = section.centre_of_gravity_mm
    return Payload(section.mass_kg, (x, y, z))


def _names_of(section: UrdfSection) -> UrdfNames:
    return UrdfNames(section.base_link, tuple(section.joints), tuple(section.links), section.tip_link)


def _row(row: Row, file: RobotFile) -> Floats:
    length, angle = file.length_unit, file.angle_unit
    return np.array(
        [
            to_si(row.theta, angle),
            to_si(row.d, length),
            to_si(row.a, length),
            to_si(row.alpha, angle),
            to_si(row.beta, angle),
        ]
    )


def _transform(placement: Placement, file: RobotFile) -> Floats:
    if placement.is_row:
        return row_transform(_row(placement, file), file.convention)
    xyz = np.array(placement.xyz or [0.0, 0.0, 0.0])
    quaternion = placement.quaternion_wxyz or [1.0, 0.0, 0.0, 0.0]
    return transform_from_parts(to_si(xyz, file.length_unit), quaternion)


def _limits(link: Link, file: RobotFile) -> Floats:
    if link.limits is None:
        return np.array([-np.inf, np.inf])
    unit = file.angle_unit if link.joint == "revolute" else file.length_unit
    return to_si(np.array(link.limits), unit)


def _link(robot: RobotData, index: int, direction: int) -> list[str]:
    theta, d, a, alpha, beta = robot.table[index].tolist()
    lines = ["", "[[link]]", f'joint = "{robot.joints[index]}"']
    lines += [f"theta = {theta!r}", f"d = {d!r}", f"a = {a!r}", f"alpha = {alpha!r}"]
    lines += [f"beta = {beta!r}"] if beta else []
    lines += [f"direction = {direction}"] if direction != 1 else []
    if np.isfinite(robot.limits[index]).any():
        lines.append(f"limits = {_list(robot.limits[index])}")
    return lines


def _placement(name: str, transform: Floats, row: Floats | None = None) -> list[str]:
    if row is not None:
        theta, d, a, alpha, beta = row.tolist()
        values = [f"theta = {theta!r}", f"d = {d!r}", f"a = {a!r}", f"alpha = {alpha!r}"]
        return ["", f"[{name}]", *values, f"beta = {beta!r}"]
    if np.array_equal(transform, np.eye(4)):
        return []
    quaternion = quaternion_from_matrix(transform[:3, :3])
    values = [f"xyz = {_list(transform[:3, 3])}", f"quaternion_wxyz = {_list(quaternion)}"]
    return ["", f"[{name}]", *values]


def _payload(payload: Payload) -> list[str]:
    lines = ["", "[payload]", f"mass_kg = {payload.mass_kg!r}"]
    if payload.centre_of_gravity_mm is not None:
        lines.append(f"centre_of_gravity_mm = {_list(payload.centre_of_gravity_mm)}")
    return lines


def _names(names: UrdfNames) -> list[str]:
    joints, links = (", ".join(map(_quoted, each)) for each in (names.joints, names.links))
    lists = [f"joints = [{joints}]", f"links = [{links}]"]
    ends = [f"base_link = {_quoted(names.base_link)}", f"tip_link = {_quoted(names.tip_link)}"]
    return ["", "[urdf]", *ends, *lists]


def _list(values: Iterable[float]) -> str:
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def _quoted(text: str) -> str:
    """A TOML basic string, whose escapes are those of JSON for all but DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
