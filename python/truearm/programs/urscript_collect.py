"""The first reading of a URScript program: its variables, motions, and what changes TCP and payload."""

import re
from array import array
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from truearm.programs.environment import Frame
from truearm.programs.frames import Frames, written_out
from truearm.programs.gathered import Gathered
from truearm.programs.source import Source
from truearm.programs.tables import Motion
from truearm.programs.urscript_constants import Constants, RunTime
from truearm.programs.urscript_flow import Step
from truearm.programs.urscript_lines import MOTIONS, STREAMED, TARGETS, Lines, blend_radius
from truearm.programs.urscript_scopes import Scopes
from truearm.programs.urscript_syntax import (
    FUNCTIONS,
    HEADERS,
    Node,
    NotReadable,
    Statement,
    Token,
    argument,
    expression,
    opens_pose,
    statements,
)

NOT_FOLLOWED: Final = "it is a motion that is not followed"
UNTRACKED: Final = {
    "speedj": "it is a speed, not a target",
    "speedl": "it is a speed, not a target",
    "force_mode": "the arm is moved by forces",
    "freedrive_mode": "the arm is moved by hand",
    "teach_mode": "the arm is moved by hand",
    "optimovej": NOT_FOLLOWED,
    "optimovel": NOT_FOLLOWED,
    "mc_run_motion": NOT_FOLLOWED,
    "interpreter_mode": "what is sent to the interpreter moves the arm",
}
AIMED: Final = {**MOTIONS, "optimovej": Motion.JOINT, "optimovel": Motion.LINEAR}
"""How what has a target goes there, whether it is followed or not."""
WITHIN: Final = "it stands within another statement, or the statement cannot be read"
SHIFTING: Final = frozenset(
    {"path_offset_enable", "path_offset_set", "track_conveyor_linear", "track_conveyor_circular"}
)
COUNTING: Final = frozenset({"length", "capacity", "size", "get_list_length"})
"""They tell how many elements a list has, the first two also as path.length()."""
HARMLESS: Final = COUNTING | {
    "textmsg",
    "popup",
    "pose_dist",
    "point_dist",
    "get_inverse_kin_has_solution",
    "is_within_safety_limits",
}
DEFINED: Final = re.compile(rb"\b(?:def|thread|sec)[ \t]+(\w+)")
PAYLOADS: Final = frozenset({"set_payload", "set_target_payload", "set_payload_mass"})
_OPERATORS: Final = ("+", "-", "*", "/", "%", "^")
TCP: Final = "tcp"
INSTALLATION: Final = "installation"


class MotionCall(NamedTuple):
    """A motion to a target, where it is not one of Lines.

    Attributes:
        at: Offset of the statement.
        target: Where it goes.
        motion: How.
        blended: Whether the arm does not stop there.
        mode: How movec turns the tool, as it is given; None where it is not.
    """

    at: int
    target: Node
    motion: Motion
    blended: bool
    mode: Node | None = None


