"""Reads a MELFA BASIC program: its motions, and the position and joint variables that they go to."""

import re
from collections.abc import Mapping, Sequence
from typing import Final, Literal

import numpy as np

from truearm.programs.environment import IDENTITY, Environment, Frame
from truearm.programs.frames import Frames, name_at_start, written_out
from truearm.programs.gathered import Gathered
from truearm.programs.melfa_flow import Ways, functions
from truearm.programs.melfa_text import (
    JOINTS,
    NAME,
    SLOTS,
    Move,
    array_of,
    moves,
    name_of,
    statements,
)
from truearm.programs.melfa_variables import COMBINED, FLAGS, SETTING, Variable, Variables
from truearm.programs.source import Source
from truearm.programs.tables import ABSENT, Motion, Via
from truearm.robot import Robot
from truearm.rotations import rigid_inverse
from truearm.types import Transform

Kind = Literal["tool", "base"]

_KINDS: Final = {
    "mov": ((0, Motion.JOINT),),
    "mvs": ((0, Motion.LINEAR),),
    "mva": ((0, Motion.JOINT),),
    "mvr": ((0, Motion.LINEAR), (1, Motion.VIA), (2, Motion.CIRCULAR)),
    "mvr2": ((0, Motion.LINEAR), (2, Motion.BESIDE), (1, Motion.CIRCULAR)),
    "mvr3": ((0, Motion.LINEAR), (2, Motion.BESIDE), (1, Motion.CIRCULAR)),
    "mvc": ((0, Motion.LINEAR), (1, Motion.VIA), (2, Motion.VIA), (0, Motion.CIRCULAR)),
}
"""What a motion does with its arguments, by their place, in the order in which the arm passes them. The third
one of Mvr2 is a point of the rest of the circle, that of Mvr3 its centre; Mvc ends where it begins.
"""
_VARIABLE: Final = re.compile(rf"\s*\(?\s*({NAME})\s*\)?\s*\Z")
_DISTANCE: Final = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+))\s*\Z")
_TOOL_SET: Final = re.compile(r"\bM_Tool\b[^=]*=", re.IGNORECASE)
"""A tool that is set while a motion goes on (Wth)."""
_TRACKED: Final = re.compile(r"\s*Trk\s+On\b", re.IGNORECASE)
_LET_GO: Final = re.compile(r"\s*Trk\s+Off\b", re.IGNORECASE)
_BRANCHING: Final = (
    "GoSub|GoTo|If|For|Next|While|WEnd|Select|Case|Break|CallP|Return|On|XRun|Act|Hlt|Function|FEnd|End"
)
_CALLING: Final = re.compile(r"\s*(CallP|RelM)\b", re.IGNORECASE)
"""What lets another program set tool and base."""
_GETTING: Final = re.compile(r"\s*GetM\b\s*(.*?)\s*\Z", re.IGNORECASE)
_LOSING: Final = {
    "callp": "the program called in line {line} may have set another {kind}",
    "relm": "RelM in line {line} lets another program have the arm, which may set another {kind}",
    "getm": "GetM in line {line} changes the mechanism, and its {kind} is not known until it is set again",
}
"""Why tool or base are not known behind a statement."""
_CORRECTED: Final = "1"
"""Number of the mechanism that is corrected: the arm itself, which a program has from the start."""
_SET_BY: Final[Mapping[Kind, tuple[str, ...]]] = {"tool": ("tool", "m_tool"), "base": ("base",)}
_NUMBERED: Final = "M_Tool="
_TYPE: Final = re.compile(r"Type\b\s*(.*?)\s*(?:Wth(?:If)?\b|\Z)", re.IGNORECASE | re.DOTALL)
_EVENLY: Final = re.compile(r"0?(?:\s*,\s*0?)?")
"""Constants of Type with which the tool turns evenly about one axis, the short way; so it does without."""
_SKIPPED: Final = re.compile(r"(?<![\w.])Skip\b", re.IGNORECASE)
COMPUTED: Final = "its target is computed when the program runs"
RELATIVE: Final = "it is a relative move"
OF_ANOTHER: Final = (
    "in line {line} it is a place of the mechanism that GetM gets in line {getting}, and mechanism 1 is "
    "corrected"
)
ABOUT_CENTRE: Final = (
    "it is used in line {line} by Mvr3, whose start and end have to be equally far from its centre, within "
    "0.01 mm: to have it corrected, use Mvr with a point of the arc"
)
TURNED_OTHERWISE: Final = (
    "it is a via point in line {line} with Type {given}, where the tool turns the long way round or as axes "
    "4 to 6 take it, which is not followed: to have it corrected, use Type 0,0"
)
NOT_CONSTANT: Final = "its target is not a constant of this file"


