"""Reading KRL: first what is stored under which name, then the motions in their order."""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from truearm.errors import InputError
from truearm.programs.branches import Branches
from truearm.programs.environment import Environment, Frame
from truearm.programs.flow import Flow
from truearm.programs.frames import Frames
from truearm.programs.gathered import Gathered
from truearm.programs.krl_order import Order, Place
from truearm.programs.krl_orientation import BEHIND, MODAL
from truearm.programs.krl_routines import (
    BAS_LEAVING,
    DOING_LATER,
    EXTERNAL,
    LEAVING,
    SETTING,
    Routine,
    Routines,
    bas_command,
    called,
    immediate,
)
from truearm.programs.krl_state import (
    CALLED,
    CALLERS,
    INTERRUPTED,
    JUMPED,
    NOTHING,
    ROUND_AGAIN,
    FrameData,
    KrlFrames,
    Modal,
    remote,
)
from truearm.programs.krl_status import ACCURATE, StatusAndTurn
from truearm.programs.krl_storage import (
    ASSIGNING,
    COMPUTED,
    DECLARED,
    TARGET_KINDS,
    KrlStorage,
    is_data,
    lines,
)
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
from truearm.programs.krl_words import BLENDING, MOTIONS, RELATIVE, SPLINE_ENDS, SPLINES, VIAS
from truearm.programs.layouts import EulerPose, Joints
from truearm.programs.lexing import Reader, Token
from truearm.programs.program import Program
from truearm.programs.source import Source
from truearm.programs.tables import Motion, Via
from truearm.robot import Robot

if TYPE_CHECKING:
    from truearm.programs.krl import KRL

OF_AXES, OF_POSES = 0, 1
OWN: Final = {
    "tool": re.compile(r"\$tool=stool2?\((\w+)\)"),
    "base": re.compile(r"\$base=sbase\((\w+)\.base_no\)"),
    "mode": re.compile(r"\$ipo_mode=sipo_mode\((\w+)\.ipo_frame\)"),
}
"""Settings of a motion's own that name the frame data of an inline form."""
ANGLE: Final = "ca"
"""Tells how far an arc goes, which then ends elsewhere than at its target."""
OPENING: Final = {"if": False, "switch": False, "for": True, "while": True, "loop": True, "repeat": True}
CLOSING: Final = frozenset({"endif", "endswitch", "endfor", "endwhile", "endloop", "until"})
OTHERWISE: Final = frozenset({"else", "case", "default"})
JUMPS: Final = frozenset({"goto", "return"})
TAUGHT_ACCURATE: Final = "bit 3 of S says that points were taught with an absolutely accurate robot"
RUN_TIME: Final = "its target is computed at run time"
READ: Final = "the program computes with it"


