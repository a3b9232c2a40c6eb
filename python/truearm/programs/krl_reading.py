"""Reading KRL: first what is stored under which name, then the motions in their order."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from truearm.errors import InputError
from truearm.programs.branches import Branches
from truearm.programs.environment import Environment, Environments, Frame
from truearm.programs.flow import Flow
from truearm.programs.frames import Frames
from truearm.programs.krl_status import ACCURATE, StatusAndTurn
from truearm.programs.krl_values import (
    Named,
    Operands,
    Structure,
    line_reader,
    named,
    names_in,
    operands,
    structure,
)
from truearm.programs.layouts import EulerPose, Joints
from truearm.programs.lexing import Reader
from truearm.programs.program import Listed, Program
from truearm.programs.source import Source
from truearm.programs.tables import Motion, MoveTable, TargetTable
from truearm.robot import Robot

if TYPE_CHECKING:
    from truearm.programs.krl import KRL

OF_AXES, OF_POSES = 0, 1
MOTIONS: Final[Mapping[str, Motion]] = {
    "ptp": Motion.JOINT,
    "sptp": Motion.JOINT,
    "lin": Motion.LINEAR,
    "slin": Motion.LINEAR,
    "spl": Motion.LINEAR,
    "circ": Motion.CIRCULAR,
    "scirc": Motion.CIRCULAR,
}
RELATIVE: Final = frozenset(f"{word}_rel" for word in MOTIONS)
BLENDING: Final = frozenset({"c_dis", "c_ptp", "c_ori", "c_vel", "c_spl"})
OPENING: Final = {"if": False, "switch": False, "for": True, "while": True, "loop": True, "repeat": True}
CLOSING: Final = frozenset({"endif", "endswitch", "endfor", "endwhile", "endloop", "until"})
OTHERWISE: Final = frozenset({"else", "case", "default"})
JUMPS: Final = frozenset({"goto", "return", "exit"})
DECLARED: Final = re.compile(
    r"[ \t]*(?:(?:decl|global|const)[ \t]+)*(pos|e6pos|axis|e6axis|frame|fdat|struc|int|real|bool|char)"
    r"[ \t]+(?=[A-Za-z_$])",
    re.IGNORECASE,
)
DECLARING: Final = re.compile(r"[ \t]*(?:(?:decl|global|const)[ \t]+)+(\w+[ \t]+)?", re.IGNORECASE)
ASSIGNING: Final = re.compile(r"[ \t]*[A-Za-z_$][\w$]*(?:[ \t]*\[[^\]\r\n]*\])?(?:\.\w+)*[ \t]*=(?!=)")
TARGET_KINDS: Final = frozenset({"pos", "e6pos", "axis", "e6axis"})
COMPUTED: Final = "it is assigned at run time"
TWICE: Final = "it is assigned more than once"
READ: Final = "the program computes with it"
NOT_HERE: Final = "it is not stored in this program"
ROUND_AGAIN: Final = "a loop comes round to it with another tool or base"
CALLED: Final = "a subroutine was called since it was set, and may have set another"


@dataclass(frozen=True, eq=False)
class _Modal:
    """Tool and base that are active."""

    tool: Frame
    base: Frame
    remote: str = ""
    load_kg: float | None = None


class KrlReading:
    """One reading of a .src with its .dat."""

    def __init__(self, language: "KRL", sources: tuple[Source, ...], robot: Robot, frames: Frames) -> None:
        self._language, self._sources, self._robot, self._frames = language, sources, robot, frames
        self._targets, self._moves, self._environments = TargetTable(), MoveTable(), Environments()
        self._listed: list[Listed] = []
        self._fixed: dict[int, str] = {}
        self._stored: dict[str, list[tuple[int, Structure | None]]] = {}
        self._kinds: dict[str, str] = {}
        self._read: set[str] = set()
        self._numbers: dict[str, int] = {}
        self._routines: set[str] = set()
        self._accurate = False
        self._in_spline = False
        self._fdat = ""
        self._used: list[int] = []
        world = frames.objects.get("$world")
        self._world = world if world is not None else Frame.of(np.eye(4), "$WORLD")
        start = _Modal(self._frame("tool", "$TOOL"), self._frame("object", "$BASE"))
        self._flow = Flow(start, _joined, _same)

    def program(self) -> Program:
        """The program."""
        for number in self._from_data_to_code():
            self._each_line(number, self._store)
        for number in self._from_data_to_code():
            if self._sources[number].path.suffix.lower() != ".dat":
                self._each_line(number, self._move)
        self._settle()
        return Program(
            self._language,
            self._sources,
            (
                Joints.of(self._robot.joints),
                EulerPose(configuration=2),
            ),
            self._targets.freeze(),
            self._moves.freeze(),
            tuple(self._environments.all),
            tuple(sorted(self._listed)),
            self._configuration(),
            "bit 3 of S says that points were taught with an absolutely accurate robot"
            if self._accurate
            else "",
            self._fixed,
        )

    def _configuration(self) -> StatusAndTurn | None:
        try:
            return StatusAndTurn(Branches.of(self._robot))
        except InputError:
            return None

    def _from_data_to_code(self) -> list[int]:
        order = range(len(self._sources))
        return sorted(order, key=lambda number: self._sources[number].path.suffix.lower() != ".dat")

    def _each_line(self, number: int, take: Callable[[int, int, int], None]) -> None:
        source = self._sources[number]
        starts = [*source.line_starts, len(source.text)]
        for start, end in zip(starts, starts[1:], strict=False):
            take(number, start, end)

    # First pass: what is stored.

    def _store(self, file: int, start: int, end: int) -> None:
        source = self._sources[file]
        begins = DECLARED.match(source.text, start, end)
        if begins is not None:
            self._store_declared(file, begins.group(1).lower(), begins.end(), end)
            return
        declaring = DECLARING.match(source.text, start, end)
        if declaring is not None:
            start = declaring.end()
        if ASSIGNING.match(source.text, start, end):
            self._store_assigned(file, start, end)
            return
        words = source.text[start:end].split(maxsplit=3)[:3]
        if words and words[0].lower() in {"def", "deffct", "global"}:
            self._routines.add(re.split(r"[ (]", words[-1].lower())[0])

    def _store_declared(self, file: int, kind: str, start: int, end: int) -> None:
        reader = line_reader(self._sources[file], start, end)
        while not reader.done:
            variable = named(reader)
            if variable is None:
                return
            self._kinds.setdefault(variable.name, kind)
            if reader.accept("="):
                self._keep(file, variable, reader)
            if not reader.accept(","):
                return

    def _store_assigned(self, file: int, start: int, end: int) -> None:
        reader = line_reader(self._sources[file], start, end)
        variable = named(reader)
        if variable is None:
            return
        if reader.accept("="):
            self._keep(file, variable, reader)
            return
        self._stored.setdefault(variable.key, []).append((file, None))
        self._read |= names_in(reader.rest())

    def _keep(self, file: int, variable: Named, reader: Reader) -> None:
        value = structure(reader) if reader.peek() == "{" else None
        if value is None or (not reader.done and reader.peek() == ":"):
            if variable.name not in {"fdat_act", "pdat_act", "ldat_act"} and not variable.name.startswith(
                "$"
            ):
                self._read |= names_in(reader.rest())
            value = None
        key = variable.key
        if variable.index == "?":
            self._stored.setdefault(f"{variable.name}[?]", []).append((file, None))
        self._stored.setdefault(key, []).append((file, value))

    # Second pass: motions.

    def _move(self, file: int, start: int, end: int) -> None:
        source = self._sources[file]
        head = source.text[start:end].lstrip()
        if not head or head[0] in ";&":
            return
        reader = line_reader(source, start, end)
        if reader.done:
            return
        word = reader.peek()
        if word in MOTIONS and reader.peek(1) not in {"=", "(", "[", "."}:
            reader.take()
            self._motion(file, start, MOTIONS[word], reader, passing=word == "spl")
        elif word in RELATIVE:
            self._list(file, reader.offset, "a relative move")
            self._flow.jump()
        else:
            self._statement(file, start, end, word, reader)

    def _statement(self, file: int, start: int, end: int, word: str, reader: Reader) -> None:
        flow = self._flow
        if word in {"def", "deffct", "global"}:
            flow.restart()
        elif word in OPENING:
            flow.open(loop=OPENING[word])
        elif word in CLOSING:
            flow.close()
        elif word in OTHERWISE:
            flow.otherwise(last=word != "case")
        elif word in JUMPS or reader.peek(1) == ":":
            flow.jump()
        elif word in {"spline", "endspline"}:
            self._in_spline = word == "spline"
        elif ASSIGNING.match(self._sources[file].text, start, end):
            self._assignment(reader)
            return
        elif word == "bas":
            self._bas(reader)
            return
        elif reader.kind() == "name" and reader.peek(1) == "(":
            self._called()
        if word not in {"def", "deffct", "global", "decl"}:
            self._read |= names_in(reader.rest())

    def _called(self) -> None:
        state = self._flow.state
        self._flow.state = replace(
            state, tool=Frame.missing(f"tool: {CALLED}"), base=Frame.missing(f"base: {CALLED}")
        )
        self._flow.jump()

    def _bas(self, reader: Reader) -> None:
        """BAS sets what the inline forms prepared."""
        words = [token.text.lower() for token in reader.rest()]
        command = words[3] if len(words) > 3 and words[1:3] == ["(", "#"] else ""
        number = words[5] if len(words) > 5 and words[4] == "," and words[5].isdigit() else "?"
        if command in {"ptp_params", "cp_params", "frames"}:
            self._flow.state = self._with_fdat(self._fdat)
        elif command == "tool":
            self._set(tool=self._numbered("tool", number))
        elif command == "base":
            self._set(base=self._numbered("object", number))
        elif command == "initmov":
            self._called()

    def _assignment(self, reader: Reader) -> None:
        variable = named(reader)
        if variable is None:
            return
        if not reader.accept("="):
            changed = Frame.missing("one of its components is changed at run time")
            if variable.name in {"$tool", "$base"}:
                self._set(**{variable.name[1:]: changed})
            return
        if variable.name == "fdat_act":
            self._fdat = reader.peek()
        elif variable.name in {"$tool", "$base"}:
            kind = "tool" if variable.name == "$tool" else "object"
            self._set(**{variable.name[1:]: self._evaluated(kind, operands(reader))})
        elif variable.name == "$ipo_mode":
            remote = _remote(reader.rest()[-1].text if reader.rest() else "")
            self._flow.state = replace(self._flow.state, remote=remote)
        elif variable.name == "$load" and reader.peek() == "{":
            mass = structure(reader).numbers.get("m")
            self._flow.state = replace(self._flow.state, load_kg=None if mass is None else mass.value)

    def _set(self, **frames: Frame) -> None:
        self._flow.state = replace(self._flow.state, **frames)

    def _with_fdat(self, name: str) -> _Modal:
        """The state with tool, base and interpolation mode of an inline form's frame data."""
        state = self._flow.state
        stored = self._stored.get(name, [])
        values = stored[0][1] if len(stored) == 1 else None
        if values is None:
            reason = f"{name.upper() or 'FDAT_ACT'} does not tell it in this program"
            tool, base = Frame.missing(f"tool: {reason}"), Frame.missing(f"base: {reason}")
            return replace(state, tool=tool, base=base)
        numbers = [values.numbers.get(part) for part in ("tool_no", "base_no")]
        tool_number, base_number = ("?" if one is None else f"{one.value:.0f}" for one in numbers)
        return replace(
            state,
            tool=self._numbered("tool", tool_number),
            base=self._numbered("object", base_number),
            remote=_remote(self._mode_of(stored[0][0], values)),
        )

    def _mode_of(self, file: int, values: Structure) -> str:
        text = self._sources[file].text[values.at : values.end].lower()
        return "#tcp" if re.search(r"ipo_frame\s*#tcp", text) else "#base"

    def _numbered(self, kind: str, number: str) -> Frame:
        if number == "0":
            return self._in_world(Frame.of(np.eye(4))) if kind == "object" else Frame.of(np.eye(4))
        return self._frame(kind, f"{'TOOL' if kind == 'tool' else 'BASE'}_DATA[{number}]")

    def _frame(self, kind: str, name: str) -> Frame:
        """A tool or base by the name that the controller knows it by."""
        stored = self._stored.get(name.lower(), [])
        value = stored[0][1] if len(stored) == 1 else None
        stated = None if value is None else value.transform()
        number = re.search(r"\[(\d+)\]", name)
        known = self._frames.tools if kind == "tool" else self._frames.objects
        if number is not None and name.lower() not in known and number.group(1) in known:
            name = number.group(1)
        if len(stored) > 1 and name.lower() not in known:
            return Frame.missing(f"{name} is assigned more than once", name)
        if kind == "tool":
            return self._frames.tool(name, stated)
        return self._in_world(self._frames.work_object(name, stated))

    def _in_world(self, base: Frame) -> Frame:
        if base.unknown:
            return base
        return Frame(self._world.true @ base.true, self._world.controller @ base.controller, base.name)

    def _evaluated(self, kind: str, found: Operands | None) -> Frame:
        """A tool or base from operands joined by the geometric operator."""
        if found is None:
            return Frame.missing("it is computed at run time")
        result: Frame | None = None
        for operand in found:
            frame = self._constant(kind if result is None else "tool", operand)
            if frame.unknown or result is None:
                result = frame
            elif not result.unknown:
                result = Frame(result.true @ frame.true, result.controller @ frame.controller)
        return result if result is not None else Frame.missing("it is not said")

    def _constant(self, kind: str, operand: Structure | Named) -> Frame:
        if isinstance(operand, Structure):
            stated = operand.transform()
            if stated is None:
                return Frame.missing("not all of its components are numbers")
            return self._in_world(Frame.of(stated)) if kind == "object" else Frame.of(stated)
        if operand.name in {"$nullframe", "$world"}:
            return self._in_world(Frame.of(np.eye(4))) if kind == "object" else Frame.of(np.eye(4))
        return self._frame(kind, operand.key.upper())

    def _motion(self, file: int, start: int, motion: Motion, reader: Reader, *, passing: bool) -> None:
        at = reader.offset
        chains = [operands(reader)]
        if motion == Motion.CIRCULAR:
            chains.append(operands(reader) if reader.accept(",") else None)
        words = [token.text.lower() for token in reader.rest()]
        with_state = self._with(words)
        before = self._flow.state
        self._flow.state = with_state
        blended = passing or self._in_spline or bool(BLENDING & set(words))
        kinds = [Motion.VIA, Motion.CIRCULAR] if motion == Motion.CIRCULAR else [motion]
        for kind, chain in zip(kinds, chains, strict=True):
            self._go(file, start, at, chain, kind, blended=blended or kind == Motion.VIA)
        self._flow.state = before

    def _with(self, words: list[str]) -> _Modal:
        """The state of a motion with settings of its own: WITH $TOOL=STOOL2(FP1), $BASE=SBASE(FP1.BASE_NO)."""
        state = self._flow.state
        if "with" not in words:
            return state
        text = "".join(words[words.index("with") :])
        found = re.search(r"\$tool=stool2?\((\w+)", text)
        if found is not None:
            return self._with_fdat(found.group(1))
        problem = Frame.missing("it is set within the motion in a way that is not known")
        tool = problem if "$tool=" in text else state.tool
        base = problem if "$base=" in text else state.base
        return replace(state, tool=tool, base=base)

    def _go(
        self, file: int, start: int, at: int, chain: Operands | None, motion: Motion, *, blended: bool
    ) -> None:
        """A move to the target of a chain of operands, or a line of the listing."""
        found = None if chain is None else self._target_among(file, chain)
        if isinstance(found, str) or chain is None:
            self._list(file, at, found if isinstance(found, str) else "its target is computed at run time")
            self._flow.jump()
            return
        if found is None:
            return
        numbers, place = found
        environment = self._environments.number(self._environment(chain, place))
        for number in numbers:
            follows = self._flow.certain and len(numbers) == 1
            self._moves.add(
                number, (file, start), motion, environment=environment, blended=blended, follows=follows
            )
            self._flow.use(len(self._moves) - 1)
            self._used.append(number)
        if len(numbers) > 1:
            self._flow.jump()

    def _environment(self, chain: Operands, place: int) -> Environment:
        state = self._flow.state
        before, after, problem = np.eye(4), np.eye(4), ""
        for number, operand in enumerate(chain):
            if number == place:
                continue
            frame = self._constant("tool", operand)
            problem = problem or (f"its offset: {frame.unknown}" if frame.unknown else "")
            if number < place:
                before = before @ frame.true
            else:
                after = after @ frame.true
        return Environment(
            state.tool, state.base, before, after, state.remote, problem, payload_kg=self._payload(state)
        )

    def _payload(self, state: _Modal) -> float | None:
        if state.load_kg is not None:
            return state.load_kg
        return self._frames.payloads_kg.get(state.tool.name.casefold())

    def _target_among(self, file: int, chain: Operands) -> tuple[list[int], int] | str:
        """Numbers of the target among operands and its place, or why there is none."""
        last: str = NOT_HERE
        for place in reversed(range(len(chain))):
            operand = chain[place]
            if isinstance(operand, Structure):
                if len(chain) > 1:
                    continue
                problem = operand.problem()
                return problem if problem else ([self._add(file, operand, "")], place)
            found = self._stored_targets(operand)
            if not isinstance(found, str):
                return found, place
            last = found
        return last

    def _stored_targets(self, variable: Named) -> list[int] | str:
        if variable.index == "?":
            keys = [key for key in self._stored if key.startswith(f"{variable.name}[")]
        else:
            keys = [variable.key] if variable.key in self._stored else []
        found = [number for key in keys if (number := self._stored_target(key)) is not None]
        if found and len(found) == len(keys):
            return found
        return "; ".join(self._why_not(key) for key in keys[:1]) or NOT_HERE

    def _stored_target(self, key: str) -> int | None:
        if key in self._numbers:
            return self._numbers[key]
        (file, value), *more = self._stored[key]
        if more or value is None or value.problem():
            return None
        number = self._add(file, value, key.upper())
        self._numbers[key] = number
        return number

    def _why_not(self, key: str) -> str:
        (_, value), *more = self._stored[key]
        if more:
            return TWICE
        return COMPUTED if value is None else value.problem()

    def _add(self, file: int, value: Structure, name: str) -> int:
        layout = OF_AXES if value.is_axes else OF_POSES
        status = value.numbers.get("s")
        self._accurate |= status is not None and bool(int(status.value) & ACCURATE)
        return self._targets.add(file, value.at, layout, value.target(), name)

    def _list(self, file: int, offset: int, reason: str) -> None:
        source = self._sources[file]
        line, column = source.place(offset)
        self._listed.append(Listed(file, line, column, source.line_text(line).strip(), reason))

    # At the end.

    def _settle(self) -> None:
        """Targets that the program computes with, and those that nothing goes to."""
        for key, number in self._numbers.items():
            name = key.split("[")[0]
            if name in self._read:
                self._fixed.setdefault(number, READ)
            if f"{name}[?]" in self._stored:
                self._fixed.setdefault(number, COMPUTED)
        for move in self._flow.overruled:
            self._fixed.setdefault(self._used[move], ROUND_AGAIN)
        for key, stored in self._stored.items():
            if key in self._numbers or self._kinds.get(key.split("[")[0]) not in TARGET_KINDS:
                continue
            file, value = stored[0]
            if len(stored) == 1 and value is not None and not value.problem():
                self._numbers[key] = self._add(file, value, key.upper())
            elif value is not None:
                self._list_stored(file, value, key)

    def _list_stored(self, file: int, value: Structure, key: str) -> None:
        line, column = self._sources[file].place(value.at)
        self._listed.append(Listed(file, line, column, key.upper(), self._why_not(key)))


def _remote(mode: str) -> str:
    return (
        "the workpiece is on the arm and the tool stands still (#TCP)"
        if mode.lower() in {"#tcp", "tcp"}
        else ""
    )


def _same(one: _Modal, other: _Modal) -> bool:
    return (one.tool.key, one.base.key, one.remote, one.load_kg) == (
        other.tool.key,
        other.base.key,
        other.remote,
        other.load_kg,
    )


def _joined(one: _Modal, other: _Modal) -> _Modal:
    """What is known where two branches meet."""
    differs = "it is not the same on all ways to this motion"
    return _Modal(
        one.tool if one.tool.key == other.tool.key else Frame.missing(f"tool: {differs}"),
        one.base if one.base.key == other.base.key else Frame.missing(f"base: {differs}"),
        one.remote or other.remote,
        one.load_kg if one.load_kg == other.load_kg else None,
    )
