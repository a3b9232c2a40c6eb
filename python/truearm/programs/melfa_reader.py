"""Reads a MELFA BASIC program: its motions, and the position and joint variables that they go to."""

import re
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import InputError
from truearm.programs.branches import Branches
from truearm.programs.environment import IDENTITY, Environment, Environments, Frame
from truearm.programs.frames import Frames, name_at_start, written_out
from truearm.programs.layouts import EulerPose
from truearm.programs.melfa_configuration import StructureFlags
from truearm.programs.melfa_text import (
    JOINTS,
    NAME,
    POSE,
    SLOTS,
    Constant,
    Statement,
    assignment,
    constant,
    statements,
)
from truearm.programs.program import Listed
from truearm.programs.source import Source
from truearm.programs.tables import ABSENT, Motion, MoveTable, TargetTable
from truearm.robot import Robot
from truearm.rotations import rigid_inverse

Transform = NDArray[np.float64]

FLAGS: Final = 2
FLAGGED: Final = EulerPose(columns=(2, 1, 0), configuration=FLAGS)
_MOTION: Final = re.compile(
    r"(?<![\w.])(Mov|Mvs|Mvc|Mvr[23]?|Mva|E?Mv[A-Za-z]+|Jrc)(?=[\s(,])", re.IGNORECASE
)
_KINDS: Final = {
    "mov": (Motion.JOINT,),
    "mvs": (Motion.LINEAR,),
    "mva": (Motion.JOINT,),
    "mvr": (Motion.LINEAR, Motion.VIA, Motion.CIRCULAR),
    "mvr2": (Motion.LINEAR, Motion.CIRCULAR, Motion.NONE),
    "mvr3": (Motion.LINEAR, Motion.CIRCULAR, Motion.NONE),
    "mvc": (Motion.LINEAR, Motion.VIA, Motion.VIA),
}
_END_OF_TARGETS: Final = re.compile(r"(?<![\w.])(Type|Wth|WthIf|Else|EndIf)\b", re.IGNORECASE)
_VARIABLE: Final = re.compile(rf"\s*\(?\s*({NAME})\s*\)?\s*\Z")
_COMBINED: Final = re.compile(rf"\s*({NAME})\s*([*/+-])\s*({NAME})\s*\Z")
_DISTANCE: Final = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+))\s*\Z")
_SETTING: Final = re.compile(r"\s*(Tool|Base|Cnt)\b\s*(.*?)\s*\Z|\s*M_Tool\s*=\s*(.*?)\s*\Z", re.IGNORECASE)
_SET_WITHIN: Final = re.compile(r"\b(Then|Else)\s+(Tool|Base)\b|\bM_Tool\s*=(?!=)", re.IGNORECASE)
"""A setting in one branch of a line."""
_LABEL: Final = re.compile(r"\s*\*")
_BRANCHING: Final = re.compile(
    r"(?<![\w.])(GoSub|GoTo|If|Then|Else|EndIf|For|Next|While|WEnd|Select|Case|Break|CallP|Return|On|"
    r"XRun|Act|Hlt)\b",
    re.IGNORECASE,
)
_DEFINED: Final = re.compile(r"\s*Def\s+(Pos|Jnt)\s+(.*)", re.IGNORECASE)
_NAMES: Final = re.compile(rf"(?<![\w.]){NAME}(\.\w+)?")
_UNKNOWN_TOOL: Final = Frame.missing("which tool is set here depends on how the program runs")
LONGEST_NAME: Final = 48
COMPUTED: Final = "its target is computed when the program runs"
NOT_CONSTANT: Final = "its target is not a constant of this file"


@dataclass
class _Variable:
    """What a program says of a variable."""

    constants: list[tuple[int, Constant]] = field(default_factory=list)
    why_not: str = ""