class Collected:
    """What the statements of a program say.

    Attributes:
        lines: Motions that fill their lines.
        motions: The other motions.
        constants: Variables.
        elsewhere: Variables used for something else than a motion, and where.
        found: Motions without a target.
        shifted: Why no target is where it is written; empty if they are.
        breaks: Offsets behind which the arm may come from several places.
        over: Offsets behind which it comes on a line or an arc from a place without numbers.
    """

    def __init__(self, source: Source) -> None:
        self.lines = Lines(source)
        self.motions: list[MotionCall] = []
        self.constants = Constants()
        self.elsewhere: dict[str, int] = {}
        self.found = Gathered((source,))
        self.shifted = ""
        self.breaks, self.over = array("q"), array("q")
        self._source = source
        self._scopes = Scopes()
        self._steps: list[Step] = []
        self._tcps: dict[int, Node | None] = {}
        self._masses: dict[int, Node | None] = {}
        self._made_of: dict[str, tuple[int, list[str]]] = {}
        self._run: set[str] = set()
        for start, end in self.lines.rest():
            for statement in statements(source, start, end):
                self._statement(statement)
                self._scopes.take(statement)
        self._resolve()

    @cached_property
    def _own(self) -> frozenset[str]:
        """Names of the program's own functions."""
        return frozenset(name.decode("ascii") for name in DEFINED.findall(self._source.content))

    def leave(
        self,
        at: int,
        name: str,
        reason: str,
        motion: Motion | None = None,
        *,
        blended: bool = False,
        over: bool = False,
    ) -> None:
        """Something is left as it is, and where the arm comes from behind it is not known.

        Args:
            at: Offset of the statement.
            name: Of its target; empty for one without.
            reason: Why, in words that end a listing.
            motion: How the arm goes to a place that is not read; None where it goes to none.
            blended: Whether it does not stop there.
            over: Whether it certainly goes there, and on a line or an arc.
        """
        self.found.leave((0, at), reason, name)
        (self.over if over else self.breaks).extend((at, at + 1))
        if motion is not None:
            self.found.unplace((0, at), motion, blended=blended)

    def compute(self, node: Node, at: int) -> None:
        """The program computes a motion's target, or its numbers, from the variables in `node`."""
        names = list(_names([node]))
        self._note(names, at)
        self._spread(self.elsewhere, names)

    def steps(self, frames: Frames) -> Iterator[Step]:
        """The steps, with the TCPs and payloads that they set."""
        names = self._tcp_names()
        for step in self._steps:
            if step.kind == "tcp":
                yield step._replace(tool=self._tool(step.at, names.get(step.at, ""), frames))
            elif step.kind == "payload":
                yield step._replace(payload_kg=self._mass(self._masses[step.at]))
            else:
                yield step

    def installed(self, frames: Frames) -> Frame:
        """The TCP of the installation, which the arm has until the program sets one."""
        return frames.at_start("tool", INSTALLATION if self._tcps or INSTALLATION in frames.tools else TCP)

    def _tool(self, at: int, name: str, frames: Frames) -> Frame:
        node = self._tcps.get(at)
        try:
            if node is None or not self.constants.fixed(node):
                raise RunTime("")
            return frames.tool(name, self.constants.transform(node))
        except RunTime:
            line = self._source.place(at)[0]
            return Frame.missing(f"the TCP is computed when the program runs, in line {line}")

    def _tcp_names(self) -> dict[int, str]:
        """Name of each TCP that is set: its variable, or tcp, or tcp 1, tcp 2 and so on where they differ."""
        written = {at: node for at, node in self._tcps.items() if node is not None and node.kind != "name"}
        texts = {at: self._source.part(node.start, node.end) for at, node in written.items()}
        names = written_out(TCP, texts.values())
        found = {at: names[text] for at, text in texts.items()}
        return found | {at: node.text for at, node in self._tcps.items() if node and node.kind == "name"}

    def _mass(self, node: Node | None) -> float | None:
        try:
            return None if node is None else self.constants.number(node)
        except RunTime:
            return None

    def _statement(self, statement: Statement) -> None:
        word = statement.word
        for token in _changed_in(statement.tokens):
            self.constants.change(token.text, self._source.place(token.start)[0])
        if word in FUNCTIONS:
            self._function(statement)
        elif word in HEADERS or word in ("end", "break", "continue", "return"):
            self._steps.append(Step(statement.at, word))
            self._used(statement.tokens[1:], statement.at)
            self._read(statement.tokens[1 : -1 if statement.tokens[-1].text == ":" else None])
        else:
            self._plain(statement)

    def _function(self, statement: Statement) -> None:
        names = statement.names
        self._steps.append(Step(statement.at, statement.word, names[1] if len(names) > 1 else ""))
        for parameter in names[2:]:
            self.constants.change(parameter, self._source.place(statement.at)[0])
        self._used([token for token in statement.tokens[1:] if token.text not in names[1:2]], None)

    def _read(self, tokens: Sequence[Token]) -> Node | None:
        """The expression that `tokens` are; None for none, and for what cannot be read and may assign."""
        try:
            return expression(tokens) if tokens else None
        except NotReadable:
            for token in _assigned_in(tokens):
                self.constants.doubt(token.text, self._source.place(token.start)[0])
            return None

    def _plain(self, statement: Statement) -> None:
        """An assignment, a call, or something that is neither."""
        tokens = statement.tokens
        scope = 1 if statement.word in ("global", "local") else 0
        target = tokens[scope : scope + 2]
        if len(target) == 2 and target[0].kind == "name" and target[1].text == "=":
            self._assignment(target[0].text, statement, tokens[scope + 2 :], statement.word if scope else "")
        elif len(target) == 2 and target[1].text in ("[", ".") and any(t.text == "=" for t in tokens):
            self.constants.change(target[0].text, self._source.place(statement.at)[0])
            self._used(tokens, statement.at)
            first = next(place for place, token in enumerate(tokens) if token.text == "=")
            self._read(tokens[first + 1 :])
        else:
            if scope and target:
                self.constants.doubt(target[0].text, self._source.place(statement.at)[0])
            self._call(self._read(tokens), statement)

    def _assignment(self, name: str, statement: Statement, tokens: Sequence[Token], scope: str) -> None:
        line = self._source.place(statement.at)[0]
        value = self._read(tokens)
        if value is None:
            self.constants.assign(name, None, line)
            self._used(tokens, statement.at)
            return
        self.constants.assign(name, value, line, self._scopes.always, scope)
        self._note(_of_numbers(value), statement.at)
        made_of = self._made_of.get(name, (0, []))[1]
        made_of += self._used(tokens, None)
        self._made_of[name] = (statement.at, made_of)

    def _call(self, node: Node | None, statement: Statement) -> None:
        """A statement that is a call; None, or another expression, for one that is not understood."""
        word = node.text if node is not None and node.kind == "call" else ""
        if node is not None and word in (*MOTIONS, "set_tcp", *PAYLOADS):
            self._called_within(node)
        if node is not None and word in MOTIONS:
            self._motion(node)
        elif node is not None and word == "set_tcp":
            self._tcps[node.start] = argument(node, 0, "pose")
            self._steps.append(Step(node.start, "tcp"))
        elif node is not None and word in PAYLOADS:
            self._masses[node.start] = argument(node, 0, "m")
            self._steps.append(Step(node.start, "payload"))
        else:
            self._used(statement.tokens, statement.at)

    def _motion(self, node: Node) -> None:
        if node.text == "movec":
            pairs = [
                (argument(node, 0, "pose_via"), Motion.VIA),
                (argument(node, 1, "pose_to"), Motion.CIRCULAR),
            ]
        else:
            pairs = [(argument(node, 0, TARGETS.get(node.text, "pose")), MOTIONS[node.text])]
        mode = argument(node, 5, "mode") if node.text == "movec" else None
        for target, motion in pairs:
            if target is None:
                self.leave(node.start, "", "it has no target")
            else:
                self.motions.append(MotionCall(node.start, target, motion, _blended(node), mode))
                self._note(_of_numbers(target), node.start)
        targets = [target for target, _ in pairs]
        others = [part for part in node.parts if not any(part is target for target in targets)]
        self._note(_names(others), node.start)

    def _called_within(self, call: Node) -> None:
        """Take note of what the arguments of a call call before it."""
        for part in (part for given in call.parts for part in given.walk()):
            foreign = part.kind == "call" and part.text != "" and part.text not in HARMLESS
            if foreign or (part.kind in ("call", "name") and part.text in self._own):
                self._called(part.text, part.start, call.start)

    def _used(self, tokens: Sequence[Token], at: int | None) -> list[str]:
        """Take note of calls among `tokens`, and of the variables if `at` says where; those variables."""
        used: list[str] = []
        tokens = [token for place, token in enumerate(tokens) if not opens_pose(tokens, place)]
        texts = [token.text for token in tokens]
        skip_to = -1
        for place, token in enumerate(tokens):
            if token.kind != "name":
                continue
            if texts[place + 1 : place + 2] == ["("]:
                if texts[place - 1 : place] == ["run"]:
                    self._run.add(token.text)
                if token.text not in HARMLESS or token.text in self._own:
                    self._called(token.text, token.start, token.start)
                elif place > skip_to:
                    closing = _closing(tokens, place + 1)
                    skip_to = closing if self._own.isdisjoint(texts[place:closing]) else place
                continue
            if token.text in self._own:
                self._run.add(token.text)
                self._called(token.text, token.start, token.start)
            if place > skip_to and not _is_counted(texts[place + 1 : place + 4]):
                used.append(token.text)
        if at is not None:
            self._note(used, at)
        return used

    def _note(self, names: Iterable[str], at: int) -> None:
        """Variables are used for something else than a motion."""
        for name in names:
            self.elsewhere.setdefault(name, at)

    def _called(self, name: str, at: int, step_at: int) -> None:
        """Something is called at `at`, which is a step of the program at `step_at`."""
        if name == "interpreter_mode":
            self._scopes.doubt()
        left = WITHIN if name in MOTIONS else UNTRACKED.get(name, "")
        if left:
            self.leave(at, "", left, AIMED.get(name), blended=name in STREAMED)
        elif name in SHIFTING:
            line = self._source.place(at)[0]
            self.shifted = f"{name} in line {line} shifts it when the program runs"
        elif name == "set_tcp":
            self._tcps[at] = None
            self._steps.append(Step(at, "tcp"))
        else:
            self._steps.append(Step(step_at, "call", name))

    def _resolve(self) -> None:
        """What is only known when all was read: calls of the program's own functions, indirect uses."""
        calls = [(step.name, step.at) for step in self._steps if step.kind == "call"]
        self.constants.settle(self._scopes, self._scopes.run_alone(calls, self._run))
        own = {step.name for step in self._steps if step.kind in FUNCTIONS}
        self._steps = [step for step in self._steps if step.kind != "call" or step.name in own]
        self._break(calls)
        moved_to = dict.fromkeys(_names([motion.target for motion in self.motions]), 0)
        self._spread(moved_to, list(moved_to))
        for name, (at, _) in self._made_of.items():
            if name not in moved_to:
                self.elsewhere.setdefault(name, at)
        self._spread(self.elsewhere, list(self.elsewhere))

    def _break(self, calls: Sequence[tuple[str, int]]) -> None:
        """Where the arm may come from several places, which is not at what does not move it.

        The body of an `if` is entered from before it; what follows it, and its other branches, may not be.
        """
        at = [*self.breaks, *(one.at for one in self.motions)]
        moving = np.sort(np.concatenate([np.array(at, dtype=np.int64), self.lines.places()]))
        standing = self._scopes.standing(calls, moving)
        steps = [step for step in self._steps if step.kind not in ("tcp", "payload", "if")]
        places = np.array(
            [step.at for step in steps if step.kind != "call" or step.name in standing.moves], dtype=np.int64
        )
        self.breaks.extend(places[~standing.at(places)].tolist())

    def _spread(self, places: dict[str, int], pending: list[str]) -> None:
        """What some variables are made of is used where they are."""
        while pending:
            name = pending.pop()
            for other in self._made_of.get(name, (0, []))[1]:
                if other not in places:
                    places[other] = places[name]
                    pending.append(other)


