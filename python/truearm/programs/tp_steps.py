"""Waypoints in a FANUC listing: a motion line each in /MN, and a position each in /POS."""

import re
from collections.abc import Sequence
from typing import Final

from truearm.programs.program import Insertion, LinearStep, Program, StepTexts
from truearm.programs.stepping import copied, free_numbers, line_start, target_of
from truearm.programs.tp_positions import position_text, section

_PLAIN: Final = re.compile(
    r"[ \t]*\d*[ \t]*:[ \t]*(L[ \t]+)P\[[^\]]*\]"
    r"([ \t]*(?:\d+\.?\d*|R\[[^\]]*\])[ \t]*(?:mm/sec|cm/min|inch/min|deg/sec)[ \t]+)"
    r"(FINE|CNT[ \t]*\d+)((?:[ \t]+(?:ACC[ \t]*\d+|Wjnt|PTH))*[ \t]*;)[ \t]*",
    re.IGNORECASE,
)
"""A motion that can be repeated: it states a speed, not a time, and nothing that is done on the way."""
_NUMBER: Final = re.compile(r"\bP\[\s*(\d{1,9})\b")
_STOPS: Final = re.compile(r"FINE|CNT[ \t]*0+\Z", re.IGNORECASE)
PASSED: Final = "CNT100"


def inserted(program: Program, moves: Sequence[Sequence[LinearStep]]) -> StepTexts:
    """Lines without numbers before the motions, and positions with numbers that are free."""
    source = program.sources[0]
    free = free_numbers(source, _NUMBER)
    lines: list[Insertion] = []
    positions: list[str] = []
    impossible = []
    for steps in moves:
        plain = _PLAIN.fullmatch(source.line_text(steps[0].line))
        at = int(program.targets.at[target_of(program, steps[0])])
        stored = position_text(source, at)
        if plain is None or stored is None:
            impossible.append(steps[0].move)
            continue
        motion, speed, ending, options = plain.groups()
        passed = PASSED if _STOPS.match(ending) is not None else ending
        start = line_start(program, steps[0])
        for step, number in zip(steps, free, strict=False):
            text = f"    :{motion}P[{number}]{speed}{passed}{options}{source.newline}"
            lines.append(Insertion(0, start, start, text))
            body = copied(program, step, stored, at).partition("]")[2]
            positions.append(f"P[{number}]{body}{source.newline}")
    end = section(source, "POS")[1]
    behind = [Insertion(0, end, end, text) for text in positions]
    return StepTexts((*lines, *behind), len(lines), tuple(impossible))
