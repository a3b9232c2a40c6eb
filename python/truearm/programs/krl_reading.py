"""Reading KRL: first what is stored under which name, then the motions in their order."""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from truearm.errors import InputError
from truearm.programs.branches import Branches
from truearm.programs.environment import Environment, Environments, Frame
from truearm.programs.flow import Flow
from truearm.programs.frames import Frames
from truearm.programs.krl_state import CALLED, KrlFrames, Modal, remote
from truearm.programs.krl_status import ACCURATE, StatusAndTurn
from truearm.programs.krl_storage import ASSIGNING, COMPUTED, TARGET_KINDS, KrlStorage, lines
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
ROUTINES: Final = frozenset({"def", "deffct", "global"})
OPENING: Final = {"if": False, "switch": False, "for": True, "while": True, "loop": True, "repeat": True}
CLOSING: Final = frozenset({"endif", "endswitch", "endfor", "endwhile", "endloop", "until"})
OTHERWISE: Final = frozenset({"else", "case", "default"})
JUMPS: Final = frozenset({"goto", "return", "exit"})
SPLINES: Final = frozenset({"spline", "ptp_spline"})
TAUGHT_ACCURATE: Final = "bit 3 of S says that points were taught with an absolutely accurate robot"
RUN_TIME: Final = "its target is computed at run time"
READ: Final = "the program computes with it"
ROUND_AGAIN: Final = "a loop comes round to it with another tool or base"


