"""Paths as CSV: a header line, then one waypoint a row, as joints or as poses with or without a seed.

Columns are those of measurement files (docs/reference/measurements.md): q1 ... qN in rad and m, or with a
unit, as q1_deg; x, y, z in m, or x_mm; qw, qx, qy, qz, or rx, ry, rz for a rotation vector in rad, or rx_deg.
Where there are both joints and a pose, the pose is the waypoint and the joints are what its solution is
looked for next to. Other columns are kept as they are.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.named_values import JOINT
from truearm.programs.environment import IDENTITY, Environment, Environments, Frame
from truearm.programs.frames import Frames
from truearm.programs.layouts import Joints, Layout, QuaternionPose, RotationVectorPose
from truearm.programs.program import BlendsShortened, LinearStep, Program, StepTexts
from truearm.programs.scanning import NumberColumns, Scan
from truearm.programs.source import Source
from truearm.programs.tables import Motion, MoveTable, TargetTable
from truearm.robot import Robot
from truearm.rotations import UNIT_QUATERNIONS, UNIT_TOLERANCE
from truearm.tables.columns import QUATERNION, TARGET_COLUMN
from truearm.tables.reading import DELIMITERS
from truearm.types import Floats, Integers
from truearm.units import to_si

VALUES: Final = NumberColumns._fields.index("values")

ROTATION: Final = re.compile(r"r([xyz])(?:_(rad|deg))?")
_FIELD: Final = re.compile(r'(?:[^,"]|"[^"]*")*')


@dataclass(frozen=True)
class _Part:
    """Columns that make one target: their places in a row, and what makes SI of each number."""

    layout: int
    columns: tuple[int, ...]
    factors: tuple[float, ...]
    required: bool


class CsvPath(BlendsShortened):
    """Waypoints in a table."""

    name = "CSV path"
    endings = (".csv",)
    maker = ""
    controller_differs = ""

    def companions(self, path: Path) -> tuple[Path, ...]:
        """None."""
        return ()

    def read(self, sources: Sequence[Source], robot: Robot, frames: Frames) -> Program:
        """As in Language."""
        reader = _Reader(sources[0], robot)
        environments = Environments()
        environments.number(
            Environment(
                tool=frames.held("tool", "tool") or Frame.of(robot.tool, "tool"),
                work_object=frames.held("object", "object") or IDENTITY,
                payload_kg=frames.payloads_kg.get("tool"),
            )
        )
        targets, moves = reader.tables()
        return Program(
            language=self,
            sources=tuple(sources),
            layouts=reader.layouts,
            targets=targets.freeze(),
            moves=moves.freeze(),
            environments=tuple(environments.all),
        )

    def mark(self, source: Source, text: str) -> tuple[int, str]:
        """A remark before the header."""
        return source.first, f"# {text}{source.newline}"

    def linear_steps(self, program: Program, moves: Sequence[Sequence[LinearStep]]) -> StepTexts:
        """Nothing: a path says itself how densely it is sampled."""
        why = "a path gets no rows but its author's"
        return StepTexts(impossible=tuple(steps[0].move for steps in moves), why=why)


class _Reader:
    """One table.

    Attributes:
        layouts: How its numbers are meant.
    """

    layouts: tuple[Layout, ...]

    def __init__(self, source: Source, robot: Robot) -> None:
        self._source = source
        if b"\n" not in source.content and b"\r" in source.content:
            source.fail(0, "its lines end with CR alone", way_out="Save it with LF or CR LF")
        self._scan = Scan(source.content)
        self._header = self._find_header()
        fields = self._fields(self._header)
        self._names = [name.strip().strip('"') for name in fields]
        self._joints = robot.joints
        quaternion = all(name in self._names for name in QUATERNION)
        self.layouts = (
            Joints.of(robot.joints, degrees=False, millimetres=False),
            QuaternionPose() if quaternion else RotationVectorPose(),
        )
        self._parts = self._find_parts(quaternion=quaternion)

    def tables(self) -> tuple[TargetTable, MoveTable]:
        """Targets and moves, row by row; of a row with both, joints come first and are not moved to."""
        order, columns = self._all()
        targets, moves = TargetTable(), MoveTable()
        layout = columns[0][order]
        at = columns[1][order]
        edges = np.flatnonzero(np.diff(layout, prepend=-1))
        for first, last in zip(edges, [*edges[1:], len(order)], strict=True):
            rows = order[first:last]
            width = self.layouts[int(layout[first])].width
            numbers = [column[rows][:, :width] for column in columns[2:]]
            self._check_turns(self.layouts[int(layout[first])], numbers[VALUES], at[rows])
            targets.extend(0, at[first:last], int(layout[first]), numbers)
        both = len(self._parts) == 2
        motion = np.where(
            (layout == 0) & both, int(Motion.SEED), np.where(layout == 0, Motion.JOINT, Motion.LINEAR)
        )
        # No line leads to where a path begins.
        motion[np.flatnonzero(motion != Motion.SEED)[:1]] = Motion.JOINT
        count = len(order)
        zeros = np.zeros(count, dtype=np.int64)
        ones = np.ones(count, dtype=np.int64)
        follows = np.arange(count) > 0
        moves.extend([np.arange(count), zeros, at, motion, ones, zeros, follows.astype(np.int64)])
        return targets, moves

    def _all(self) -> tuple[Integers, list[NDArray[Any]]]:
        """Order in the text, and columns layout, offset and numbers of all targets, kind by kind of row."""
        width = max(self.layouts[part.layout].width for part in self._parts)
        found: list[list[NDArray[Any]]] = []
        for kind, example in enumerate(self._scan.first_of):
            lines = np.flatnonzero(self._scan.kind == kind)
            lines = lines[lines > self._header]
            if len(lines) == 0 or self._is_remark(int(example)):
                continue
            places = self._places(int(lines[0]))
            found += [one for part in self._parts if (one := self._columns(part, places, lines, width))]
        if not found:
            self._source.fail(int(self._scan.starts[self._header]), "there are no rows below the header")
        columns = [np.concatenate(parts) for parts in zip(*found, strict=True)]
        order = np.lexsort((columns[0], columns[1]))
        return order, columns

    def _check_turns(self, layout: Layout, values: Floats, at: Integers) -> None:
        if isinstance(layout, QuaternionPose):
            lengths = np.linalg.norm(values[:, 3:7], axis=1)
            off = np.flatnonzero(np.abs(lengths - 1.0) > UNIT_TOLERANCE)
            if len(off):
                what = f"the quaternion qw qx qy qz has length {lengths[off[0]]:.6g}"
                self._source.fail(int(at[off[0]]), what, rule=UNIT_QUATERNIONS)

    def _columns(
        self, part: _Part, places: list[int | None], lines: Integers, width: int
    ) -> list[NDArray[Any]]:
        """Columns of the targets of one part in rows of one kind; none where their cells are empty."""
        chosen = [places[column] for column in part.columns]
        empty = [column for column, place in zip(part.columns, chosen, strict=True) if place is None]
        if empty and (part.required or len(empty) < len(chosen)):
            self._fail_cell(int(lines[0]), empty[0])
        if empty:
            return []
        numbers = self._scan.columns(lines, [place for place in chosen if place is not None])
        factors = np.broadcast_to(part.factors, numbers.values.shape)
        layout = np.full(len(lines), part.layout)
        return [layout, self._scan.starts[lines], *(_padded(column, width) for column in (*numbers, factors))]

    def _is_remark(self, line: int) -> bool:
        text = self._line(line).strip()
        return not text or text.startswith("#")

    def _line(self, line: int) -> str:
        start = max(int(self._scan.starts[line]), self._source.first)
        return self._source.part(start, int(self._scan.starts[line + 1]))

    def _fields(self, line: int) -> list[str]:
        """The fields of a line."""
        text = self._line(line).rstrip("\r\n")
        fields, at = [], 0
        while at <= len(text):
            found = _FIELD.match(text, at)
            end = found.end() if found is not None else len(text)
            fields.append(text[at:end])
            at = max(end, at) + 1
        return fields

    def _find_header(self) -> int:
        for line in range(len(self._scan.kind)):
            if not self._is_remark(line):
                return line
        return self._source.fail(0, "the file is empty", rule="A header and rows are needed")

    def _places(self, line: int) -> list[int | None]:
        """Which number of the line each field is; None for an empty field, or one of text."""
        fields = self._fields(line)
        start = int(self._scan.starts[line])
        if len(fields) != len(self._names):
            self._source.fail(start, f"there are {len(fields)} fields, and {len(self._names)} in the header")
        numbers = self._scan.numbers(line)
        known = {int(at): place for place, at in enumerate(numbers.starts[0])}
        ends = numbers.ends[0]
        places: list[int | None] = []
        for name, text in zip(self._names, fields, strict=True):
            at = start + len(text) - len(text.lstrip())
            end = start + len(text.rstrip())
            if end - at > 1 and text.strip()[0] == text.strip()[-1] == '"':
                at, end = at + 1, end - 1
            place = known.get(at)
            whole = place is not None and int(ends[place]) == end
            if not whole and text.strip() and self._is_needed(name):
                self._source.fail(at, f'"{text.strip()}" in column "{name}" is no number')
            places.append(place if whole else None)
            start += len(text) + 1
        return places

    def _is_needed(self, name: str) -> bool:
        return any(name == self._names[column] for part in self._parts for column in part.columns)

    def _fail_cell(self, line: int, column: int) -> None:
        self._source.fail(
            int(self._scan.starts[line]),
            f'there is nothing in column "{self._names[column]}"',
            rule="A waypoint needs all of its numbers; joints beside a pose may be left out together",
        )

    def _find_parts(self, *, quaternion: bool) -> list[_Part]:
        names = dict(enumerate(self._names))
        joints = {int(m[1]): (c, m[2] or "") for c, n in names.items() if (m := JOINT.fullmatch(n))}
        points = {
            m[1]: (c, m[3] or "m") for c, n in names.items() if (m := TARGET_COLUMN.fullmatch(n)) and not m[2]
        }
        turns = {m[1]: (c, m[2] or "rad") for c, n in names.items() if (m := ROTATION.fullmatch(n))}
        wanted = range(1, len(self._joints) + 1)
        self._check_once()
        self._check_joints(joints)
        has_pose = set(points) == set("xyz") and (quaternion or set(turns) == set("xyz"))
        has_joints = set(joints) == set(wanted)
        if joints and not has_joints:
            self._fail_header(f"there are joints {sorted(joints)}, and the arm has {len(self._joints)}")
        if not has_joints and not has_pose:
            mark = next((each for each in DELIMITERS if each != "," and each in self._names[0]), None)
            found = "" if mark is None else f": its fields are separated by {DELIMITERS[mark]}, not commas"
            self._fail_header(f"there are neither all joints nor a whole pose{found}")
        turned = [column for column, name in names.items() if name in QUATERNION]
        parts_of_pose = [*turned, *(column for column, _ in [*points.values(), *turns.values()])]
        if parts_of_pose and not has_pose:
            named = [self._names[column] for column in sorted(parts_of_pose)]
            self._fail_header(f"{', '.join(named)} make no whole pose, and would stay as they are")
        parts = []
        if has_joints:
            columns = tuple(joints[joint][0] for joint in wanted)
            factors = tuple(_si(unit) for _, unit in (joints[joint] for joint in wanted))
            parts.append(_Part(0, columns, factors, required=not has_pose))
        if has_pose:
            parts.append(self._pose_part(points, turns, quaternion=quaternion))
        return parts

    def _check_once(self) -> None:
        """No two columns say the same: one of them would stay as it was."""
        said: dict[str, str] = {}
        for name in self._names:
            coordinate = _coordinate(name)
            if coordinate and coordinate in said:
                self._fail_header(f'"{said[coordinate]}" and "{name}" say the same')
            said[coordinate] = name
        vector = [said[turn] for turn in ("rx", "ry", "rz") if turn in said]
        quaternion = [said[part] for part in QUATERNION if part in said]
        if vector and quaternion:
            self._fail_header(
                f"{', '.join(quaternion)} and {', '.join(vector)} both say how the tool is turned"
            )

    def _check_joints(self, joints: Mapping[int, tuple[int, str]]) -> None:
        """Each joint is in a unit of its kind."""
        for joint, (column, unit) in joints.items():
            kind = self._joints[joint - 1] if joint <= len(self._joints) else ""
            if kind and unit and (unit in ("m", "mm")) != (kind == "prismatic"):
                self._fail_header(f"{self._names[column]}: joint {joint} is {kind}")

    def _pose_part(
        self, points: dict[str, tuple[int, str]], turns: dict[str, tuple[int, str]], *, quaternion: bool
    ) -> _Part:
        length = 1e3 if quaternion else 1.0
        columns = [points[axis][0] for axis in "xyz"]
        factors = [length * _si(points[axis][1]) for axis in "xyz"]
        if quaternion:
            columns += [self._names.index(name) for name in QUATERNION]
            factors += [1.0] * len(QUATERNION)
        else:
            columns += [turns[axis][0] for axis in "xyz"]
            factors += [_si(turns[axis][1]) for axis in "xyz"]
        return _Part(1, tuple(columns), tuple(factors), required=True)

    def _fail_header(self, what: str) -> None:
        self._source.fail(
            int(self._scan.starts[self._header]),
            what,
            rule="Columns are q1 ... qN, or x, y, z with qw, qx, qy, qz or rx, ry, rz, or both",
            way_out="docs/reference/programs.md has the units that names may carry",
        )


def _coordinate(name: str) -> str:
    """What a column says of a waypoint, its unit left out; empty for another column."""
    if joint := JOINT.fullmatch(name):
        return f"q{int(joint[1])}"
    if (point := TARGET_COLUMN.fullmatch(name)) and not point[2]:
        return str(point[1])
    if turn := ROTATION.fullmatch(name):
        return f"r{turn[1]}"
    return name if name in QUATERNION else ""


def _si(unit: str) -> float:
    return float(to_si(1.0, unit)) if unit else 1.0


def _padded(values: NDArray[Any], width: int) -> NDArray[Any]:
    """Rows of at least so many numbers."""
    short = width - values.shape[1]
    return np.ascontiguousarray(np.pad(values, ((0, 0), (0, short)))) if short else values
