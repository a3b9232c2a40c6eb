"""With which TCP and payload each part of a URScript program runs, where that is certain.

The program is walked as it may run: both ways at branches, loops until nothing changes, functions from
wherever they are called. What differs between two ways to the same place is not known there.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

from truearm.programs.environment import Frame
from truearm.programs.urscript_syntax import BLOCKS, CHAINED, FUNCTIONS, LOOPS

_ROUNDS: Final = 8
_DEEPEST_BLOCKS: Final = 20
_DEEPEST_CALLS: Final = 12
UNSURE: Final = Frame.missing("which TCP is set here depends on how the program runs")


class Step(NamedTuple):
    """A statement that matters.

    Attributes:
        at: Offset of it.
        kind: A header's word, "end", "return", "break", "continue", "tcp", "payload" or "call".
        name: Name of the function that is defined or called.
        tool: The TCP that is set.
        payload_kg: The payload that is set; None if it is not a constant.
    """

    at: int
    kind: str
    name: str = ""
    tool: Frame | None = None
    payload_kg: float | None = None


@dataclass(frozen=True, eq=False)
class State:
    """What is set."""

    tool: Frame
    payload_kg: float | None = None

    def same_as(self, other: "State") -> bool:
        """Whether nothing differs."""
        return self.tool.key == other.tool.key and self.payload_kg == other.payload_kg


@dataclass
class _Block:
    """Steps in order and blocks among them; of an if also its other branches."""

    header: Step
    items: "list[Step | _Block]" = field(default_factory=list)
    branches: "list[_Block]" = field(default_factory=list)

    @property
    def last(self) -> "_Block":
        """The branch that is being written."""
        return self.branches[-1] if self.branches else self


@dataclass
class _Ways:
    """States that leave a block otherwise than at its end."""

    breaks: list[State] = field(default_factory=list)
    continues: list[State] = field(default_factory=list)
    returns: list[State] = field(default_factory=list)


def states(steps: Sequence[Step], start: State) -> dict[int, State]:
    """State behind each step that can be reached, by the step's offset.

    Args:
        steps: The steps in the order of the text.
        start: What is set when the program begins.
    """
    root, functions = _blocks(steps)
    called = {step.name for step in steps if step.kind == "call"}
    walker = _Walker(functions)
    for _ in range(_ROUNDS):
        before = dict(walker.entries)
        walker.walked.clear()
        walker.run(root, start, _Ways())
        for name in functions:
            if name not in called:
                walker.call(name, start)
        if all(name in before and before[name].same_as(s) for name, s in walker.entries.items()):
            break
    return walker.found


def _blocks(steps: Iterable[Step]) -> tuple[_Block, dict[str, _Block]]:
    """The nested blocks, and those of functions by name; an end too many and a missing one are nothing."""
    root = _Block(Step(-1, "program"))
    functions: dict[str, _Block] = {}
    stack = [root]
    for step in steps:
        top = stack[-1]
        if step.kind == "end":
            if len(stack) > 1:
                stack.pop()
                stack[-1].last.items.append(step)
        elif step.kind in CHAINED:
            top.branches.append(_Block(step))
        elif step.kind in BLOCKS:
            block = _Block(step)
            if step.kind in FUNCTIONS:
                functions[step.name] = block
            elif len(stack) < _DEEPEST_BLOCKS:
                top.last.items.append(block)
            stack.append(block)
        else:
            top.last.items.append(step)
    return root, functions


class _Walker:
    """Walks blocks and keeps what it finds.

    Attributes:
        found: State behind each step, by offset.
        entries: What is set where a function is called from, by name.
        walked: With what each function was walked, and what it left, by name: once for all calls alike.
    """

    def __init__(self, functions: dict[str, _Block]) -> None:
        self.found: dict[int, State] = {}
        self.entries: dict[str, State] = {}
        self.walked: dict[str, tuple[State, State]] = {}
        self._functions = functions
        self._setting = _setting(functions)
        self._inside: list[str] = []

    def call(self, name: str, state: State) -> State:
        """The state behind a call of a function."""
        self.entries[name] = entry = _merged([self.entries.get(name, state), state]) or state
        if name in self._inside or len(self._inside) >= _DEEPEST_CALLS:
            return replace(state, tool=UNSURE, payload_kg=None) if name in self._setting else state
        if name not in self.walked or not self.walked[name][0].same_as(entry):
            self._inside.append(name)
            ways = _Ways()
            left = self.run(self._functions[name], entry, ways)
            self._inside.pop()
            self.walked[name] = entry, _merged([left, *ways.returns]) or state
        return self.walked[name][1] if name in self._setting else state

    def run(self, block: _Block, state: State, ways: _Ways) -> State | None:
        """The state at the end of a block; None if the end is not reached."""
        self.found[block.header.at] = state
        now: State | None = state
        for item in block.items:
            if now is None:
                break
            if isinstance(item, _Block):
                now = self._nested(item, now, ways)
                continue
            now = self._step(item, now, ways)
            if now is not None:
                self.found[item.at] = now
        return now

    def _nested(self, block: _Block, state: State, ways: _Ways) -> State | None:
        if block.header.kind in LOOPS:
            return self._loop(block, state, ways)
        ends = [self.run(branch, state, ways) for branch in (block, *block.branches)]
        if not any(branch.header.kind == "else" for branch in block.branches):
            ends.append(state)
        return _merged(ends)

    def _loop(self, block: _Block, state: State, ways: _Ways) -> State | None:
        head = state
        while True:
            inner = _Ways(returns=ways.returns)
            left = self.run(block, head, inner)
            again = _merged([head, left, *inner.continues]) or head
            if again.same_as(head):
                return _merged([head, *inner.breaks])
            head = again

    def _step(self, step: Step, state: State, ways: _Ways) -> State | None:
        if step.kind == "tcp":
            return replace(state, tool=step.tool or UNSURE)
        if step.kind == "payload":
            return replace(state, payload_kg=step.payload_kg)
        if step.kind == "call" and step.name in self._functions:
            return self.call(step.name, state)
        left = {"break": ways.breaks, "continue": ways.continues, "return": ways.returns}.get(step.kind)
        if left is None:
            return state
        left.append(state)
        return None


def _setting(functions: dict[str, _Block]) -> set[str]:
    """Functions that set something, or call one that does."""
    found: set[str] = set()
    pending: set[str] = set()
    above: dict[str, set[str]] = defaultdict(set)
    for name, block in functions.items():
        for step in _steps(block):
            if step.kind in ("tcp", "payload"):
                pending.add(name)
            above[step.name].add(name)
    while pending:
        name = pending.pop()
        found.add(name)
        pending |= above[name] - found
    return found


def _steps(block: _Block) -> Iterator[Step]:
    pending = [block]
    while pending:
        one = pending.pop()
        pending += one.branches
        for item in one.items:
            if isinstance(item, _Block):
                pending.append(item)
            else:
                yield item


def _merged(ways: Iterable[State | None]) -> State | None:
    """What is certain where several states meet; None if none of them gets there."""
    reached = [state for state in ways if state is not None]
    if not reached:
        return None
    first = reached[0]
    alike = all(state.tool.key == first.tool.key for state in reached)
    payload = first.payload_kg if all(s.payload_kg == first.payload_kg for s in reached) else None
    return State(first.tool if alike else UNSURE, payload)
