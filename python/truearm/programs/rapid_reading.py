"""Reading RAPID: first what is declared, then the motions in their order."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from truearm.errors import InputError
from truearm.programs.branches import Branches
from truearm.programs.environment import Environment
from truearm.programs.flow import Flow
from truearm.programs.frames import Frames
from truearm.programs.gathered import Gathered
from truearm.programs.layouts import Joints, QuaternionPose
from truearm.programs.lexing import Reader, Token
from truearm.programs.program import Program
from truearm.programs.rapid_configuration import Confdata
from truearm.programs.rapid_confs import KINDS, LOCKING, Confs
from truearm.programs.rapid_data import MODULE, TARGETS, TWICE, Declarations
from truearm.programs.rapid_frames import RapidFrames
from truearm.programs.rapid_functions import called, harmless
from truearm.programs.rapid_instructions import (
    COUNTING,
    HARMLESS,
    INSTRUCTIONS,
    MOVING,
    SETTINGS,
    Instruction,
    motions_named,
)
from truearm.programs.rapid_routines import BEGINNINGS, ENDINGS, given, is_variable
from truearm.programs.rapid_targets import Meant, RapidTargets
from truearm.programs.rapid_values import (
    Aggregate,
    Argument,
    arguments,
    instruction_place,
    place_of,
    pose_of,
    statement_reader,
    statements,
)
from truearm.programs.source import Source
from truearm.programs.tables import Motion, Via
from truearm.robot import Robot
from truearm.types import Transform

if TYPE_CHECKING:
    from truearm.programs.rapid import RAPID

HANDLER: Final = re.compile(
    r"^\s*(?:TRAP\b.*?^\s*ENDTRAP\b|ERROR\b.*?^\s*END(?:PROC|FUNC|TRAP)\b)",
    re.IGNORECASE | re.MULTILINE | re.DOTALL,
)
"""What may be executed between any two motions."""
DISPLACEMENT: Final = re.compile(r"\b(?:pdisp|eoffs)(?:set|on)\b", re.IGNORECASE)
HANDLERS: Final = frozenset({"error", "undo", "backward"})
BEGINS: Final = BEGINNINGS | {"module"}
ENDS: Final = ENDINGS | HANDLERS | {"endmodule", "goto"}
LEAVING: Final = frozenset({"return", "raise", "exit", "exitcycle", "goto"})
JUMPS: Final = frozenset({"return", "raise", "exit", "exitcycle", "stop", "retry", "trynext", "goto"})
CLOSING: Final = frozenset({"endif", "endfor", "endwhile", "endtest"})
READ: Final = "the program computes with it"
PASSED: Final = "it is given to an instruction or routine that is not known here"
LOCKED: Final = (
    r"axis 4 is locked there, or may be (SingArea \LockAxis4), so that the arm does not take the target's "
    r"orientation: to have it corrected, go there behind SingArea \Wrist or \Off"
)
DISPLACED: Final = "a program displacement (PDispOn, PDispSet, EOffs) may be active"


@dataclass(frozen=True, eq=False)
class _Modal:
    """Displacement and load that are active."""

    displacement: Transform
    problem: str = ""
    load_kg: float | None = None


@dataclass(frozen=True, eq=False)
class _Use:
    """A motion to a target, or to one of several, with what was active there."""

    at: int
    motion: Motion
    meant: Meant
    tool: Argument
    state: _Modal
    passed: bool
    follows: bool


class RapidReading:
    """One reading of a module."""

    def __init__(self, language: "RAPID", sources: tuple[Source, ...], robot: Robot, frames: Frames) -> None:
        if robot.joints != ("revolute",) * 6:
            raise InputError(
                f"{robot.name} has {robot.joint_count} joints",
                where=str(sources[0].path),
                rule="RAPID programs are compensated for arms with six revolute axes",
            )
        self._language, self._source, self._robot = language, sources[0], robot
        self._declarations = Declarations()
        self._declarations.gather(self._source)
        self._harmless = harmless(self._source, self._declarations.routines.keys())
        self._found = Gathered((self._source,))
        self._targets = RapidTargets(self._declarations, self._source, self._found.targets)
        self._frames = RapidFrames(self._declarations, frames)
        self._read: dict[str, str] = {}
        self._displaces = DISPLACEMENT.search(self._source.text) is not None
        self._displaced_anytime = any(
            DISPLACEMENT.search(handler[0]) for handler in HANDLER.finditer(self._source.text)
        )
        start = _Modal(np.eye(4), DISPLACED if self._displaces else "")
        self._flow = Flow(start, _joined, _same)
        self._confs, self._via = Confs(), Via.ON_PATH
        self._used: list[int] = []
        self._uses: list[_Use] = []
        self._gifts: set[tuple[str, str]] = set()
        self._nested: list[int] = []

    def program(self) -> Program:
        """The program."""
        for start, end in statements(self._source):
            reader = statement_reader(self._source, start, end)
            self._blocks(reader)
            if not reader.done:
                self._statement(reader)
        self._declarations.give(self._gifts)
        self._move()
        self._settle()
        layouts = (Joints.of(self._robot.joints), QuaternionPose(configuration=4))
        return self._found.program(self._language, layouts, lambda: Confdata(Branches.of(self._robot)))

    # Blocks.

    def _blocks(self, reader: Reader) -> None:
        """Take what begins and ends blocks, which no semicolon ends, from the front of a statement."""
        while not reader.done and self._block(reader):
            pass

    def _block(self, reader: Reader) -> bool:
        word, flow = reader.peek(), self._flow
        if word in {"local", "task"} and reader.peek(1) in BEGINS | {"record"}:
            reader.take()
        elif word in BEGINS:
            self._begin(reader)
        elif word in ENDS:
            reader.take()
            flow.jump()
            self._confs.note("handler" if word in HANDLERS else "leave")
            if word in ENDINGS:
                self._declarations.enter(MODULE)
        elif word in CLOSING:
            reader.take()
            for _ in range(1 + (self._nested.pop() if self._nested else 0)):
                flow.close()
                self._confs.note("close")
        elif word in {"if", "elseif", "while", "for", "test", "case", "default", "else"}:
            return self._branch(reader, word)
        elif word == "%" or (word in {"version", "language"} and reader.peek(1) == ":"):
            self._header(reader)
        elif reader.kind() == "name" and reader.peek(1) == ":":
            reader.take()
            reader.take()
            flow.jump()
            self._confs.note("label")
        else:
            return False
        return True

    def _header(self, reader: Reader) -> None:
        if reader.take().text != "%":
            reader.take()
            if not reader.done:
                reader.take()

    def _begin(self, reader: Reader) -> None:
        word = name = reader.take().text.lower()
        self._flow.restart()
        self._nested.clear()
        while not reader.done and reader.peek() != "(" and reader.kind() == "name":
            name = reader.take().text.lower()
            if word in {"proc", "trap", "module"}:
                break
        self._declarations.enter(MODULE if word == "module" else name)
        self._confs.begin(word, name)
        if reader.peek() == "(":
            _skip(reader, "(", ")")

    def _branch(self, reader: Reader, word: str) -> bool:
        flow = self._flow
        if word == "if" and not any(token.text.lower() == "then" for token in reader.rest()):
            self._short_if(reader)
            return False
        reader.take()
        stop = {"if": "then", "elseif": "then", "while": "do", "for": "do", "case": ":", "default": ":"}
        condition: list[Token] = []
        while word == "test" and not reader.done and reader.peek() not in {"case", "default"}:
            condition.append(reader.take())
        while word in stop and not reader.done:
            token = reader.take()
            if token.text.lower() == stop[word]:
                break
            condition.append(token)
        self._mention(condition, READ)
        if word in {"elseif", "else", "case", "default"}:
            self._otherwise(condition, last=word in {"else", "default"})
        else:
            self._run_functions(condition)
            self._nested.append(0)
            flow.open(loop=word in {"while", "for"})
            self._confs.note("loop" if word in {"while", "for"} else "if")
        return True

    def _otherwise(self, condition: Sequence[Token], *, last: bool) -> None:
        """Another branch; where its condition runs what may move the arm, all that follows is within it."""
        nested = not last and self._nested != [] and not self._harmless.issuperset(called(condition))
        self._flow.otherwise(last=last or nested)
        self._confs.note("last" if last or nested else "else")
        if nested:
            self._run_functions(condition)
            self._nested[-1] += 1
            self._flow.open(loop=False)
            self._confs.note("if")

    def _short_if(self, reader: Reader) -> None:
        """IF condition instruction; the instruction, another IF too, may or may not be executed."""
        states = []
        while reader.peek() == "if":
            condition = [reader.take() for _ in range(instruction_place(reader.rest()))]
            self._mention(condition, READ)
            self._run_functions(condition)
            states.append(self._flow.state)
            self._flow.jump()
            self._confs.note("if")
        if not reader.done:
            self._statement(reader)
        for state in reversed(states):
            self._confs.note("close")
            self._flow.state = _joined(state, self._flow.state)
        self._flow.jump()
        while not reader.done:
            reader.take()

    # Statements.

    def _statement(self, reader: Reader) -> None:
        at, word = reader.offset, reader.peek()
        found = reader.rest()
        self._run_functions(found[1:])
        if word in INSTRUCTIONS:
            self._motion(at, INSTRUCTIONS[word], arguments(found[1:]))
        elif word.startswith(("pdisp", "eoffs")):
            self._displace(word, found)
        elif word == "gripload":
            self._flow.state = replace(self._flow.state, load_kg=self._frames.load_kg(found[1:]))
        elif kinds := [
            k for k, token in enumerate(found[:3]) if token.text.lower() in {"const", "pers", "var"}
        ]:
            self._mention(found[kinds[0] + 3 :], READ)
        elif reader.peek(1) in {":=", ".", "{"}:
            self._mention(found, READ)
        else:
            self._call(at, word, found)

    def _call(self, at: int, word: str, found: Sequence[Token]) -> None:
        self._mention(found[1:], PASSED, "" if word in JUMPS | HARMLESS else word)
        if word == "cirpathmode" and any(
            token.text.lower() not in {"\\", "pathframe"} for token in found[1:]
        ):
            self._via = Via.UNTOLD
        if word in SETTINGS:
            self._confs.set(word, {token.text.lower() for token in found[1:]})
        elif word in JUMPS:
            self._flow.jump()
            if word in LEAVING:
                self._confs.note("leave")
        elif word not in HARMLESS | COUNTING:
            if word.startswith(MOVING):
                self._leave(at, "an instruction that is not known here", motions_named(word))
            else:
                self._confs.note("call", word)
            self._run()

    def _run(self) -> None:
        """Something runs that may move the arm, and displace what comes after."""
        self._flow.jump()
        if self._displaces:
            self._flow.state = replace(self._flow.state, problem=DISPLACED)

    def _run_functions(self, found: Sequence[Token]) -> None:
        """The functions that an expression calls run before what it is in."""
        for name in called(found):
            if name not in self._harmless:
                self._confs.note("call", name)
                self._run()

    def _mention(self, found: Sequence[Token], reason: str, receiver: str = "") -> None:
        """Variables are used for something else than a motion; `receiver` as for `given`."""
        for place, token in enumerate(found):
            if token.kind == "name" and is_variable(found, place):
                self._read.setdefault(token.text.lower(), reason)
        if receiver or any(token.text == "(" for token in found):
            self._gifts.update(given(found, receiver))

    def _displace(self, word: str, found: Sequence[Token]) -> None:
        state = self._flow.state
        if word in {"pdispoff", "eoffsoff"}:
            problem = DISPLACED if self._displaced_anytime else ""
            self._flow.state = replace(state, displacement=np.eye(4), problem=problem)
            return
        name = found[1].text.lower() if len(found) == 2 else ""
        datum = self._declarations.data.get(name)
        certain = self._declarations.visible(name) and not self._declarations.doubt(name)
        pose = pose_of(datum.value) if datum is not None and datum.fixed and certain else None
        if word == "pdispset" and pose is not None and not self._displaced_anytime:
            self._flow.state = replace(state, displacement=pose[1], problem="")
        else:
            self._flow.state = replace(state, problem=DISPLACED)
        self._mention(found[1:], READ)

    def _motion(self, at: int, instruction: Instruction, stated: list[Argument]) -> None:
        """A motion: its targets, with the tool and the work object of the statement."""
        plain = [argument for argument in stated if argument.tokens]
        count = len(instruction.motions)
        if len(plain) <= instruction.tool:
            self._leave(at, "it has fewer arguments than this instruction needs", instruction.motions)
            return
        if any("corr" in argument.options for argument in stated):
            self._leave(at, "its path is corrected by sensors (\\Corr)", instruction.motions)
            for argument in plain[:count]:
                self._mention(argument.tokens, READ)
            return
        zone = plain[instruction.zone].tokens
        blended = not (len(zone) == 1 and zone[0].text.lower() == "fine")
        for motion, argument in zip(instruction.motions, plain[:count], strict=True):
            passed = blended or motion == Motion.VIA
            self._go(at, motion, self._targets.meant(argument.tokens), plain[instruction.tool], passed=passed)
            self._mention(self._targets.besides(argument.tokens), READ)
        for argument in plain[count:]:
            self._mention(argument.tokens, READ)
        for argument in stated:
            for tokens in argument.options.values():
                self._mention(tokens, READ)

    def _go(self, at: int, motion: Motion, meant: Meant | str, tool: Argument, *, passed: bool) -> None:
        if isinstance(meant, str):
            self._leave(at, meant, (motion,), passed=passed)
            return
        flow = self._flow
        follows = flow.certain and len(meant.targets) == 1
        self._confs.motion(KINDS[motion != Motion.JOINT], len(self._uses))
        if motion != Motion.JOINT:
            self._confs.motion(LOCKING, len(self._uses))
        self._uses.append(_Use(at, motion, meant, tool, flow.state, passed, follows))
        for number in meant.targets:
            self._used.append(number)
            flow.use(len(self._used) - 1)
        if len(meant.targets) > 1:
            flow.jump()

    def _leave(self, at: int, reason: str, motions: Sequence[Motion], *, passed: bool = True) -> None:
        """A statement is listed, its motions lead to no targets that are read, and stop unless `passed`."""
        self._found.leave((0, at), reason)
        for motion in motions:
            self._found.unplace((0, at), motion, blended=passed)
        self._flow.jump()

    # At the end.

    def _move(self) -> None:
        """The moves, once it is known which tools and work objects stay what they are."""
        nearest, locked = self._confs.nearest(), self._confs.locked()
        for number, use in enumerate(self._uses):
            problem = self._targets.doubt(use.meant.targets, heeded=nearest.get(number) is not True)
            environment = self._found.environments.number(self._environment(use, problem))
            if number in locked:
                self._found.keep(use.meant.targets, LOCKED)
            for target in use.meant.targets:
                if number in nearest:
                    self._found.nearest[len(self._found.moves)] = nearest[number]
                if use.motion == Motion.VIA:
                    self._found.vias[len(self._found.moves)] = self._via
                self._found.moves.add(
                    target,
                    (0, use.at),
                    use.motion,
                    environment=environment,
                    blended=use.passed,
                    follows=use.follows and number - 1 not in locked,
                )

    def _environment(self, use: _Use, problem: str) -> Environment:
        state, tool, meant = use.state, use.tool, use.meant
        held = self._frames.tool(tool.tokens)
        placed = self._frames.work_object(tool.options.get("wobj", ()))
        mass = self._frames.payload_kg(tool.tokens, tool.options.get("tload", ()))
        return Environment(
            held.frame,
            placed.frame,
            state.displacement @ meant.before,
            meant.after,
            problem=held.problem or placed.problem or problem,
            cartesian_problem=meant.problem or state.problem,
            payload_kg=mass if state.load_kg is None or mass is None else mass + state.load_kg,
        )

    def _settle(self) -> None:
        """Targets that are assigned to or computed with, and those that nothing goes to."""
        for key, datum in self._declarations.data.items():
            if datum.kind in TARGETS:
                self._settle_one(key.partition("{")[0], key)
        for use in self._flow.overruled:
            self._found.keep([self._used[use]], DISPLACED)

    def _settle_one(self, name: str, key: str) -> None:
        found = self._targets.stored(key)
        if isinstance(found, str):
            value = self._declarations.data[key].value
            written = isinstance(value, Aggregate) or key != name
            at = place_of(value) if value is not None and written else None
            if at is not None:
                self._found.leave((0, at), found, key)
        elif name in self._declarations.assigned:
            self._found.keep([found], "it is assigned at run time")
        elif name in self._declarations.twice:
            self._found.keep([found], f"it {TWICE}")
        elif name in self._read:
            self._found.keep([found], self._read[name])
        if not isinstance(found, str) and self._declarations.doubt(name):
            self._found.unsure.add(found)


def _skip(reader: Reader, opening: str, closing: str) -> None:
    level = 0
    while not reader.done:
        text = reader.take().text
        level += (text == opening) - (text == closing)
        if level == 0:
            return


def _same(one: _Modal, other: _Modal) -> bool:
    return (
        np.array_equal(one.displacement, other.displacement)
        and one.problem == other.problem
        and one.load_kg == other.load_kg
    )


def _joined(one: _Modal, other: _Modal) -> _Modal:
    """What is known where two branches meet."""
    agree = np.array_equal(one.displacement, other.displacement)
    return _Modal(
        one.displacement,
        (one.problem or other.problem) if agree else DISPLACED,
        one.load_kg if one.load_kg == other.load_kg else None,
    )