class Reader:
    """One program.

    Attributes:
        targets: Constants of position and joint variables.
        moves: Motions to them.
        environments: Tools, bases and offsets of the motions.
        listed: What is left as it is.
        fixed: Why variables cannot be changed whatever uses them, by target.
    """

    def __init__(self, source: Source, robot: Robot, frames: Frames) -> None:
        self.targets, self.moves = TargetTable(), MoveTable()
        self.environments = Environments()
        self.listed: list[Listed] = []
        self.fixed: dict[int, str] = {}
        self._source, self._robot, self._frames = source, robot, frames
        self._joint_names: set[str] = set()
        self._variables: dict[str, _Variable] = {}
        self._statements = list(statements(source))
        self._offsets = self._find_offsets()
        self._read_variables()
        self._targets = {name.casefold(): self._target(name, v) for name, v in self._known()}
        self._tool_names = self._written_tools()
        start = name_at_start("tool", written=bool(self._tool_names))
        self._tool, self._base, self._blended = frames.at_start("tool", start), IDENTITY, False
        self._follows = False
        self._several = self._count_settings() > 1
        for statement in self._statements:
            self._statement(statement)

    def configuration(self) -> StructureFlags | None:
        """How flags are meant; None for an arm whose flags we cannot compute."""
        try:
            return StructureFlags(Branches.of(self._robot))
        except InputError as unsuited:
            for name, variable in self._known():
                if variable.constants[0][1].layout == POSE:
                    self.fixed.setdefault(self._targets[name.casefold()], unsuited.what)
            return None

    def _known(self) -> list[tuple[str, _Variable]]:
        """Variables that are assigned a constant somewhere, and are no tools, bases or offsets."""
        return [(n, v) for n, v in self._variables.items() if v.constants and n not in self._offsets]

    def _find_offsets(self) -> set[str]:
        """Variables that are tools, bases, or offsets of targets."""
        found = [m.group(2) or "" for s in self._statements if (m := _SETTING.match(s.text)) is not None]
        for statement in self._statements:
            motion = _MOTION.search(statement.text)
            pieces = _split(statement.text[motion.end() :]) if motion is not None else []
            found += [m.group(3) for piece in pieces if (m := _COMBINED.match(piece)) is not None]
        return {_name(text) for text in found}

    def _is_joints(self, name: str) -> bool:
        plain = name.partition("(")[0].casefold()
        return plain in self._joint_names or (plain.startswith("j") and plain not in self._positions)

    def _is_position(self, name: str) -> bool:
        return name.casefold() in self._positions or name.casefold().startswith("p")

    def _read_variables(self) -> None:
        self._positions: set[str] = set()
        for statement in self._statements:
            defined = _DEFINED.match(statement.text)
            if defined is not None:
                chosen = self._joint_names if defined.group(1).casefold() == "jnt" else self._positions
                chosen |= {name.strip().partition("(")[0].casefold() for name in defined.group(2).split(",")}
        for statement in self._statements:
            found = assignment(statement)
            if found is not None:
                self._assign(statement, *found)
            elif _MOTION.search(statement.text) is None and _DEFINED.match(statement.text) is None:
                self._used(statement, statement.text)

    def _assign(self, statement: Statement, name: str, at: int, text: str) -> None:
        plain = name.partition("(")[0]
        if not (self._is_joints(plain) or self._is_position(plain)):
            self._used(statement, text)
            return
        variable = self._variables.setdefault(name.casefold(), _Variable())
        count = self._robot.joint_count
        held = constant(text, at, joints=self._is_joints(plain), joint_count=count)
        if held is None:
            line = self._source.place(statement.at)[0]
            variable.why_not = variable.why_not or f"it is computed in line {line} when the program runs"
            self._used(statement, text)
        elif variable.constants:
            variable.why_not = variable.why_not or "it is assigned more than once"
            variable.constants.append((statement.at, held))
        else:
            variable.constants.append((statement.at, held))

    def _used(self, statement: Statement, text: str) -> None:
        """Variables in `text` are used for something else than a motion."""
        for found in _NAMES.finditer(text):
            name = _name(found.group()).partition(".")[0]
            if name[0] in "pj" or name in self._variables:
                variable = self._variables.setdefault(name, _Variable())
                line = self._source.place(statement.at)[0]
                reason = f"it is also used in line {line} for something else than a motion"
                variable.why_not = variable.why_not or reason

    def _target(self, name: str, variable: _Variable) -> int:
        """The number of the last target added: one for each constant of the variable."""
        number = -1
        for at, held in variable.constants:
            layout = held.layout
            width = self._robot.joint_count if layout == JOINTS else SLOTS + FLAGS
            numbers = held.numbers if not held.problem else (ABSENT,) * width
            shown = self._source.text[at : at + len(name)].strip() or name
            number = self.targets.add(0, at, layout, numbers, shown)
            if held.problem or variable.why_not:
                self.fixed[number] = held.problem or variable.why_not
        return number

    def _count_settings(self) -> int:
        """How many different tools and bases are set."""
        found = {m.group().casefold() for s in self._statements if (m := _SETTING.match(s.text)) is not None}
        return len([text for text in found if "cnt" not in text])

    def _statement(self, statement: Statement) -> None:
        motion = _MOTION.search(statement.text)
        setting = _SETTING.match(statement.text)
        branching = _LABEL.match(statement.text) or _BRANCHING.search(statement.text)
        if branching is not None:
            self._follows, self._blended = False, True
            if self._several or _SET_WITHIN.search(statement.text) is not None:
                self._tool = self._base = _UNKNOWN_TOOL
        if motion is not None:
            self._motion(statement, motion)
        elif setting is not None:
            self._set(setting)
        if branching is not None:
            self._follows = False

    def _set(self, setting: re.Match[str]) -> None:
        word, given, number = (setting.group(1) or "m_tool").casefold(), setting.group(2), setting.group(3)
        if word == "cnt":
            self._blended = not given.startswith("0")
        elif word == "m_tool":
            self._tool = self._frames.tool(number) if number.isdigit() else _UNKNOWN_TOOL
        elif word == "tool":
            self._tool = self._stated_tool(given)
        else:
            self._base = self._stated_base(given)

    def _stated_tool(self, given: str) -> Frame:
        """Tool (x, y, z, a, b, c), of a variable, or of the arm itself."""
        if given.casefold() == "p_ntool":
            return Frame.of(np.eye(4), given)
        stated = self._transform(given)
        name = self._tool_names.get(given, given)
        if stated is None:
            return Frame.missing("the tool is computed when the program runs", name)
        return self._frames.tool(name, stated)

    def _written_tools(self) -> dict[str, str]:
        """Names of tools that are written out in numbers, by their text."""
        settings = (_SETTING.match(statement.text) for statement in self._statements)
        texts = [m.group(2) for m in settings if m is not None and (m.group(1) or "").casefold() == "tool"]
        return written_out("tool", (text for text in texts if _VARIABLE.match(text) is None))

    def _stated_base(self, given: str) -> Frame:
        """Base: only where it stands in the frames file, unless it is the robot's own.

        Which of the two frames a base conversion gives in the other is not said here: the file says it.
        """
        stated = self._transform(given)
        own = given.casefold() in ("0", "p_nbase") or (stated is not None and np.allclose(stated, np.eye(4)))
        if own:
            return IDENTITY
        return self._frames.work_object(f"base {given}" if given.isdigit() else "base")

    def _transform(self, given: str) -> Transform | None:
        """The transform of a constant or of a variable that is one; None if it is not constant."""
        held = constant(given, 0, joints=False, joint_count=SLOTS)
        if held is None and (variable := self._variables.get(_name(given))) is not None:
            single = len(variable.constants) == 1 and not variable.why_not.startswith("it is computed")
            held = variable.constants[0][1] if single else None
        values = held.numbers[:SLOTS] if held is not None and held.layout == POSE else ()
        if len(values) < SLOTS:
            return None
        return np.asarray(FLAGGED.to_poses(np.array([[number.value for number in values]]))[0])

    def _motion(self, statement: Statement, motion: re.Match[str]) -> None:
        word = motion.group(1).casefold()
        at = statement.at + motion.start()
        if word not in _KINDS:
            self._list(
                at, f"{motion.group(1)} is not followed: the tool stands still, or it is a relative move"
            )
            return
        end = _END_OF_TARGETS.search(statement.text, motion.end())
        text = statement.text[motion.end() : None if end is None else end.start()]
        pieces = _split(text)
        if word in ("mov", "mvs", "mva"):
            behind, pieces = pieces[1:], pieces[:1]
            offset, problem = _close_distance(behind) if word != "mva" else (np.eye(4), "")
        else:
            offset, problem = np.eye(4), ""
        for piece, kind in zip(pieces, _KINDS[word], strict=False):
            self._one(at, piece, kind, offset, problem)

    def _one(self, at: int, piece: str, kind: Motion, offset: Transform, problem: str) -> None:
        """One target of a motion."""
        found = self._place(piece)
        if isinstance(found, str):
            self._list(at, found)
            return
        target, before, after = found
        environment = Environment(
            tool=self._tool,
            work_object=self._base,
            before=before,
            after=after @ offset,
            problem=problem,
            payload_kg=self._frames.payloads_kg.get(self._tool.name.casefold()),
        )
        self.moves.add(
            target,
            (0, at),
            kind,
            environment=self.environments.number(environment),
            blended=self._blended or kind == Motion.VIA,
            follows=self._follows,
        )
        self._follows = not problem

    def _place(self, piece: str) -> tuple[int, Transform, Transform] | str:
        """Target and what is before and after it; or why it is not known."""
        if not piece.strip():
            return "it is a relative move"
        plain, combined = _VARIABLE.match(piece), _COMBINED.match(piece)
        if plain is not None and _name(plain.group(1)) in self._offsets:
            return "its target is also a tool, a base or an offset"
        if plain is not None:
            target = self._targets.get(_name(plain.group(1)))
            return NOT_CONSTANT if target is None else (target, np.eye(4), np.eye(4))
        return COMPUTED if combined is None else self._combined(*combined.groups())

    def _combined(self, first: str, operator: str, second: str) -> tuple[int, Transform, Transform] | str:
        """P1*P2, P1/P2, P1+P2 and P1-P2, where the second is constant."""
        target, other = self._targets.get(_name(first)), self._transform(second)
        if target is None or other is None:
            return COMPUTED
        if operator in "*/":
            return target, np.eye(4), other if operator == "*" else rigid_inverse(other)
        if not np.allclose(other[:3, :3], np.eye(3)):
            return "angles are added to its target"
        before = np.eye(4)
        before[:3, 3] = other[:3, 3] if operator == "+" else -other[:3, 3]
        return target, before, np.eye(4)

    def _list(self, at: int, reason: str) -> None:
        line, column = self._source.place(at)
        shown = " ".join(self._source.line_text(line).split())[:LONGEST_NAME]
        self.listed.append(Listed(0, line, column, shown, reason))
        self._follows = False


def _name(text: str) -> str:
    """A variable's name as it is compared: case and blanks do not matter."""
    return re.sub(r"\s", "", text).casefold()


def _split(text: str) -> list[str]:
    """The pieces between commas that are in no brackets."""
    pieces, depth, start = [], 0, 0
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth == 0:
            pieces.append(text[start:place])
            start = place + 1
    return [*pieces, text[start:]]


def _close_distance(pieces: list[str]) -> tuple[Transform, str]:
    """The offset along the tool's z axis that Mov P1, -50 states, mm; and why it is not known."""
    offset = np.eye(4)
    if not pieces or not pieces[0].strip():
        return offset, ""
    found = _DISTANCE.match(pieces[0])
    if found is None:
        return offset, "its distance from the target is computed when the program runs"
    offset[2, 3] = 1e-3 * float(found.group(1))
    return offset, ""
