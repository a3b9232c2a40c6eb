"""The lines of a text, those that are equal but for their numbers as one kind, and numbers in columns."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truearm._core import read_numbers, scan_lines
from truearm.types import Whole


class NumberColumns(NamedTuple):
    """Numbers of lines, in columns (n, k).

    Attributes:
        starts: Offset of the first character, the sign included.
        ends: Offset behind the last one.
        values: What they say.
        decimals: Digits behind the point.
    """

    starts: NDArray[np.int32]
    ends: NDArray[np.int32]
    values: NDArray[np.float64]
    decimals: NDArray[np.int16]


class Scan:
    """A text as its lines.

    Attributes:
        starts: Offset of each line, and the length of the text, (l + 1,).
        kind: For each line which of the different lines it is, numbers apart, (l,).
        first_of: For each kind the first line of it, (k,).
    """

    def __init__(self, content: bytes) -> None:
        self._content = content
        self.starts, self.kind, self.first_of, self._first_number, self._numbers = scan_lines(content)

    def numbers(self, line: int) -> NumberColumns:
        """All numbers of a line, (1, k)."""
        return self._read(self._numbers[None, self._first_number[line] : self._first_number[line + 1]])

    def columns(self, lines: Whole, places: Sequence[int]) -> NumberColumns:
        """The numbers at some places, counted from 0 in each line, of lines (n,) of one kind."""
        first, last = int(lines[0]), int(lines[-1]) + 1
        start, stop = places[0], places[0] + len(places)
        if last - first == len(lines) and list(places) == list(range(start, stop)):
            whole = self._numbers[self._first_number[first] : self._first_number[last]]
            return self._read(whole.reshape(len(lines), -1)[:, start:stop])
        return self._read(self._numbers[self._first_number[lines][:, None] + np.array(places)])

    def _read(self, starts: NDArray[np.int32]) -> NumberColumns:
        starts = np.ascontiguousarray(starts)
        return NumberColumns(starts, *read_numbers(self._content, starts))
