"""The blocks of a URScript program: which function a place is in, and which blocks do not move the arm.

Where the blocks cannot be told for certain, nothing that depends on them is taken as known.
"""

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.programs.urscript_syntax import BLOCKS, FUNCTIONS, HEADERS, Statement

OUTSIDE: Final = -1
"""Stands for the function that a statement outside all of them is in."""
_WORDS: Final = HEADERS | {"end"}
_WITHIN: Final = {"elif": "if", "else": "if", "case": "switch", "default": "switch"}


@dataclass
class _Block:
    """A block.

    Attributes:
        word: The first word of its header.
        name: Name of a function; else empty.
        function: The function that its header stands in, as in Scopes.of.
        start: Offset of its header.
        end: Offset of its end; that of its header until that is read.
    """

    word: str
    name: str
    function: int
    start: int
    end: int


class Scopes:
    """The blocks of a program, told statement by statement."""

    def __init__(self) -> None:
        self._open: list[_Block] = []
        self._blocks: list[_Block] = []
        self._functions: dict[int, _Block] = {}
        self._edges = [OUTSIDE]
        self._inside = [OUTSIDE]
        self._doubted = False

    def take(self, statement: Statement) -> None:
        """The next statement."""
        around = self._open[-1].word if self._open else ""
        word = statement.word
        texts = [token.text for token in statement.tokens]
        opened = sum((text in "([{") - (text in ")]}") for text in texts)
        if opened or _WITHIN.get(word, around) != around or not _WORDS.isdisjoint(texts[1:]):
            self.doubt()
        if word in BLOCKS:
            self._begin(statement)
        elif word == "end" and self._open:
            self._finish(statement.at)
        elif word == "end":
            self.doubt()

    def doubt(self) -> None:
        """The program has blocks, or runs statements, that are not known."""
        self._doubted = True

    @property
    def certain(self) -> bool:
        """Whether every block has its end, as is known when all was read."""
        return not self._open and not self._doubted

    @property
    def always(self) -> int | None:
        """Function whose every run takes the next statement; None within a branch or a loop."""
        if not self._open:
            return OUTSIDE
        return self._open[-1].start if self._open[-1].word in FUNCTIONS else None

    def of(self, at: int) -> int:
        """Function that an offset is in, by the offset of its header."""
        return self._inside[bisect_right(self._edges, at) - 1]

    def run_alone(self, calls: Iterable[tuple[str, int]], run: Collection[str]) -> frozenset[int | None]:
        """Functions of which no run begins within another function's, its own included, and the outside.

        Threads are none of them: they may run several times at once.

        Args:
            calls: Name and offset of every call.
            run: Names of what is run as a thread.
        """
        if not self.certain:
            return frozenset()
        within = {name for name, at in calls if self.of(at) != OUTSIDE}.union(run)
        alone = (at for at, one in self._functions.items() if one.word == "def" and one.name not in within)
        return frozenset({OUTSIDE, *alone})

    def standing(self, calls: Sequence[tuple[str, int]], moving: NDArray[np.int64]) -> "Standing":
        """Where the arm stays: nowhere for certain if a thread may move it meanwhile.

        Args:
            calls: Name and offset of every call.
            moving: Offsets of all that moves the arm, ascending.
        """
        moves = self._moves(calls, moving)
        threads = {one.name for one in self._functions.values() if one.word != "def"}
        if not self.certain or not threads.isdisjoint(moves):
            every_name = frozenset(one.name for one in self._functions.values())
            return Standing(every_name, np.empty((0, 2), dtype=np.int64))
        at = np.array([at for name, at in calls if name in moves], dtype=np.int64)
        every = np.sort(np.concatenate([moving, at]))
        blocks = np.array([(one.start, one.end) for one in self._blocks], dtype=np.int64).reshape(-1, 2)
        first = np.searchsorted(every, blocks[:, 0])
        still = first == np.searchsorted(every, blocks[:, 1], side="right")
        return Standing(frozenset(moves), blocks[still])

    def _moves(self, calls: Iterable[tuple[str, int]], moving: NDArray[np.int64]) -> set[str]:
        """Names of the functions that move the arm, or call or hold one that does."""
        found: set[str] = set()
        above: dict[str, set[int]] = defaultdict(set)
        for name, at in calls:
            above[name].add(self.of(at))
        for one in self._functions.values():
            above[one.name].add(one.function)
        edges = np.array(self._edges, dtype=np.int64)
        pending = {self._inside[int(one) - 1] for one in np.unique(np.searchsorted(edges, moving, "right"))}
        while pending:
            at = pending.pop()
            name = self._functions[at].name if at != OUTSIDE else ""
            if at != OUTSIDE and name not in found:
                found.add(name)
                pending |= above[name]
        return found

    def _begin(self, statement: Statement) -> None:
        names = statement.names if statement.word in FUNCTIONS else []
        block = _Block(statement.word, "".join(names[1:2]), self._inside[-1], statement.at, statement.at)
        self._open.append(block)
        self._blocks.append(block)
        if statement.word in FUNCTIONS:
            self._functions[statement.at] = block
            self._turn(statement.at, statement.at)

    def _finish(self, at: int) -> None:
        block = self._open.pop()
        block.end = at
        if block.word in FUNCTIONS:
            self._turn(at + 1, block.function)

    def _turn(self, at: int, function: int) -> None:
        """From an offset on the text is in another function."""
        self._edges.append(at)
        self._inside.append(function)


@dataclass(frozen=True, eq=False)
class Standing:
    """Where the arm stays.

    Attributes:
        moves: Names of functions that move it.
        still: Offsets of the headers and ends of blocks that do not, (n, 2), ascending.
    """

    moves: frozenset[str]
    still: NDArray[np.int64]

    def at(self, places: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which offsets are in a block that does not move the arm, its header and end included, (m,)."""
        ends = np.maximum.accumulate(self.still[:, 1]) if len(self.still) else self.still[:, 1]
        last = np.searchsorted(self.still[:, 0], places, side="right") - 1
        found: NDArray[np.bool_] = (last >= 0) & (places <= np.append(ends, -1)[last])
        return found
