"""Targets and moves of a program, in columns: 100,000 of them are a few arrays.

A target is numbers in the text, stored under a name or written in a motion statement; a move uses one.
"""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truearm.types import Floats, Integers, Whole

ABSENT_AT: Final = -1
NOWHERE: Final = -1
"""Stands for a target where it is not known at which one the arm is."""


def run_of(rows: Integers) -> slice | Integers:
    """Rows that follow one another as a slice, which copies nothing; others as they are."""
    count = len(rows)
    if count > 0 and rows[-1] - rows[0] == count - 1 and bool((rows[1:] > rows[:-1]).all()):
        return slice(int(rows[0]), int(rows[0]) + count)
    return rows


def placed(column: Floats, rows: slice | Integers, values: Floats) -> Floats:
    """A column with `values` in some rows: changed in place unless it may not be, or has no other rows."""
    if isinstance(rows, slice) and rows == slice(0, len(column)):
        return values
    if not column.flags.writeable:
        column = np.array(column)
    column[rows] = values
    return column


def all_ones(factors: Floats) -> bool:
    """Whether all factors are one; where one stands for them all only that is looked at."""
    looked_at = factors if any(factors.strides) else factors.reshape(-1)[:1]
    return bool((looked_at == 1.0).all())


class Motion(IntEnum):
    """How a move reaches its target; the last two do not move there.

    Attributes:
        JOINT: Joint by joint.
        LINEAR: On a straight line.
        VIA: On an arc that goes on behind it; its position counts, how it is turned as Via tells.
        CIRCULAR: At the end of an arc.
        SEED: A solution near these readings is taken for the target of the next move.
        BESIDE: It only shapes a path that ends elsewhere, as the centre of an arc does.
    """

    JOINT = 0
    LINEAR = 1
    VIA = 2
    CIRCULAR = 3
    SEED = 4
    BESIDE = 5


class Via(IntEnum):
    """What an arc turns the tool by where it passes its via point.

    Attributes:
        BETWEEN: Its start and its end, evenly, whatever the via point states.
        ON_PATH: The same, evenly in a frame that goes round with the path.
        OPEN: The same, but how far or which way round is not followed.
        UNTOLD: Perhaps what the via point states.
    """

    BETWEEN = 0
    ON_PATH = 1
    OPEN = 2
    UNTOLD = 3


class Number(NamedTuple):
    """A number in the text.

    Attributes:
        start: Offset of its first character, the sign included.
        end: Offset behind its last one.
        value: What the text says, before `factor`.
        decimals: Digits behind the point.
        factor: What makes of it a number in the layout's unit, such as pi/180 within d2r( ).
    """

    start: int
    end: int
    value: float
    decimals: int
    factor: float = 1.0


ABSENT: Final = Number(ABSENT_AT, ABSENT_AT, float("nan"), 0)


@dataclass(frozen=True, eq=False)
class Targets:
    """All targets: (t,) columns and, in order, the numbers of all of them, (s,) columns.

    Attributes:
        source: Number of the file.
        at: Offset of the target's name or opening bracket.
        layout: Number of its layout.
        first: Where its numbers begin, (t + 1,).
        starts: Offset of each number; ABSENT_AT for one that is not written.
        ends: Offset behind each number.
        values: The numbers as they are written; NaN where they are not.
        decimals: Digits behind the point.
        factors: What makes of them numbers in the layout's units.
        names: Names of the targets that have one, by number.
    """

    source: Integers
    at: Integers
    layout: Integers
    first: Integers
    starts: Whole
    ends: Whole
    values: Floats
    decimals: Whole
    factors: Floats
    names: dict[int, str]

    def __len__(self) -> int:
        return len(self.source)

    def numbers(self, which: Integers, width: int) -> Integers:
        """Places of the numbers of targets `which` (n,) of one layout, (n, width)."""
        span = self._span(which, width)
        if span is not None:
            return np.arange(span.start, span.stop).reshape(-1, width)
        return self.first[which][:, None] + np.arange(width)

    def of(self, column: NDArray[Any], which: Integers, width: int) -> NDArray[Any]:
        """A column of the numbers of targets `which` (n,) of one layout, (n, width); a view if it can be."""
        span = self._span(which, width)
        found: NDArray[Any] = (
            column[self.numbers(which, width)] if span is None else column[span].reshape(-1, width)
        )
        return found

    def _span(self, which: Integers, width: int) -> slice | None:
        """Where the numbers of targets stand that follow one another; None where others are between them."""
        run = run_of(which)
        if not isinstance(run, slice):
            return None
        start, stop = int(self.first[run.start]), int(self.first[run.stop])
        return slice(start, stop) if stop - start == len(which) * width else None