class Call(NamedTuple):
    """A call of a routine of the program.

    Attributes:
        use: Its number among the uses of the state; None where an interrupt or a trigger calls it.
        state: What is known there.
        place: Where it is.
    """

    use: int | None
    state: Modal
    place: Place


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
        self._found = Gathered(sources)
        self._storage = KrlStorage()
        self._numbers: dict[str, int] = {}
        self._in_spline, self._changing = False, set[str]()
        self._used: list[int | None] = []
        self._calls: dict[str, list[Call]] = {}
        for number in self._data_first():
            self._storage.gather(number, sources[number])
        self._routines, self._order = Routines(sources), Order()
        self._frames = KrlFrames(self._storage, frames, sources, self._routines, self._order)
        self._flow = Flow(self._frames.start(), Modal.joined, Modal.same, Modal.overruled)
        self._around, self._gone = self._flow.state, False

    def program(self) -> Program:
        """The program."""
        for number in self._data_first():
            source = self._sources[number]
            if not is_data(source):
                for start, end in lines(source):
                    self._line(number, start, end)
        self._settle()
        layouts = (Joints.of(self._robot.joints), EulerPose(configuration=2))
        return self._found.program(self._language, layouts, lambda: StatusAndTurn(Branches.of(self._robot)))

    def _data_first(self) -> list[int]:
        order = range(len(self._sources))
        return sorted(order, key=lambda number: not is_data(self._sources[number]))

    def _line(self, file: int, start: int, end: int) -> None:
        source = self._sources[file]
        head = source.text[start:end].lstrip()
        if not head or head[0] in ";&":
            return
        routine = self._routines.beginning(file, start)
        if routine is not None:
            self._begin(routine)
            return
        reader = line_reader(source, start, end)
        word = reader.peek()
        if reader.done or word in EXTERNAL or DECLARED.match(source.text, start, end):
            return
        if "(" in head or word in DOING_LATER:
            self._calls_of(reader.rest())
        if word in MOTIONS and reader.peek(1) not in {"=", "(", "[", "."}:
            at = reader.take().start
            self._motion((file, at), word, reader)
        elif word in RELATIVE:
            self._found.leave((file, reader.offset), "a relative move")
            self._storage.read |= names_in(reader.rest())
            self._flow.jump()
        elif ASSIGNING.match(source.text, start, end):
            self._assignment(file, reader)
        elif word == "bas":
            self._bas((file, start), reader)
        else:
            self._statement(word, reader, (file, start))

    def _begin(self, routine: Routine) -> None:
        """A routine begins: the program itself with what the controller has, others with what callers set."""
        self._flow.restart()
        self._in_spline, self._gone = False, False
        known = self._routines.called_above_only(routine)
        calls = self._calls.get(routine.name, []) if known else []
        self._order.begin([call.place for call in calls])
        if self._routines.is_program(routine):
            return
        states = [
            call.state.lost(ROUND_AGAIN) if call.use in self._flow.overruled else call.state for call in calls
        ]
        state = states[0] if states else replace(self._flow.state.lost(CALLERS), load_kg=None)
        for other in states[1:]:
            state = state.joined(other)
        self._flow.state = state

    def _calls_of(self, found: list[Token]) -> None:
        """Routines that a line calls may set tool and base, and move the arm."""
        now, later = immediate(found)
        for name in called(now):
            if self._routines.local(name):
                self._called(name)
            changed = self._routines.changed_by(name, now)
            self._flow.state = self._flow.state.changed(changed, CALLED, BEHIND)
            if self._routines.local(name) or name not in LEAVING:
                self._flow.jump()
        for name in called(later):
            if self._routines.local(name):
                call = Call(None, self._flow.state.lost(INTERRUPTED), self._order.here())
                self._calls.setdefault(name, []).append(call)
        self._changing |= self._routines.changed_later(later)
        if later and found[0].text.lower() != "trigger":
            self._after_interrupts()

    def _called(self, name: str) -> None:
        """A routine of the program is called: it begins with the present state."""
        self._used.append(None)
        number = len(self._used) - 1
        self._calls.setdefault(name, []).append(Call(number, self._flow.state, self._order.here()))
        self._flow.use(number)

    def _after_interrupts(self) -> None:
        """What interrupts and triggers may have set by now."""
        if not self._in_spline:
            self._flow.state = self._flow.state.changed(self._changing, INTERRUPTED)

    def _statement(self, word: str, reader: Reader, place: tuple[int, int]) -> None:
        flow = self._flow
        if word in OPENING:
            flow.state = flow.state.unprepared() if OPENING[word] else flow.state
            flow.open(loop=OPENING[word])
            self._order.open()
        elif word in CLOSING:
            flow.close()
            self._order.close()
        elif word in OTHERWISE:
            flow.otherwise(last=word != "case")
            self._order.otherwise()
        elif word == "exit":
            flow.leave()
        elif word in JUMPS:
            self._gone |= word == "goto"
            flow.jump()
        elif reader.peek(1) == ":":
            self._label(place)
        elif word in SPLINES:
            self._in_spline, self._around = True, flow.state
            flow.state = self._with(place, reader.rest())
        elif word == SPLINE_ENDS:
            self._in_spline, flow.state = False, self._around
            self._after_interrupts()
        if word != "decl":
            self._storage.read |= names_in(reader.rest())

    def _label(self, place: tuple[int, int]) -> None:
        """Statements that a GOTO may lead to from elsewhere follow."""
        if self._gone:
            self._order.forget()
        self._flow.state = self._flow.state.changed(self._routines.wandering(*place), JUMPED)
        self._flow.jump()

    def _bas(self, place: tuple[int, int], reader: Reader) -> None:
        """BAS sets what the inline forms prepared."""
        command, number = bas_command([token.text.lower() for token in reader.rest()])
        state = self._flow.state
        if command in {"ptp_params", "cp_params", "frames"}:
            self._flow.state = self._frames.of_inline_form(state, state.prepared)
        elif command in {"tool", "base"}:
            self._flow.state = state.set(command, self._frames.numbered(command, number))
        elif command not in BAS_LEAVING:
            name = f"#{command.upper()}" if command else ""
            self._flow.state = state.lost(f"BAS({name}) was called since it was set")
        if command:
            orientation = state.orientation.behind_bas(command, place)
            self._flow.state = replace(self._flow.state, orientation=orientation)

    def _assignment(self, file: int, reader: Reader) -> None:
        place, variable = (file, reader.offset), named(reader)
        if variable is None:
            return
        state, kind = self._flow.state, variable.name.removeprefix("$")
        whole = reader.accept("=")
        if variable.name in {"$tool", "$base"}:
            frame = self._frames.evaluated(kind, operands(reader) if whole else None)
            self._flow.state = state.set(kind, frame)
        elif variable.name == "fdat_act":
            prepared = self._frame_data(file, reader) if whole else NOTHING
            self._flow.state = replace(state, prepared=prepared)
        elif variable.name in MODAL:
            told = "".join(token.text.lower() for token in reader.rest())
            self._flow.state = self._frames.oriented(
                state, variable.name, f"={told}" if whole else told, place
            )
        elif not whole:
            return
        elif variable.name == "$ipo_mode":
            mode = "".join(token.text for token in reader.rest())
            self._flow.state = replace(state, remote=remote(mode))
        elif variable.name == "$load":
            mass = structure(reader).numbers.get("m") if reader.peek() == "{" else None
            self._flow.state = replace(state, load_kg=None if mass is None else mass.value)
        else:
            self._order.assign(variable.key)

    def _frame_data(self, file: int, reader: Reader) -> FrameData:
        """What an inline form prepares: frame data by name, or written out."""
        if reader.peek() == "{":
            return FrameData("FDAT_ACT", file, structure(reader))
        return self._frames.frame_data(reader.peek())

    def _motion(self, place: tuple[int, int], word: str, reader: Reader) -> None:
        whole, motion = reader.rest(), MOTIONS[word]
        chains = [operands(reader)]
        if motion == Motion.CIRCULAR:
            chains.append(operands(reader) if reader.accept(",") else None)
        found = reader.rest()
        words = [token.text.lower() for token in found]
        before = self._flow.state
        self._flow.state = self._with(place, found).along(motion)
        blended = word == "spl" or self._in_spline or bool(BLENDING & set(words))
        kinds = [Motion.VIA, Motion.CIRCULAR] if motion == Motion.CIRCULAR else [motion]
        for number, (kind, chain) in enumerate(zip(kinds, chains, strict=True)):
            if kind == Motion.VIA:
                via = Via.ON_PATH if self._frames.mentioned.on_path and word == "circ" else VIAS[word]
                self._found.vias[len(self._found.moves)] = Via.OPEN if ANGLE in words else via
            if not self._go(place, chain, kind, blended=blended or kind == Motion.VIA):
                self._storage.read |= names_in([token for part in _parts(whole)[number:] for token in part])
        if "with" in words:
            self._storage.read |= names_in(found[words.index("with") :])
        if ANGLE in words or self._flow.state.orientation.unheeded:
            self._flow.jump()
        self._flow.state = before
        self._after_interrupts()

    def _with(self, place: tuple[int, int], found: list[Token]) -> Modal:
        """The state of a motion with settings of its own, such as WITH $TOOL=STOOL2(FP1)."""
        state = self._flow.state
        words = [token.text.lower() for token in found]
        if "with" not in words:
            return state
        for part in _parts(found[words.index("with") + 1 :]):
            if not part or part[0].text.lower() not in SETTING | MODAL:
                continue
            text = "".join(token.text.lower() for token in part if token.text.lower() not in BLENDING)
            kind = next((one for one, pattern in OWN.items() if pattern.fullmatch(text)), "")
            if kind:
                data = self._frames.frame_data(text.partition("(")[2].rstrip(")").partition(".")[0])
                state = self._frames.of_inline_form(state, data, (kind,))
            elif text.startswith(("$tool", "$base")):
                unknown = Frame.missing(f"{text[1:5]}: it is set in the motion in an unknown way")
                state = state.set(text[1:5], unknown)
            elif text.startswith("$ipo_mode="):
                state = replace(state, remote=remote(text.partition("=")[2]))
            elif text.startswith("$ori_type="):
                state = self._frames.oriented(state, "$ori_type", text.removeprefix("$ori_type"), place)
        return state

    def _go(self, place: tuple[int, int], chain: Operands | None, motion: Motion, *, blended: bool) -> bool:
        """Whether there is a move to the target of a chain of operands; a line of the listing otherwise."""
        found = RUN_TIME if chain is None else self._target_among(place[0], chain)
        if isinstance(found, str) or chain is None:
            self._found.leave(place, found if isinstance(found, str) else RUN_TIME)
            self._found.unplace(place, motion, blended=blended)
            self._flow.jump()
            return False
        numbers, which = found
        meant, unheeded = self._environment(chain, which), self._flow.state.orientation.why_not(motion)
        if unheeded and not meant.why_not_poses:
            self._found.keep(numbers, unheeded)
        environment = self._found.environments.number(meant)
        for number in numbers:
            follows = self._flow.certain and len(numbers) == 1
            self._found.moves.add(
                number, place, motion, environment=environment, blended=blended, follows=follows
            )
            self._used.append(number)
            self._flow.use(len(self._used) - 1)
        if len(numbers) > 1:
            self._flow.jump()
        return True

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
        if status is not None and int(status.value) & ACCURATE:
            self._found.accurate = TAUGHT_ACCURATE
        return self._found.targets.add(file, value.at, layout, value.target(), name)

    def _settle(self) -> None:
        """Targets that the program computes with, and those that nothing goes to."""
        for key, stored in self._storage.values.items():
            if key in self._numbers or self._storage.kinds.get(key.split("[")[0]) not in TARGET_KINDS:
                continue
            file, value = stored[0]
            if not self._storage.why_not(key):
                self._number(key)
            elif value is not None:
                self._found.leave((file, value.at), self._storage.why_not(key), key.upper())
        for key, number in self._numbers.items():
            self._settle_one(key, number)
        for use in self._flow.overruled:
            target = self._used[use]
            if target is not None:
                self._found.keep([target], ROUND_AGAIN)

    def _settle_one(self, key: str, number: int) -> None:
        name = key.partition("[")[0]
        if name in self._storage.read:
            self._found.keep([number], READ)
        computed = f"{name}[?]" in self._storage.values
        if computed:
            self._found.keep([number], COMPUTED)
        if computed or not self._routines.given.isdisjoint({key, name}):
            self._found.unsure.add(number)


def _parts(found: Sequence[Token]) -> list[list[Token]]:
    """Tokens between commas that no brackets enclose."""
    parts: list[list[Token]] = [[]]
    depth = 0
    for token in found:
        depth += (token.text in "({[") - (token.text in ")}]")
        if token.text == "," and depth == 0:
            parts.append([])
        else:
            parts[-1].append(token)
    return parts
