"""Tables of a URScript program's targets and moves, with what TCP and offsets each is gone to."""

from array import array
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.programs.environment import Environment
from truearm.programs.frames import Frames
from truearm.programs.program import motion_is_straight
from truearm.programs.source import Source
from truearm.programs.tables import Motion, Moves, Number, Targets
from truearm.programs.urscript_collect import Collected, MotionCall
from truearm.programs.urscript_constants import AXES, RunTime
from truearm.programs.urscript_flow import UNSURE, State, states
from truearm.programs.urscript_lines import JOINTS, POSE, Columns
from truearm.programs.urscript_places import Place, Places, numbers_of
from truearm.types import Integers

ALSO_A_FRAME: Final = "it is also an offset, or a frame, of another target"
TURNED_ALONG: Final = (
    "with mode=1 (fixed orientation) movec heeds its position alone and turns the tool along with the arc: "
    "with mode=0 the tool turns to what is written"
)
PERHAPS_ALONG: Final = (
    "movec has a mode that is computed when the program runs, or not known, and may heed its position alone: "
    "with mode=0 the tool turns to what is written"
)


@dataclass
class _Leaves:
    """Targets of the motions that are no lines of their own, in columns."""

    at: "array[int]" = field(default_factory=lambda: array("q"))
    layout: "array[int]" = field(default_factory=lambda: array("b"))
    numbers: "list[array[float]]" = field(default_factory=lambda: [array(code) for code in "qqdqd"])
    names: dict[int, str] = field(default_factory=dict)
    known: dict[int, int] = field(default_factory=dict)

    def number(self, place: Place) -> int:
        """Number of the target at a place; a new one is added.

        Raises:
            RunTime: If its numbers are written otherwise.
        """
        start = place.leaf.start
        if start not in self.known:
            for number in numbers_of(place.leaf):
                for column, value in zip(self.numbers, _row(number), strict=True):
                    column.append(value)
            self.known[start] = len(self.at)
            self.at.append(start)
            self.layout.append(JOINTS if place.is_joints else POSE)
        if place.name:
            self.names.setdefault(self.known[start], place.name)
        return self.known[start]


@dataclass
class _Rows:
    """Uses of these targets, in columns: target, offset, motion, blended, environment, alone."""

    columns: "list[array[int]]" = field(default_factory=lambda: [array(code) for code in "qqbbqb"])

    def add(self, *row: int) -> None:
        """One more."""
        for column, value in zip(self.columns, row, strict=True):
            column.append(value)


