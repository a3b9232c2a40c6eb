"""How waypoints on a straight line are put in words, as far as languages have it in common."""

import re
from collections.abc import Callable, Iterator, Sequence
from itertools import count

import numpy as np

from truearm._core import splice_numbers
from truearm.programs.program import Insertion, LinearStep, Program, StepTexts
from truearm.programs.source import Source
from truearm.programs.tables import ABSENT_AT


def lines_before(
    program: Program,
    moves: Sequence[Sequence[LinearStep]],
    line_of: Callable[[Program, LinearStep], str | None],
) -> StepTexts:
    """Waypoints that are a line each, before the line of their move.

    Args:
        program: The program.
        moves: The waypoints of each move.
        line_of: The line of a waypoint, line end included; None if its move cannot be repeated.
    """
    insertions: list[Insertion] = []
    impossible = []
    for steps in moves:
        lines = [line_of(program, step) for step in steps]
        told = [line for line in lines if line is not None]
        if len(told) < len(steps):
            impossible.append(steps[0].move)
            continue
        at = line_start(program, steps[0])
        insertions += [Insertion(steps[0].file, at, at, line) for line in told]
    return StepTexts(tuple(insertions), len(insertions), tuple(impossible))


def line_start(program: Program, step: LinearStep) -> int:
    """Offset of the line of a waypoint's move."""
    return program.sources[step.file].line_starts[step.line - 1]


def target_of(program: Program, step: LinearStep) -> int:
    """Number of the target that a waypoint's move leads to."""
    return int(program.moves.target[step.move])


def free_numbers(source: Source, naming: re.Pattern[str]) -> Iterator[int]:
    """Numbers from 1 that a program names no position by; the first group of `naming` is such a number."""
    named = {int(found.group(1)) for found in naming.finditer(source.text)}
    return (number for number in count(1) if number not in named)


def written(value: float, decimals: int) -> str:
    """A number with so many digits behind the point, never a negative zero."""
    return f"{np.round(value, decimals) + 0.0:.{decimals}f}"


def copied(program: Program, step: LinearStep, text: str, at: int) -> str:
    """The text of a target, which begins at offset `at`, with the numbers of a waypoint in their places."""
    targets, target = program.targets, target_of(program, step)
    known = program.layouts[int(targets.layout[target])].words
    columns = np.arange(len(step.values))
    places = int(targets.first[target]) + columns
    starts, ends = targets.starts[places] - at, targets.ends[places] - at
    stated = targets.starts[places] != ABSENT_AT
    spelled = [
        (int(starts[column]), int(ends[column]), known[column][round(step.values[column])].encode("latin-1"))
        for column in columns[stated].tolist()
        if column in known
    ]
    plain = columns[stated & ~np.isin(columns, list(known))]
    plain = plain[np.argsort(starts[plain])]
    return splice_numbers(
        text.encode("latin-1"),
        (starts[plain].astype(np.int32), ends[plain].astype(np.int32)),
        np.array(step.values)[plain],
        np.array(step.decimals, dtype=np.int16)[plain],
        sorted(spelled),
    ).decode("latin-1")