@dataclass(frozen=True, eq=False)
class Moves:
    """All uses of targets in the order of the text, (m,) columns.

    Attributes:
        target: Number of the target.
        source: Number of the file of the statement.
        at: Offset of the statement.
        motion: A Motion.
        blended: Whether the arm does not stop at the target.
        environment: Number of the environment.
        follows: Whether the move before, in this table, is the one executed before: False behind labels,
            at the heads of loops and behind branches, where the arm may come from several places.
        over: Where it is not, whether only lines and arcs to places without numbers are executed between;
            None where that is nowhere known.
    """

    target: Integers
    source: Integers
    at: Integers
    motion: Integers
    blended: NDArray[np.bool_]
    environment: Integers
    follows: NDArray[np.bool_]
    over: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.target)

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """Which of them move the arm to their target, (m,)."""
        return self.motion < Motion.SEED

    @cached_property
    def before(self) -> Integers:
        """Target that the arm stands at before each, (m,): that of the last move; NOWHERE if not known."""
        last = self._last(self.follows)
        return np.where(last == NOWHERE, NOWHERE, self.target[last])

    @cached_property
    def previous(self) -> Integers:
        """The last move before each, (m,), if it follows that or comes over lines and arcs; else NOWHERE."""
        return self._last(self.follows if self.over is None else self.follows | self.over)

    def _last(self, linked: NDArray[np.bool_]) -> Integers:
        """The last move before each that moves the arm, (m,), if it is `linked` (m,) to it; else NOWHERE."""
        moved = np.flatnonzero(self.moving)
        places = np.searchsorted(moved, np.arange(len(self))) - 1
        known = places >= 0
        last = moved[places[known]]
        breaks = np.cumsum(~linked)
        found = np.full(len(self), NOWHERE, dtype=np.int64)
        found[known] = np.where(breaks[last] == breaks[known], last, NOWHERE)
        return found

    @cached_property
    def near(self) -> Integers:
        """Target whose readings the solution for each is looked for near, (m,): a seed right before it in
        the same statement, otherwise where the arm stands; NOWHERE if that is not known.
        """
        found = np.array(self.before)
        seeded = np.flatnonzero(self.motion[:-1] == Motion.SEED) + 1
        found[seeded] = self.target[seeded - 1]
        return found


class TargetTable:
    """Collects targets, one by one or many at once."""

    def __init__(self) -> None:
        self._columns = [_Column(code) for code in "iqi"]
        self._counts = _Column("i")
        self._numbers = [_Column(code) for code in "qqdid"]
        self._names: dict[int, str] = {}
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, source: int, at: int, layout: int, numbers: Sequence[Number], name: str = "") -> int:
        """Add a target; its number. `numbers` are those of the layout, ABSENT where not written."""
        for column, value in zip(self._columns, (source, at, layout), strict=True):
            column.append(value)
        self._counts.append(len(numbers))
        for number in numbers:
            for column, part in zip(self._numbers, number, strict=True):
                column.append(part)
        if name:
            self._names[self._count] = name
        self._count += 1
        return self._count - 1

    def extend(self, source: int, at: Integers, layout: int, numbers: Sequence[NDArray[Any]]) -> Integers:
        """Add n targets without names; their numbers.

        Args:
            source: Their file.
            at: Their offsets, (n,).
            layout: Their layout.
            numbers: Columns starts, ends, values, decimals and factors, (n, width) each.
        """
        count, width = len(at), numbers[0].shape[1]
        for column, value in zip(
            self._columns, (np.full(count, source), at, np.full(count, layout)), strict=True
        ):
            column.extend(value)
        self._counts.extend(np.full(count, width))
        for column, value in zip(self._numbers, numbers, strict=True):
            column.extend(np.ascontiguousarray(value).reshape(-1))
        self._count += count
        return np.arange(self._count - count, self._count)

    def freeze(self) -> Targets:
        """The columns."""
        first = np.concatenate([[0], np.cumsum(self._counts.whole(np.int64))])
        source, at, layout = (column.whole(np.int64) for column in self._columns)
        starts, ends, values, decimals, factors = (column.whole(None) for column in self._numbers)
        return Targets(
            source,
            at,
            layout,
            first.astype(np.int64),
            starts,
            ends,
            values.astype(np.float64, copy=False),
            decimals,
            factors.astype(np.float64, copy=False),
            self._names,
        )


class MoveTable:
    """Collects moves, one by one or many at once."""

    def __init__(self) -> None:
        self._columns = [_Column(code) for code in "qiqbbib"]
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(
        self,
        target: int,
        place: tuple[int, int],
        motion: Motion,
        *,
        environment: int,
        blended: bool = False,
        follows: bool = True,
    ) -> None:
        """Add a move to a target; `place` is the file and the offset of the statement."""
        row = (target, *place, int(motion), int(blended), environment, int(follows))
        for column, value in zip(self._columns, row, strict=True):
            column.append(value)
        self._count += 1

    def extend(self, columns: Sequence[NDArray[Any]]) -> None:
        """Add n moves: columns target, source, at, motion, blended, environment and follows, (n,) each."""
        for column, values in zip(self._columns, columns, strict=True):
            column.extend(values)
        self._count += len(columns[0])

    def freeze(self) -> Moves:
        """The columns."""
        target, source, at, motion, blended, environment, follows = (
            column.whole(np.int64) for column in self._columns
        )
        return Moves(target, source, at, motion, blended.astype(bool), environment, follows.astype(bool))


class _Column:
    """A growing column: single values are gathered compactly, arrays are kept as they are."""

    def __init__(self, code: str) -> None:
        self._code = code
        self._pending = array(code)
        self._chunks: list[NDArray[Any]] = []

    def append(self, value: float) -> None:
        self._pending.append(value)  # type: ignore[arg-type]

    def extend(self, values: NDArray[Any]) -> None:
        self._flush()
        self._chunks.append(values)

    def whole(self, kind: type | None) -> NDArray[Any]:
        self._flush()
        if not self._chunks:
            return np.empty(0, dtype=kind or np.dtype(self._code))
        joined = self._chunks[0] if len(self._chunks) == 1 else np.concatenate(self._chunks)
        return joined if kind is None else joined.astype(kind, copy=False)

    def _flush(self) -> None:
        if self._pending:
            self._chunks.append(np.array(self._pending))
            self._pending = array(self._code)
