"""The blocks of a URScript program: which function a place is in, and which blocks do not move the arm."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.programs.urscript_syntax import Statement

FUNCTIONS: Final = frozenset({"def", "thread", "sec"})
BLOCKS: Final = FUNCTIONS | {"while", "for", "if", "switch", "case", "default"}
OUTSIDE: Final = -1
"""Stands for the function that a statement outside all of them is in."""


@dataclass
class _Block:
    """A block.

    Attributes:
        word: The first word of its header.
        name: Name of a function; else empty.
        depth: How many blocks it is in.
        start: Offset of its header.
        end: Offset of its end; that of its header until that is read.
    """

    word: str
    name: str
    depth: int
    start: int
    end: int


class Scopes:
    """The blocks of a program, told statement by statement."""

    def __init__(self) -> None:
        self._open: list[_Block] = []
        self._blocks: list[_Block] = []

    def take(self, statement: Statement) -> None:
        """The next statement."""
        if statement.word in BLOCKS:
            names = statement.names if statement.word in FUNCTIONS else []
            block = _Block(statement.word, "".join(names[1:2]), len(self._open), statement.at, statement.at)
            self._open.append(block)
            self._blocks.append(block)
        elif statement.word == "end" and self._open:
            self._open.pop().end = statement.at

    @property
    def always(self) -> int | None:
        """Function whose every run takes the next statement; None within a branch or a loop."""
        if not self._open:
            return OUTSIDE
        return self._open[-1].start if self._open[-1].word in FUNCTIONS else None

    def of(self, at: int) -> int:
        """Function that an offset is in, by the offset of its header."""
        around = [one for one in self._blocks if one.word in FUNCTIONS and one.start <= at <= one.end]
        return max(around, key=lambda one: one.depth).start if around else OUTSIDE

    def run_alone(self, calls: Iterable[tuple[str, int]]) -> frozenset[int | None]:
        """Functions of which no run begins within another function's, its own included, and the outside.

        Args:
            calls: Name and offset of every call.
        """
        within = {name for name, at in calls if self.of(at) != OUTSIDE}
        functions = [one for one in self._blocks if one.word in FUNCTIONS]
        return frozenset({OUTSIDE, *(one.start for one in functions if one.name not in within)})

    def standing(self, calls: Sequence[tuple[str, int]], moving: NDArray[np.int64]) -> "Standing":
        """Where the arm stays.

        Args:
            calls: Name and offset of every call.
            moving: Offsets of all that moves the arm, ascending.
        """
        functions = [one for one in self._blocks if one.word in FUNCTIONS]
        moves = {one.name for one in functions if _holds(one, moving)}
        while True:
            at = np.sort(np.array([at for name, at in calls if name in moves], dtype=np.int64))
            more = {one.name for one in functions if _holds(one, at)} - moves
            if not more:
                break
            moves |= more
        every = np.sort(np.concatenate([moving, at]))
        still = [(one.start, one.end) for one in self._blocks if not _holds(one, every)]
        return Standing(frozenset(moves), np.array(sorted(still), dtype=np.int64).reshape(-1, 2))


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


def _holds(block: _Block, places: NDArray[np.int64]) -> bool:
    """Whether one of the offsets, ascending, is in a block."""
    return bool(np.searchsorted(places, block.start) < np.searchsorted(places, block.end, side="right"))