class Reader:
    """One program.

    Attributes:
        found: Constants of position and joint variables, and their uses.
    """

    def __init__(self, source: Source, robot: Robot, frames: Frames) -> None:
        self.found = Gathered((source,))
        self._source, self._robot, self._frames = source, robot, frames
        self._statements = list(statements(source))
        self._moves = {place: found for place, one in enumerate(self._statements) if (found := moves(one))}
        self._variables = Variables(source, self._statements, self._moves, robot.joint_count)
        self._targets = {name: self._target(name, one) for name, one in self._variables.targets()}
        self._elements: dict[str, list[int]] = {}
        for name, target in self._targets.items():
            self._elements.setdefault(array_of(name), []).append(target)
        words = "|".join([_BRANCHING, *functions(self._statements)])
        self._branching = re.compile(rf"(?<![\w.])({words})\b", re.IGNORECASE)
        ways = Ways(self._statements)
        self._jumped_to = ways.jumped_to()
        self._getting = {
            place: getting.group(1)
            for place, one in enumerate(self._statements)
            if (getting := _GETTING.match(one.text)) is not None
        }
        self._of_others = self._find_others(ways)
        self._losing = self._find_losing()
        self._settings = {kind: self._find_settings(kind) for kind in _SET_BY}
        texts = (name_of(text) for text in self._settings["tool"].values())
        self._written = written_out("tool", (text for text in texts if text.startswith("(")))
        start = name_at_start("tool", written=bool(self._written))
        self._tools = self._set_at("tool", frames.at_start("tool", start), ways)
        self._bases = self._set_at("base", IDENTITY, ways)
        self._blended, self._follows, self._in_branch = False, False, False
        self._gone_to, self._centres = set[int](), list[tuple[str, str]]()
        for place in range(len(self._statements)):
            self._statement(place)
        for centre, reason in self._centres:
            self.found.keep(self._gone_to.intersection(self._targets_in(centre)), reason)

    def _target(self, name: str, variable: Variable) -> int:
        """The number of the last target added: one for each constant of the variable."""
        number, why_not = -1, self._variables.why_not(name)
        holds = self._variables.holds_its_constant(name)
        for at, held in variable.constants:
            layout = held.layout
            width = self._robot.joint_count if layout == JOINTS else SLOTS + FLAGS
            numbers = held.numbers if not held.problem else (ABSENT,) * width
            text = self._source.text
            shown = text[at : text.index("=", at)].strip()
            number = self.found.targets.add(0, at, layout, numbers, shown)
            if held.problem or why_not:
                self.found.fixed[number] = held.problem or why_not
            if not holds:
                self.found.unsure.add(number)
        return number

    def _find_settings(self, kind: Kind) -> dict[int, str]:
        """Statements that set a tool or base, and what they say of it; M_Tool with its name before it."""
        found = {}
        for place, statement in enumerate(self._statements):
            setting = SETTING.match(statement.text)
            if setting is not None and (setting.group(1) or "m_tool").casefold() in _SET_BY[kind]:
                found[place] = setting.group(2) if setting.group(1) else f"{_NUMBERED}{setting.group(3)}"
        if kind == "tool":
            for place, motions in self._moves.items():
                if any(_TOOL_SET.search(motion.added) for motion in motions):
                    found[place] = f"{_NUMBERED}?"
        return found

    def _set_at(self, kind: Kind, start: Frame, ways: Ways) -> dict[int, Frame]:
        """The tool or base of each statement that moves."""
        settings: dict[str, list[int]] = {}
        for place, text in self._settings[kind].items():
            settings.setdefault(name_of(text), []).append(place)
        ends = {*self._settings[kind], *self._losing}
        unsure = Frame.missing(f"which {kind} is set here depends on how the program runs")
        found: dict[int, Frame] = dict.fromkeys(self._moves.keys() & ways.from_start(ends), start)
        for places in settings.values():
            given = self._settings[kind][places[0]]
            frame = self._stated_tool(given) if kind == "tool" else self._stated_base(given)
            for place in self._moves.keys() & ways.behind(places, ends):
                found[place] = unsure if place in found else frame
        for place, why in self._losing.items():
            lost = Frame.missing(why.format(line=self._line_of(place), kind=kind))
            found |= dict.fromkeys(self._moves.keys() & ways.behind([place], ends), lost)
        if kind == "base":
            found |= dict.fromkeys(self._tracked(ways), Frame.missing("a conveyor is tracked there (Trk On)"))
        elsewhere = list({id(frame): frame for frame in found.values()}.values())
        only = elsewhere[0] if len(elsewhere) == 1 else unsure
        return dict.fromkeys(self._moves, only) | found

    def _find_others(self, ways: Ways) -> dict[int, int]:
        """Statements that may be executed while the program has another mechanism, with the GetM of it."""
        return {
            place: getting
            for getting, number in self._getting.items()
            if number != _CORRECTED
            for place in ways.behind([getting], self._getting)
        }

    def _find_losing(self) -> dict[int, str]:
        """Statements behind which tool and base are not known, and why."""
        called = {
            place: _LOSING[calling.group(1).casefold()]
            for place, one in enumerate(self._statements)
            if (calling := _CALLING.match(one.text)) is not None
        }
        changing = (
            place
            for place, number in self._getting.items()
            if number != _CORRECTED or place in self._of_others
        )
        return called | dict.fromkeys(changing, _LOSING["getm"])

    def _line_of(self, place: int) -> int:
        return self._source.place(self._statements[place].at)[0]

    def _tracked(self, ways: Ways) -> set[int]:
        """Motions while a conveyor may be tracked."""
        on, off = (
            [place for place, one in enumerate(self._statements) if pattern.match(one.text)]
            for pattern in (_TRACKED, _LET_GO)
        )
        return self._moves.keys() & ways.behind(on, off)

    def _stated_tool(self, given: str) -> Frame:
        """Tool (x, y, z, a, b, c), of a variable, of a number, or of the arm itself."""
        if given.casefold() == "p_ntool":
            return Frame.of(np.eye(4), given)
        number = given.removeprefix(_NUMBERED)
        if number != given:
            found = self._frames.tool(number) if number.isdigit() else None
            return found or Frame.missing("the tool's number is computed when the program runs")
        stated = self._variables.transform(given)
        name = self._written.get(name_of(given), given)
        if stated is None:
            return Frame.missing("the tool is computed when the program runs", name)
        return self._frames.tool(name, stated)

    def _stated_base(self, given: str) -> Frame:
        """Base: only where it stands in the frames file, unless it is the robot's own.

        Which of the two frames a base conversion gives in the other is not said here: the file says it.
        """
        if self._is_own_base(given):
            return IDENTITY
        if given.isdigit():
            return self._frames.work_object(f"base {given}")
        others = {name_of(text) for text in self._settings["base"].values() if not text.isdigit()}
        if len([text for text in others if not self._is_own_base(text)]) > 1:
            return Frame.missing('several bases are written out, and "base" in a frames file is one')
        return self._frames.work_object("base")

    def _is_own_base(self, given: str) -> bool:
        stated = self._variables.transform(given)
        return given.casefold() in {"0", "p_nbase"} or (stated is not None and np.allclose(stated, np.eye(4)))

    def _statement(self, place: int) -> None:
        statement = self._statements[place]
        branching = self._branching.search(statement.text) is not None
        behind_branch = statement.part == 0 and self._in_branch
        self._in_branch = bool(statement.lead) or (self._in_branch and statement.part > 0)
        if branching or behind_branch or statement.lead or place in self._jumped_to:
            self._follows, self._blended = False, True
        for move in self._moves.get(place, ()):
            self._motion(place, move)
        setting = SETTING.match(statement.text)
        if setting is not None and (setting.group(1) or "").casefold() == "cnt":
            self._blended = not setting.group(2).startswith("0")
        if branching:
            self._follows = False

    def _motion(self, place: int, move: Move) -> None:
        word = move.word.casefold()
        line = self._source.place(move.at)[0]
        self._keep_beside(place, move)
        if word not in _KINDS:
            why = f"{move.word} is not followed: the tool stands still, or it is a relative move"
            self.found.leave((0, move.at), why)
            self._keep(move.pieces, f"it is also used in line {line} by {move.word}, which is not followed")
            self._follows = False
            return
        kinds, otherwise = _KINDS[word], self._keep_vias(move)
        count = 1 + max(piece for piece, _ in kinds)
        pieces, behind = move.pieces[:count], move.pieces[count:]
        self._keep(behind, f"a distance is computed from it in line {line} when the program runs")
        offset, problem = _close_distance(behind) if word in {"mov", "mvs"} else (np.eye(4), "")
        places = [self._place(piece) for piece in pieces]
        for piece, found in zip(pieces, places, strict=True):
            if isinstance(found, str):
                self.found.leave((0, move.at), found)
                self._keep([piece], f"a target is computed from it in line {line} when the program runs")
        for number, kind in kinds:
            found = places[number] if number < len(places) else COMPUTED
            if isinstance(found, str):
                self._follows = False
                if found != RELATIVE:
                    self.found.unplace((0, move.at), kind, blended=self._blended or kind == Motion.VIA)
                continue
            target, before, after = found
            environment = self._environment(place, before, after @ offset, problem)
            if kind == Motion.VIA and otherwise:
                self.found.vias[len(self.found.moves)] = Via.OPEN
            self._go(move.at, target, kind, environment)
            self._follows = not problem and _SKIPPED.search(move.added) is None
        self._follows = self._follows and place not in self._of_others

    def _keep_beside(self, place: int, move: Move) -> None:
        """Places of another mechanism, and of arcs about a centre, which no correction may shift."""
        line = self._source.place(move.at)[0]
        if place in self._of_others:
            getting = self._line_of(self._of_others[place])
            self._keep(move.pieces, OF_ANOTHER.format(line=line, getting=getting))
        if move.word.casefold() == "mvr3":
            reason = ABOUT_CENTRE.format(line=line)
            self._keep(move.pieces[:2], reason)
            self._centres += [(centre, reason) for centre in move.pieces[2:3]]

    def _keep_vias(self, move: Move) -> bool:
        """Whether the tool turns on an arc otherwise than evenly the short way; its via points stay then."""
        stated = _TYPE.match(move.added)
        if stated is None or _EVENLY.fullmatch(stated.group(1)) is not None:
            return False
        reason = TURNED_OTHERWISE.format(line=self._source.place(move.at)[0], given=stated.group(1))
        vias = [number for number, kind in _KINDS[move.word.casefold()] if kind == Motion.VIA]
        self._keep([move.pieces[number] for number in vias if number < len(move.pieces)], reason)
        return True

    def _environment(self, place: int, before: Transform, after: Transform, problem: str) -> Environment:
        tool = self._tools[place]
        return Environment(
            tool=tool,
            work_object=self._bases[place],
            before=before,
            after=after,
            problem=problem,
            payload_kg=self._frames.payloads_kg.get(tool.name.casefold()),
        )

    def _go(self, at: int, target: int, kind: Motion, environment: Environment) -> None:
        if kind != Motion.BESIDE:
            self._gone_to.add(target)
        self.found.moves.add(
            target,
            (0, at),
            kind,
            environment=self.found.environments.number(environment),
            blended=self._blended or kind == Motion.VIA,
            follows=self._follows,
        )

    def _keep(self, pieces: Sequence[str], reason: str) -> None:
        """Variables in pieces of a motion cannot be changed with certainty."""
        for piece in pieces:
            self.found.keep(self._targets_in(piece), reason)

    def _targets_in(self, piece: str) -> list[int]:
        """The targets of variables in a piece of a motion; those of an array where an index is computed."""
        found = (
            [self._targets[name]] if name in self._targets else self._elements.get(name, [])
            for name in self._variables.named(piece)
        )
        return [target for targets in found for target in targets]

    def _place(self, piece: str) -> tuple[int, Transform, Transform] | str:
        """Target and what is before and after it; or why it is not known."""
        if not piece.strip():
            return RELATIVE
        plain, combined = _VARIABLE.match(piece), COMBINED.match(piece)
        if plain is not None and name_of(plain.group(1)) in self._variables.offsets:
            return "its target is also a tool, a base or an offset"
        if plain is not None:
            target = self._targets.get(name_of(plain.group(1)))
            return NOT_CONSTANT if target is None else (target, np.eye(4), np.eye(4))
        return COMPUTED if combined is None else self._combined(*combined.groups())

    def _combined(self, first: str, operator: str, second: str) -> tuple[int, Transform, Transform] | str:
        """P1*P2, P1/P2, P1+P2 and P1-P2, where the second is constant."""
        target, other = self._targets.get(name_of(first)), self._variables.transform(second)
        if target is None or other is None:
            return COMPUTED
        if operator in "*/":
            return target, np.eye(4), other if operator == "*" else rigid_inverse(other)
        if not np.allclose(other[:3, :3], np.eye(3)):
            return "angles are added to its target"
        before = np.eye(4)
        before[:3, 3] = other[:3, 3] if operator == "+" else -other[:3, 3]
        return target, before, np.eye(4)


def _close_distance(pieces: Sequence[str]) -> tuple[Transform, str]:
    """The offset along the tool's z axis that Mov P1, -50 states, mm; and why it is not known."""
    offset = np.eye(4)
    if not pieces or not pieces[0].strip():
        return offset, ""
    found = _DISTANCE.match(pieces[0])
    if found is None:
        return offset, "its distance from the target is computed when the program runs"
    offset[2, 3] = 1e-3 * float(found.group(1))
    return offset, ""
