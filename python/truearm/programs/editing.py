"""A program's texts with other numbers in them and nothing else changed."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import splice_numbers
from truearm.programs.encoding import Written
from truearm.programs.program import Program
from truearm.programs.tables import run_of

MOST_DECIMALS: Final = 400
Words = tuple[int, int, bytes]
Columns = list[NDArray[Any]]


def edited(program: Program, written: Written, inserted: Mapping[int, Sequence[Words]]) -> list[bytes]:
    """The bytes of each file of a program.

    Args:
        program: The program.
        written: Numbers to write.
        inserted: Further words by file: first byte, the byte behind the last, and what stands there.
    """
    lettered = _lettered(program)
    out = []
    for number, source in enumerate(program.sources):
        numbers, words = _in_file(program, written, number), list(inserted.get(number, ()))
        words += _recounted(program, words) if number == 0 else []
        if lettered:
            numbers, spelled = _spelled(numbers, lettered)
            words += spelled
        _, starts, ends, values, decimals = numbers
        # Words for one place keep their order: waypoints before a line follow each other.
        words.sort(key=lambda word: word[:2])
        out.append(splice_numbers(source.content, (starts, ends), values, decimals, words))
    return out


def _recounted(program: Program, words: Sequence[Words]) -> list[Words]:
    """How many lines the first file has with words in it, where it says so."""
    count, source = program.line_count, program.sources[0]
    if count is None:
        return []
    newline, (first, last) = source.newline.encode(), count.lines
    added = sum(text.count(newline) for start, _, text in words if first <= start <= last)
    stated = int(source.part(count.start, count.end))
    return [(count.start, count.end, b"%d" % (stated + added))] if added else []


def _in_file(program: Program, written: Written, number: int) -> Columns:
    """Places, starts, ends, values and decimals of the numbers of one file, in the order of its text."""
    targets, places = program.targets, run_of(written.places)
    columns: Columns = [
        written.places,
        targets.starts[places].astype(np.int32, copy=False),
        targets.ends[places].astype(np.int32, copy=False),
        np.ascontiguousarray(written.values),
        np.minimum(written.decimals, MOST_DECIMALS).astype(np.int16, copy=False),
    ]
    if len(program.sources) > 1:
        here = np.repeat(targets.source, np.diff(targets.first))[written.places] == number
        columns = [column[here] for column in columns]
    if (columns[1][1:] < columns[1][:-1]).any():
        order = np.argsort(columns[1], kind="stable")
        columns = [column[order] for column in columns]
    return columns


def _spelled(numbers: Columns, lettered: Mapping[int, tuple[str, ...]]) -> tuple[Columns, list[Words]]:
    """The numbers that are written as numbers, and words for the others."""
    in_words = np.array([int(place) in lettered for place in numbers[0]], dtype=bool)
    words = [
        (int(start), int(end), lettered[int(place)][round(value)].encode("latin-1"))
        for place, start, end, value, _ in zip(*(column[in_words] for column in numbers), strict=True)
    ]
    return [column[~in_words] for column in numbers], words


def _lettered(program: Program) -> dict[int, tuple[str, ...]]:
    """Words of the numbers that are written as words, by place."""
    found: dict[int, tuple[str, ...]] = {}
    for number, layout in enumerate(program.layouts):
        for target in np.flatnonzero(program.targets.layout == number) if layout.words else ():
            first = int(program.targets.first[target])
            found.update({first + column: known for column, known in layout.words.items()})
    return found
