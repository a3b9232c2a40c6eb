"""Waypoints in a MELFA BASIC program: a Mvs each, and a variable each behind the program."""

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

from truearm.programs.layouts import of_joints
from truearm.programs.melfa_text import NAME, lines, without_remark
from truearm.programs.program import Insertion, LinearStep, Program, StepTexts
from truearm.programs.source import Source
from truearm.programs.stepping import copied, free_numbers, line_start, target_of

_PLAIN: Final = re.compile(rf"([ \t]*\d+(?=[ \t]))?([ \t]*Mvs[ \t]+){NAME}[ \t]*", re.IGNORECASE)
_LINE_NUMBER: Final = re.compile(r"[ \t]*(\d{1,9})(?=[ \t*])")
_JUMP_TO_NUMBER: Final = re.compile(r"\b(?:GoTo|GoSub|Then|Else)[ \t]*\d", re.IGNORECASE)
OF_JOINTS, OF_POSE = "J", "P"
"""What the names of variables begin with: whether one holds joints or a position follows from its name."""
_NAMING: Final = {
    letter: re.compile(rf"(?<!\w){letter}(\d{{1,9}})\b", re.IGNORECASE) for letter in (OF_JOINTS, OF_POSE)
}
LAST_LINE: Final = 32767


def inserted(program: Program, moves: Sequence[Sequence[LinearStep]]) -> StepTexts:
    """Motions before those that lead to their ends, positions behind all lines, line numbers as needed."""
    source = program.sources[0]
    plain = [_PLAIN.fullmatch(without_remark(source.line_text(steps[0].line))) for steps in moves]
    numbered = zip(moves, plain, strict=True)
    numbering = _Numbering(source, {m[0].line: len(m) for m, found in numbered if found and found.group(1)})
    free = {letter: _names(source, letter) for letter in _NAMING}
    lines: list[Insertion] = []
    positions: list[str] = []
    impossible = []
    for steps, found in zip(moves, plain, strict=True):
        numbers = numbering.before(steps[0].line) if found is not None and found.group(1) else ()
        if found is None or numbers is None:
            impossible.append(steps[0].move)
            continue
        start, stored, at = line_start(program, steps[0]), *_definition(program, source, steps[0])
        names = free[_letter(program, steps[0])]
        for place, (step, name) in enumerate(zip(steps, names, strict=False)):
            number = str(numbers[place]) if numbers else ""
            lines.append(Insertion(0, start, start, f"{number}{found.group(2)}{name}{source.newline}"))
            value = copied(program, step, stored, at).partition("=")[2]
            positions.append(f"{name}={value.strip()}{source.newline}")
    anew = numbering.anew() if lines else ()
    return StepTexts((*lines, *anew, *_behind(source, positions)), len(lines), tuple(impossible))


def _names(source: Source, letter: str) -> Iterator[str]:
    """Names that begin with a letter and that the program does not have."""
    return (f"{letter}{number}" for number in free_numbers(source, _NAMING[letter]))


def _letter(program: Program, step: LinearStep) -> str:
    """What the name of a variable begins with that holds what a move's target does."""
    layout = program.layouts[int(program.targets.layout[target_of(program, step)])]
    return OF_JOINTS if of_joints(layout) else OF_POSE


def _definition(program: Program, source: Source, step: LinearStep) -> tuple[str, int]:
    """The assignment to the variable that a move leads to, and its offset."""
    at = int(program.targets.at[target_of(program, step)])
    line, column = source.place(at)
    return without_remark(source.line_text(line))[column - 1 :], at


def _behind(source: Source, positions: Sequence[str]) -> Iterator[Insertion]:
    """Lines at the end of a file, which may lack its last line end."""
    end = len(source.text)
    if positions and not source.text.endswith(("\n", "\r")):
        yield Insertion(0, end, end, source.newline)
    for text in positions:
        yield Insertion(0, end, end, text)


class _Numbering:
    """Line numbers of a program that lines are inserted into."""

    def __init__(self, source: Source, wanted: dict[int, int]) -> None:
        """Lines, from 1, before which so many others are wanted."""
        texts = list(lines(source))
        numbered = {n: found for n, (_, text) in enumerate(texts, 1) if (found := _LINE_NUMBER.match(text))}
        self._lines = list(numbered)
        self._spans = [(texts[n - 1][0] + found.start(1), found.group(1)) for n, found in numbered.items()]
        self._wanted = [wanted.get(line, 0) for line in self._lines]
        stated = [int(number) for _, number in self._spans]
        self._ascending = all(first < second for first, second in pairwise(stated))
        between = [number - before - 1 for before, number in pairwise([0, *stated])]
        fits = all(room >= some for room, some in zip(between, self._wanted, strict=True))
        self._jumps = any(_JUMP_TO_NUMBER.search(without_remark(text)) for _, text in texts)
        self._numbers = stated if fits or not self._ascending else self._renumbered(stated)

    def before(self, line: int) -> Sequence[int] | None:
        """Numbers for the lines before a line; None where there are none."""
        if not self._ascending or self._numbers is None or line not in self._lines:
            return None
        place = self._lines.index(line)
        behind = self._numbers[place]
        first = self._numbers[place - 1] if place else 0
        step = (behind - first) // (self._wanted[place] + 1)
        return [first + step * (one + 1) for one in range(self._wanted[place])]

    def anew(self) -> Iterator[Insertion]:
        """What the lines that there are are numbered now, where that changes."""
        for (at, stated), number in zip(self._spans, self._numbers or (), strict=False):
            if int(stated) != number:
                yield Insertion(0, at, at + len(stated), str(number))

    def _renumbered(self, stated: Sequence[int]) -> list[int] | None:
        """Numbers with room for all, in the step that the program begins with; None if jumps tell numbers."""
        step = max(stated[1] - stated[0], 1) if len(stated) > 1 else 1
        total = len(stated) + sum(self._wanted)
        step = step if stated[0] + step * total <= LAST_LINE else 1
        if self._jumps or stated[0] + step * total > LAST_LINE:
            return None
        numbers, number = [], stated[0] - step
        for some in self._wanted:
            number += step * (some + 1)
            numbers.append(number)
        return numbers
