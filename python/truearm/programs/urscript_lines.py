"""Motion statements of a URScript program that fill their lines: taken by the thousand, not one by one.

Lines that are equal but for their numbers are read once; their numbers come as columns.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truearm.programs.scanning import Scan
from truearm.programs.source import Source
from truearm.programs.tables import Motion
from truearm.programs.urscript_constants import AXES, RunTime
from truearm.programs.urscript_places import numbers_of
from truearm.programs.urscript_syntax import Node, NotReadable, argument, expression, statements
from truearm.types import Whole

JOINTS, POSE = 0, 1
FEW: Final = 4
MOTIONS: Final = {
    "movej": Motion.JOINT,
    "movel": Motion.LINEAR,
    "movep": Motion.LINEAR,
    "movec": Motion.CIRCULAR,
    "servoj": Motion.JOINT,
    "servoc": Motion.CIRCULAR,
}
TARGETS: Final = {"movej": "q", "servoj": "q"}
STREAMED: Final = frozenset({"servoj", "servoc"})
_RADIUS_AT: Final = {"movej": 4, "movel": 4, "movep": 3, "movec": 4, "servoc": 3}


class Columns(NamedTuple):
    """Targets, each with one motion of its own, in columns (n,) and (n, 6).

    Attributes:
        at: Offset of the statement.
        leaf: Offset of the target's bracket.
        layout: JOINTS or POSE.
        motion: A Motion.
        blended: Whether the arm does not stop.
        starts: Offsets of the numbers.
        ends: Offsets behind them.
        values: They.
        decimals: Their digits behind the point.
        factors: pi/180 for those within d2r( ), else 1.
    """

    at: Whole
    leaf: Whole
    layout: Whole
    motion: Whole
    blended: NDArray[np.bool_]
    starts: Whole
    ends: Whole
    values: NDArray[np.float64]
    decimals: Whole
    factors: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Template:
    """What a line is, numbers apart: offsets are from the line's start, places count its numbers."""

    at: int
    before_leaf: int
    layout: int
    motion: Motion
    places: tuple[int, ...]
    factors: tuple[float, ...]
    radius: int | None
    blended: bool


class Lines:
    """The lines of a text, those that are motions apart from the others."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._scan = scan = Scan(source.content)
        counts = np.bincount(scan.kind, minlength=len(scan.first_of))
        self._templates = {
            number: template
            for number in np.flatnonzero(counts >= FEW)
            if (template := self._template(int(scan.first_of[number]))) is not None
        }
        taken = np.zeros(len(scan.first_of), dtype=bool)
        taken[list(self._templates)] = True
        self._taken = taken[scan.kind]

    def rest(self) -> Iterator[tuple[int, int]]:
        """Where text begins and ends that is to be read statement by statement."""
        edges = np.flatnonzero(np.diff(self._taken, prepend=True, append=True))
        for first, last in edges.reshape(-1, 2):
            yield int(self._scan.starts[first]), int(self._scan.starts[last])

    def places(self) -> Whole:
        """Offsets of the motions that fill their lines."""
        each = [
            self._scan.starts[np.flatnonzero(self._scan.kind == number)] + template.at
            for number, template in self._templates.items()
        ]
        return np.concatenate([np.empty(0, dtype=np.int64), *each])

    def columns(self) -> Iterator[Columns]:
        """The motions that fill their lines, kind by kind."""
        for number, template in self._templates.items():
            yield self._columns(template, np.flatnonzero(self._scan.kind == number))

    def _columns(self, template: _Template, lines: Whole) -> Columns:
        numbers = self._scan.columns(lines, template.places)
        blended = np.full(len(lines), template.blended)
        if template.radius is not None:
            blended |= self._scan.columns(lines, [template.radius]).values[:, 0] != 0.0
        return Columns(
            self._scan.starts[lines] + template.at,
            numbers.starts[:, 0] - template.before_leaf,
            np.broadcast_to(template.layout, len(lines)),
            np.broadcast_to(int(template.motion), len(lines)),
            blended,
            *numbers,
            np.broadcast_to(template.factors, numbers.values.shape),
        )

    def _template(self, line: int) -> _Template | None:
        """What line number `line` is; None if it is not one whole motion with its numbers in it."""
        start, end = int(self._scan.starts[line]), int(self._scan.starts[line + 1])
        found = list(statements(self._source, start, end))
        if len(found) != 1 or found[0].word not in MOTIONS:
            return None
        try:
            call = expression(found[0].tokens)
            leaf = argument(call, 0, TARGETS.get(call.text, "pose")) if call.kind == "call" else None
            if leaf is None or leaf.kind not in ("list", "pose") or call.text == "movec" or _calls(call):
                return None
            written = numbers_of(leaf)
        except (NotReadable, RunTime):
            return None
        places = {int(at): place for place, at in enumerate(self._scan.numbers(line).starts[0])}
        if len(written) != AXES or any(number.start not in places for number in written):
            return None
        radius = blend_radius(call)
        plain = radius is not None and radius.start in places
        return _Template(
            at=found[0].at - start,
            before_leaf=written[0].start - leaf.start,
            layout=JOINTS if leaf.kind == "list" else POSE,
            motion=MOTIONS[call.text],
            places=tuple(places[number.start] for number in written),
            factors=tuple(number.factor for number in written),
            radius=places[radius.start] if radius is not None and plain else None,
            blended=call.text in STREAMED or (radius is not None and not plain),
        )


def _calls(call: Node) -> bool:
    """Whether the arguments call something, which then is a step of the program."""
    inner = (part for part in call.walk() if part is not call)
    return any(part.kind == "call" and part.text != "d2r" for part in inner)


def blend_radius(call: Node) -> Node | None:
    """The blend radius of a motion, as it is given; None if it is not."""
    return argument(call, _RADIUS_AT.get(call.text, len(call.parts)), "r")