class KrlReading:
    """One reading of a .src with its .dat."""

    def __init__(self, language: "KRL", sources: tuple[Source, ...], robot: Robot, frames: Frames) -> None:
        if robot.joints != ("revolute",) * 6:
            raise InputError(
                f"{robot.name} has {robot.joint_count} joints",
                where=str(sources[0].path),
                rule="KRL programs are compensated for arms with six revolute axes",
            )
        self._language, self._sources, self._robot = language, sources, robot
        self._targets, self._moves, self._environments = TargetTable(), MoveTable(), Environments()
        self._listed: list[Listed] = []
        self._fixed: dict[int, str] = {}
        self._storage = KrlStorage()
        self._numbers: dict[str, int] = {}
        self._accurate, self._in_spline, self._prepared = False, False, ""
        self._used: list[int] = []
        for number in self._data_first():
            self._storage.gather(number, sources[number])
        self._frames = KrlFrames(self._storage, frames, sources)
        self._flow = Flow(self._frames.start(), Modal.joined, Modal.same)
        self._around = self._flow.state

    def program(self) -> Program:
        """The program."""
        for number in self._data_first():
            source = self._sources[number]
            if source.path.suffix.lower() != ".dat":
                for start, end in lines(source):
                    self._line(number, start, end)
        self._settle()
        return Program(
            self._language,
            self._sources,
            (Joints.of(self._robot.joints), EulerPose(configuration=2)),
            self._targets.freeze(),
            self._moves.freeze(),
            tuple(self._environments.all),
            tuple(sorted(self._listed)),
            self._configuration(),
            fixed=self._fixed,
            accurate=TAUGHT_ACCURATE if self._accurate else "",
        )

    def _configuration(self) -> StatusAndTurn | None:
        try:
            return StatusAndTurn(Branches.of(self._robot))
        except InputError:
            return None

    def _data_first(self) -> list[int]:
        order = range(len(self._sources))
        return sorted(order, key=lambda number: self._sources[number].path.suffix.lower() != ".dat")

    def _line(self, file: int, start: int, end: int) -> None:
        source = self._sources[file]
        head = source.text[start:end].lstrip()
        if not head or head[0] in ";&":
            return
        reader = line_reader(source, start, end)
        if reader.done:
            return
        word = reader.peek()
        if word in MOTIONS and reader.peek(1) not in {"=", "(", "[", "."}:
            at = reader.take().start
            self._motion((file, at), MOTIONS[word], reader, passing=word == "spl")
        elif word in RELATIVE:
            self._list(file, reader.offset, "a relative move")
            self._flow.jump()
        elif ASSIGNING.match(source.text, start, end):
            self._assignment(reader)
        elif word == "bas":
            self._bas(reader)
        else:
            self._statement(word, reader)

    def _statement(self, word: str, reader: Reader) -> None:
        flow = self._flow
        if word in ROUTINES:
            flow.restart()
        elif word in OPENING:
            flow.open(loop=OPENING[word])
        elif word in CLOSING:
            flow.close()
        elif word in OTHERWISE:
            flow.otherwise(last=word != "case")
        elif word in JUMPS or reader.peek(1) == ":":
            flow.jump()
        elif word in SPLINES:
            self._in_spline, self._around = True, flow.state
            flow.state = self._with([token.text.lower() for token in reader.rest()])
        elif word == "endspline":
            self._in_spline, flow.state = False, self._around
        elif reader.kind() == "name" and reader.peek(1) == "(":
            flow.state = flow.state.lost(CALLED)
            flow.jump()
        if word not in ROUTINES | {"decl"}:
            self._storage.read |= names_in(reader.rest())

    def _bas(self, reader: Reader) -> None:
        """BAS sets what the inline forms prepared."""
        words = [token.text.lower() for token in reader.rest()]
        command = words[3] if len(words) > 3 and words[1:3] == ["(", "#"] else ""
        number = words[5] if len(words) > 5 and words[4] == "," and words[5].isdigit() else "?"
        state = self._flow.state
        if command in {"ptp_params", "cp_params", "frames"}:
            self._flow.state = self._frames.of_inline_form(state, self._prepared)
        elif command in {"tool", "base"}:
            self._flow.state = state.set(command, self._frames.numbered(command, number))
        elif command == "initmov":
            self._flow.state = state.lost("BAS(#INITMOV) was called since it was set")

    def _assignment(self, reader: Reader) -> None:
        variable = named(reader)
        if variable is None:
            return
        state, kind = self._flow.state, variable.name.removeprefix("$")
        if variable.name in {"$tool", "$base"}:
            whole = reader.accept("=")
            frame = self._frames.evaluated(kind, operands(reader) if whole else None)
            self._flow.state = state.set(kind, frame)
        elif not reader.accept("="):
            return
        elif variable.name == "fdat_act":
            self._prepared = reader.peek()
        elif variable.name == "$ipo_mode":
            mode = "".join(token.text for token in reader.rest())
            self._flow.state = replace(state, remote=remote(mode))
        elif variable.name == "$load" and reader.peek() == "{":
            mass = structure(reader).numbers.get("m")
            self._flow.state = replace(state, load_kg=None if mass is None else mass.value)

    def _motion(self, place: tuple[int, int], motion: Motion, reader: Reader, *, passing: bool) -> None:
        chains = [operands(reader)]
        if motion == Motion.CIRCULAR:
            chains.append(operands(reader) if reader.accept(",") else None)
        words = [token.text.lower() for token in reader.rest()]
        before = self._flow.state
        self._flow.state = self._with(words)
        blended = passing or self._in_spline or bool(BLENDING & set(words))
        kinds = [Motion.VIA, Motion.CIRCULAR] if motion == Motion.CIRCULAR else [motion]
        for kind, chain in zip(kinds, chains, strict=True):
            self._go(place, chain, kind, blended=blended or kind == Motion.VIA)
        self._flow.state = before

    def _with(self, words: list[str]) -> Modal:
        """The state of a motion with settings of its own, such as WITH $TOOL=STOOL2(FP1)."""
        state = self._flow.state
        if "with" not in words:
            return state
        text = "".join(words[words.index("with") :])
        found = re.search(r"\$tool=stool2?\((\w+)", text)
        if found is not None:
            return self._frames.of_inline_form(state, found.group(1))
        for kind in ("tool", "base"):
            if f"${kind}=" in text:
                state = state.set(kind, Frame.missing(f"{kind}: it is set in the motion in an unknown way"))
        return state

    def _go(self, place: tuple[int, int], chain: Operands | None, motion: Motion, *, blended: bool) -> None:
        """A move to the target of a chain of operands, or a line of the listing."""
        found = RUN_TIME if chain is None else self._target_among(place[0], chain)
        if isinstance(found, str) or chain is None:
            self._list(*place, found if isinstance(found, str) else RUN_TIME)
            self._flow.jump()
            return
        numbers, which = found
        environment = self._environments.number(self._environment(chain, which))
        for number in numbers:
            follows = self._flow.certain and len(numbers) == 1
            self._moves.add(number, place, motion, environment=environment, blended=blended, follows=follows)
            self._used.append(number)
            self._flow.use(len(self._used) - 1)
        if len(numbers) > 1:
            self._flow.jump()

    def _environment(self, chain: Operands, which: int) -> Environment:
        state = self._flow.state
        before, after, problem = np.eye(4), np.eye(4), ""
        for number, operand in enumerate(chain):
            if number == which:
                continue
            if isinstance(operand, Named):
                self._storage.read.add(operand.name)
            frame = self._frames.constant("tool", operand)
            problem = problem or (f"its offset: {frame.unknown}" if frame.unknown else "")
            before, after = (before @ frame.true, after) if number < which else (before, after @ frame.true)
        payload = self._frames.payload_kg(state)
        return Environment(state.tool, state.base, before, after, state.remote, problem, payload_kg=payload)

    def _target_among(self, file: int, chain: Operands) -> tuple[list[int], int] | str:
        """Numbers of the target among operands and its place, or why there is none."""
        if len(chain) == 1 and isinstance(chain[0], Structure):
            problem = chain[0].problem()
            return problem if problem else ([self._add(file, chain[0], "")], 0)
        why = ""
        for which in self._likely(chain):
            operand = chain[which]
            if isinstance(operand, Named) and operand.name not in {"$nullframe", "$world"}:
                found = self._stored(operand)
                if not isinstance(found, str):
                    return found, which
                why = why or found
        return why or RUN_TIME

    def _likely(self, chain: Operands) -> list[int]:
        """Places of operands: those that are declared as targets first, the last before the others."""
        kinds = [
            self._storage.kinds.get(operand.name) if isinstance(operand, Named) else None for operand in chain
        ]
        return sorted(range(len(chain)), key=lambda which: (kinds[which] not in TARGET_KINDS, -which))

    def _stored(self, variable: Named) -> list[int] | str:
        keys = self._storage.elements(variable)
        why = [self._storage.why_not(key) for key in keys or [variable.key]]
        first = next((reason for reason in why if reason), "")
        return first or [self._number(key) for key in keys]

    def _number(self, key: str) -> int:
        """The number of a stored target that can be changed."""
        if key not in self._numbers:
            file, value = self._storage.values[key][0]
            if value is None:
                raise KeyError(key)
            self._numbers[key] = self._add(file, value, key.upper())
        return self._numbers[key]

    def _add(self, file: int, value: Structure, name: str) -> int:
        layout = OF_AXES if value.is_axes else OF_POSES
        status = value.numbers.get("s")
        self._accurate |= status is not None and bool(int(status.value) & ACCURATE)
        return self._targets.add(file, value.at, layout, value.target(), name)

    def _list(self, file: int, offset: int, reason: str, name: str = "") -> None:
        source = self._sources[file]
        line, column = source.place(offset)
        self._listed.append(Listed(file, line, column, name or source.line_text(line).strip(), reason))

    def _settle(self) -> None:
        """Targets that the program computes with, and those that nothing goes to."""
        for key, stored in self._storage.values.items():
            if key in self._numbers or self._storage.kinds.get(key.split("[")[0]) not in TARGET_KINDS:
                continue
            file, value = stored[0]
            if not self._storage.why_not(key):
                self._number(key)
            elif value is not None:
                self._list(file, value.at, self._storage.why_not(key), key.upper())
        for key, number in self._numbers.items():
            name = key.split("[")[0]
            if name in self._storage.read:
                self._fixed.setdefault(number, READ)
            if f"{name}[?]" in self._storage.values:
                self._fixed.setdefault(number, COMPUTED)
        for move in self._flow.overruled:
            self._fixed.setdefault(self._used[move], ROUND_AGAIN)