class Reader:
    """One program.

    Attributes:
        found: TCPs, payloads and offsets that motions have, and what is left as it is.
    """

    def __init__(self, source: Source, frames: Frames) -> None:
        self._collected = Collected(source)
        self.found = self._collected.found
        self._source = source
        steps = list(self._collected.steps(frames))
        unknown = {step.at: State(UNSURE) for step in steps}
        flow = unknown | states(steps, State(self._collected.installed(frames)))
        self._offsets = np.array(sorted(flow), dtype=np.int64)
        self._states = [flow[int(at)] for at in self._offsets]
        self._leaves = _Leaves()
        self._rows = _Rows()
        self._along: dict[int, str] = {}
        self._slow()

    def tables(self) -> tuple[Targets, Moves]:
        """All targets and moves, in the order of the text."""
        lines = list(self._collected.lines.columns())
        count = sum(len(columns.at) for columns in lines)
        leaves, rows = self._leaves, self._rows.columns
        leaf = _joined([c.leaf for c in lines], leaves.at)
        order = _order(leaf)
        rank = np.arange(len(leaf))
        rank[order] = np.arange(len(leaf))
        starts, ends, values, decimals = (
            _rows_joined([column[place] for column in lines], own)[order].reshape(-1)
            for place, own in enumerate(leaves.numbers[:-1], start=Columns._fields.index("starts"))
        )
        targets = Targets(
            source=np.broadcast_to(0, len(leaf)),
            at=leaf[order],
            layout=_joined([c.layout for c in lines], leaves.layout)[order].astype(np.int64, copy=False),
            first=AXES * np.arange(len(leaf) + 1),
            starts=starts,
            ends=ends,
            values=values,
            decimals=decimals,
            factors=_factors([c.factors for c in lines], leaves.numbers[-1], order),
            names={int(rank[count + number]): name for number, name in leaves.names.items()},
        )
        for start in self._along.keys() & leaves.known.keys():
            number = int(rank[count + leaves.known[start]])
            self.found.keep([number], self._along[start])
            self.found.unsure.add(number)
        own = rank[count + np.array(rows[0], dtype=np.int64)]
        return targets, self._moves(lines, _joined([rank[:count]], own))

    def _moves(self, lines: list[Columns], target: Integers) -> Moves:
        rows = self._rows.columns
        at = _joined([c.at for c in lines], rows[1])
        motion, blended = (
            _joined([c[place] for c in lines], rows[own])
            for place, own in ((Columns._fields.index("motion"), 2), (Columns._fields.index("blended"), 3))
        )
        environment = _joined([self._plain_environments(at[: len(at) - len(rows[4])])], rows[4])
        alone = _joined([np.broadcast_to(0, len(c.at)) for c in lines], rows[5]).astype(bool)
        order = _order(at)
        follows = ~alone[order]
        follows[1:] &= ~alone[order][:-1]
        follows[_behind(at[order], self._collected.breaks)] = False
        follows[:1] = False
        over = np.array(follows)
        follows[_behind(at[order], self._collected.over)] = False
        return Moves(
            target[order],
            np.broadcast_to(0, len(at)),
            at[order],
            motion[order].astype(np.int64, copy=False),
            blended[order].astype(bool, copy=False),
            environment[order],
            follows,
            over,
        )

    def _state(self, at: Integers) -> Integers:
        """Which state holds at offsets."""
        return np.searchsorted(self._offsets, at, side="right") - 1

    def _plain_environments(self, at: Integers) -> Integers:
        """Environments of lines that are motions."""
        state = self._state(at)
        numbers = np.zeros(len(self._states), dtype=np.int64)
        for one in np.flatnonzero(np.bincount(state, minlength=len(numbers))):
            numbers[one] = self.found.environments.number(self._environment(self._states[one]))
        found: Integers = numbers[state]
        return found

    def _environment(self, state: State, place: Place | None = None, problem: str = "") -> Environment:
        identity = np.eye(4)
        before = place.before if place is not None else None
        after = place.after if place is not None else None
        return Environment(
            tool=state.tool,
            before=identity if before is None else before,
            after=identity if after is None else after,
            problem=self._collected.shifted or problem,
            payload_kg=state.payload_kg,
        )

    def _slow(self) -> None:
        """Targets and uses of the motions that are no lines of their own."""
        places = Places(self._collected.constants)
        for motion in self._collected.motions:
            places.note_direct(motion.target)
        resolved = [(motion, self._places(places, motion)) for motion in self._collected.motions]
        frames = {other for _, found in resolved for place in found for other in place.others}
        for motion, found in resolved:
            turned = self._turned_along(motion)
            for place in found:
                self._use(motion, place, frames, alone=len(found) > 1)
                if turned:
                    self._along.setdefault(place.leaf.start, turned)

    def _turned_along(self, motion: MotionCall) -> str:
        """Why a movec may turn the tool otherwise than its target is turned; empty if it does not."""
        if motion.mode is None:
            return ""
        try:
            mode = self._collected.constants.number(motion.mode)
        except RunTime:
            return PERHAPS_ALONG
        return {0.0: "", 1.0: TURNED_ALONG}.get(mode, PERHAPS_ALONG)

    def _places(self, places: Places, motion: MotionCall) -> list[Place]:
        try:
            found = list(places.every(motion.target))
        except RunTime as unknown:
            self._leave(motion, "", unknown)
            self._collected.compute(motion.target, motion.at)
            return []
        for place in found:
            self._collected.compute(place.leaf, motion.at)
        return found

    def _leave(self, motion: MotionCall, name: str, unknown: RunTime) -> None:
        over = motion_is_straight(motion.motion)
        self._collected.leave(
            motion.at, name, unknown.reason, motion.motion, blended=motion.blended, over=over
        )

    def _use(self, motion: MotionCall, place: Place, frames: Iterable[int], *, alone: bool) -> None:
        state = self._states[int(self._state(np.array(motion.at)))]
        try:
            target = self._leaves.number(place)
            seed = None if place.seed is None else self._leaves.number(place.seed)
        except RunTime as unknown:
            self._leave(motion, place.name, unknown)
            return
        if seed is not None and place.seed is not None:
            environment = self._environment(state, None, self._problem(place.seed, frames))
            number = self.found.environments.number(environment)
            self._rows.add(seed, motion.at, int(Motion.SEED), 0, number, int(alone))
        environment = self._environment(state, place, self._problem(place, frames))
        number = self.found.environments.number(environment)
        row = (target, motion.at, int(motion.motion), int(motion.blended), number)
        self._rows.add(*row, int(alone and seed is None))

    def _problem(self, place: Place, frames: Iterable[int]) -> str:
        if place.leaf.start in frames:
            return ALSO_A_FRAME
        if place.name in self._collected.elsewhere:
            line = self._source.place(self._collected.elsewhere[place.name])[0]
            return f'"{place.name}" is also used in line {line} for something else than a motion'
        return ""


def _behind(at: Integers, places: "array[int]") -> Integers:
    """The first of the moves at offsets (m,), ascending, behind each of some places, if there is one."""
    found = np.searchsorted(at, np.array(places, dtype=np.int64))
    return found[found < len(at)]


def _row(number: Number) -> tuple[float, ...]:
    return (number.start, number.end, number.value, number.decimals, number.factor)


def _joined(columns: list[NDArray[Any]], own: "array[int] | array[float] | Integers") -> NDArray[Any]:
    """Columns of lines, then our own, in one, the rows' numbers in order."""
    flat = [np.asarray(column).reshape(-1) for column in columns]
    return flat[0] if len(flat) == 1 and len(own) == 0 else np.concatenate([*flat, np.array(own)])


def _rows_joined(columns: list[NDArray[Any]], own: "array[int] | array[float]") -> NDArray[Any]:
    """The same for columns of rows, (n, 6), which single ones are as they are."""
    if len(columns) == 1 and not own:
        return columns[0]
    return _joined(columns, own).reshape(-1, AXES)


def _factors(
    columns: list[NDArray[Any]], own: "array[float]", order: slice | Integers
) -> NDArray[np.float64]:
    """Factors of all numbers; where all have the same, as lines of one kind do, one stands for them all."""
    known = {float(factor) for column in columns for factor in column[0]} | set(own)
    if len(known) == 1:
        return np.broadcast_to(known.pop(), sum(column.size for column in columns) + len(own))
    found: NDArray[np.float64] = _rows_joined(columns, own)[order].reshape(-1)
    return found


def _order(at: Integers) -> slice | Integers:
    """What sorts offsets: all of them as a slice where they are sorted."""
    return slice(None) if (at[1:] > at[:-1]).all() else np.argsort(at, kind="stable")