def _blended(node: Node) -> bool:
    radius = blend_radius(node)
    if node.text in STREAMED or radius is None:
        return node.text in STREAMED
    return radius.kind != "number" or float(radius.text) != 0.0


def _names(nodes: Iterable[Node]) -> Iterator[str]:
    """Variables in expressions."""
    for node in nodes:
        yield from (part.text for part in node.walk() if part.kind == "name")


def _of_numbers(node: Node) -> Iterator[str]:
    """Variables that the numbers of poses and places in lists are computed from."""
    for part in node.walk():
        if part.kind in ("pose", "index"):
            yield from _names(part.parts[part.kind == "index" :])


def _is_counted(behind: Sequence[str]) -> bool:
    """Whether what follows a name asks for the number of its elements, as in path.length()."""
    return len(behind) == 3 and behind[0] == "." and behind[1] in COUNTING and behind[2] == "("


def _assigned_in(tokens: Sequence[Token]) -> Iterator[Token]:
    """Names, or elements of them, before a =, += or ++, but for those of arguments in closed brackets."""
    texts = [token.text for token in tokens]
    steps = [(text in "([{") - (text in ")]}") for text in texts]
    closed = sum(steps) == 0
    depth = 0
    for place, token in enumerate(tokens):
        depth += steps[place]
        if token.kind != "name" or (closed and depth > 0):
            continue
        behind = place + 1
        while texts[behind : behind + 1] == ["["] or texts[behind : behind + 1] == ["."]:
            behind = _closing(tokens, behind) + 1 if texts[behind] == "[" else behind + 2
        first, second = (*texts[behind : behind + 2], "", "")[:2]
        if first == "=" or (first in _OPERATORS and second in ("=", first)):
            yield token


def _changed_in(tokens: Sequence[Token]) -> Iterator[Token]:
    """Variables whose methods are called, as path.append(place), but for those that count their elements."""
    texts = [token.text for token in tokens]
    for place in (place for place, text in enumerate(texts) if text == "."):
        if texts[place + 2 : place + 3] != ["("] or texts[place + 1] in COUNTING:
            continue
        depth = 0
        for token in reversed(tokens[:place]):
            depth += (token.text in ")]}") - (token.text in "([{")
            if depth < 0 or (depth == 0 and token.kind == "name"):
                break
        if depth == 0 and token.kind == "name":
            yield token


def _closing(tokens: Sequence[Token], opening: int) -> int:
    """Place of the bracket that closes the one at `opening`; behind the last token if none does."""
    depth = 0
    for place in range(opening, len(tokens)):
        depth += (tokens[place].text in "([{") - (tokens[place].text in ")]}")
        if depth == 0:
            return place
    return len(tokens)
