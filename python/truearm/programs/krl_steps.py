"""Waypoints in a KRL program: a LIN or SLIN each, before a motion that states nothing but its target."""

import re
from collections.abc import Sequence
from typing import Final

from truearm.programs.krl_storage import HEADER, lines
from truearm.programs.krl_values import line_reader, operands
from truearm.programs.krl_words import LINE_BLENDING, MOTIONS, SPLINE_ENDS, SPLINES
from truearm.programs.layouts import DECIMALS_DEG, DECIMALS_MM, of_pose
from truearm.programs.program import LinearStep, Program, StepTexts
from truearm.programs.source import Source
from truearm.programs.stepping import lines_before, target_of

PASSED: Final = {"lin": "C_DIS", "slin": "C_SPL"}
"""How the arm passes a waypoint, by the word of the motion."""
WORD: Final = re.compile(r"[\w$]+")
AHEAD: Final = frozenset({"trigger", "stop", "const_vel", "time_block", "interrupt", "global"})
"""The first word of a statement that belongs to the motion behind it; "global" as of an interrupt."""


def inserted(program: Program, moves: Sequence[Sequence[LinearStep]]) -> StepTexts:
    """The lines before those of their motions."""
    files = {steps[0].file for steps in moves}
    plain = {file: _plain(program.sources[file], _wanted(moves, file)) for file in files}

    def line_of(program: Program, step: LinearStep) -> str | None:
        posed = of_pose(program.layouts[int(program.targets.layout[target_of(program, step)])])
        return _line(program.sources[step.file], step) if posed and step.line in plain[step.file] else None

    return lines_before(program, moves, line_of)


def _wanted(moves: Sequence[Sequence[LinearStep]], file: int) -> set[int]:
    return {steps[0].line for steps in moves if steps[0].file == file}


def _line(source: Source, step: LinearStep) -> str:
    text = source.line_text(step.line)
    indent = text[: len(text) - len(text.lstrip())]
    word = text.split(maxsplit=1)[0]
    parts = ",".join(
        f"{name} {value:.{max(decimals, least)}f}"
        for name, value, decimals, least in zip(
            "XYZABC",
            step.values[:6],
            step.decimals[:6],
            (DECIMALS_MM,) * 3 + (DECIMALS_DEG,) * 3,
            strict=True,
        )
    )
    return f"{indent}{word.upper()} {{{parts}}} {PASSED[word.lower()]}{source.newline}"


def _plain(source: Source, wanted: set[int]) -> set[int]:
    """Lines among those wanted that are motions of a target alone, and not part of something else."""
    found: set[int] = set()
    folds: list[bool] = []
    in_spline = belongs = False
    for number, (start, end) in enumerate(lines(source), start=1):
        text = source.text[start:end].strip().lower()
        begins = WORD.match(text)
        word = "" if begins is None else begins.group()
        if text.startswith(";fold"):
            folds.append(not MOTIONS.keys().isdisjoint(WORD.findall(text)))
        elif text.startswith(";endfold"):
            del folds[-1:]
        elif HEADER.match(text):
            folds.clear()
            in_spline = belongs = False
        elif word in SPLINES or word == SPLINE_ENDS:
            in_spline, belongs = word in SPLINES, False
        elif word in AHEAD:
            belongs = True
        elif word in MOTIONS:
            if number in wanted and not (in_spline or belongs or any(folds)) and _alone(source, start, end):
                found.add(number)
            belongs = False
    return found


def _alone(source: Source, start: int, end: int) -> bool:
    """Whether a line is the word of a straight motion, a target, and how it is blended."""
    reader = line_reader(source, start, end)
    if reader.take().text.lower() not in PASSED or operands(reader) is None:
        return False
    return all(token.text.lower() in LINE_BLENDING for token in reader.rest())
