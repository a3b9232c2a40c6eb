"""Waypoints in a URScript program: a movel each, before a movel that states no time.

A controller drops a target whose blend radius reaches that of the target before or behind it (Script Manual,
movel), so a waypoint has a radius of its own that fits between its neighbours.
"""

import math
from collections.abc import Sequence
from typing import Final

from truearm.programs.layouts import of_joints
from truearm.programs.program import LinearStep, Program, StepTexts
from truearm.programs.source import Source
from truearm.programs.stepping import lines_before, target_of, written
from truearm.programs.urscript_lines import STREAMED, blend_radius
from truearm.programs.urscript_syntax import Node, NotReadable, argument, expression, statements
from truearm.units import RADIANS_PER_DEGREE

FILLED: Final = 0.9
"""Share of its room that the blending of a waypoint fills."""
DECIMALS_RADIUS: Final = 5


def inserted(program: Program, moves: Sequence[Sequence[LinearStep]]) -> StepTexts:
    """The motion's own line with the step in place of its target, and a blend radius."""
    return lines_before(program, moves, _line)


def blends(program: Program, move: int) -> tuple[float, float] | None:
    """Blend radii in m of the motion before a move and of its own; None where one is not a number."""
    moves = program.moves
    before = move - 1
    while not moves.moving[before]:
        before -= 1
    found = [_radius_m(program.sources[int(moves.source[one])], int(moves.at[one])) for one in (before, move)]
    first, second = found
    return None if first is None or second is None else (first, second)


def _radius_m(source: Source, at: int) -> float | None:
    calls = [
        call for call in _statements(source, source.place(at)[0]) if call is not None and call.start == at
    ]
    if not calls:
        return None
    radius = blend_radius(calls[0])
    if radius is None or calls[0].text in STREAMED:
        return 0.0
    return float(radius.text) if radius.kind == "number" else None


def _statements(source: Source, line: int) -> list[Node | None]:
    """The statements of a line; None for each that is no call, or cannot be read as one."""
    start = source.line_starts[line - 1]
    found: list[Node | None] = []
    for statement in statements(source, start, start + len(source.line_text(line))):
        try:
            node = expression(statement.tokens)
        except NotReadable:
            found.append(None)
        else:
            found.append(node if node.kind == "call" else None)
    return found


def _line(program: Program, step: LinearStep) -> str | None:
    source = program.sources[step.file]
    start = source.line_starts[step.line - 1]
    found = _statements(source, step.line)
    call = found[0] if len(found) == 1 else None
    target = argument(call, 0, "pose") if call is not None and call.text == "movel" else None
    if call is None or target is None or _states_time(call):
        return None
    scale = 10.0**DECIMALS_RADIUS
    radius = written(math.floor(FILLED * step.room_m * scale) / scale, DECIMALS_RADIUS)
    own = blend_radius(call)
    head = source.text[start : target.start] + _target(program, step)
    if own is None:
        rest = f"{source.text[target.end : call.end - 1].rstrip()}, r={radius})"
    else:
        rest = source.text[target.end : own.start] + radius + source.text[own.end : call.end]
    return head + rest + source.newline


def _target(program: Program, step: LinearStep) -> str:
    """The numbers of a step in its target's manner: degrees within d2r( ) where that has them."""
    targets, target = program.targets, target_of(program, step)
    layout = program.layouts[int(targets.layout[target])]
    numbers = list(map(written, step.values, step.decimals))
    first = int(targets.first[target])
    for place, factor in enumerate(targets.factors[first : first + len(numbers)].tolist()):
        if factor == RADIANS_PER_DEGREE:
            numbers[place] = f"d2r({numbers[place]})"
    return f"{'[' if of_joints(layout) else 'p['}{', '.join(numbers)}]"


def _states_time(call: Node) -> bool:
    time = argument(call, 3, "t")
    return time is not None and not (time.kind == "number" and float(time.text) == 0.0)
