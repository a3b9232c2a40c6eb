"""Waypoints on long straight moves, where the arm's error varies between the ends; arcs get none."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.errors import Notice, count_of
from truearm.inverse import Inverse
from truearm.kinds import check_positive
from truearm.programs.arcs import Arc, StatedArc, stated_arcs
from truearm.programs.corrections import Compensator
from truearm.programs.encoding import Encoder
from truearm.programs.environment import Environment, author_of
from truearm.programs.following import CLOSE_RAD, Course, Follower, Line
from truearm.programs.layouts import of_joints, of_pose, within_half_turn
from truearm.programs.listing import listed_move
from truearm.programs.program import LinearStep, Listed, Program, StepTexts
from truearm.programs.tables import NOWHERE, Motion, Via
from truearm.robot import Robot
from truearm.rotations import rigid_inverse
from truearm.types import Floats, Integers, Mask, Transform
from truearm.units import MM_PER_METRE

MOST_SAMPLES: Final = 4000
WITHIN: Final = 4
LEAST_SAMPLES: Final = 2 * WITHIN
TURN_RAD: Final = np.deg2rad(5.0)
"""Of the tool from one sample to the next at most."""
MOVES_NAMED: Final = 5
FROM_ANYWHERE: Final = "where the arm comes from is not known"
UNREACHED: Final = "the nominal arm does not reach all of the way"
SINGULAR: Final = "the way leads too near to a singularity"
ELSEWHERE: Final = "the way does not arrive at the readings of its target, which are of another configuration"
ARC: Final = "an arc gets no waypoints: it deviates less in several shorter ones"
NO_ARC: Final = (
    "how far its arc deviates is followed only of arcs past a via point that end at their target, the tool "
    "turning evenly"
)
BLENDED: Final = "how far it is blended with its neighbours is not written as a number"
NO_ROOM: Final = "what blends it with its neighbours leaves no room for waypoints"
OFFSET: Final = "its target has an offset, which a waypoint would not have"


@dataclass(frozen=True)
class Spacing:
    """How waypoints are inserted.

    Attributes:
        deviation_m: Largest deviation between two waypoints, as predicted.
        least_m: Least way between two of them, so that blending has room.
    """

    deviation_m: float
    least_m: float

    @classmethod
    def of(cls, deviation_mm: float, least_mm: float) -> "Spacing":
        """From millimetres.

        Raises:
            UsageError: If one of them is not positive.
        """
        for option, value in (("--densify-mm", deviation_mm), ("--least-spacing-mm", least_mm)):
            check_positive(value, option)
        return cls(deviation_mm / MM_PER_METRE, least_mm / MM_PER_METRE)


@dataclass(frozen=True)
class Deviating:
    """A linear move or an arc that deviates, or may, by more than was allowed and got no waypoints.

    Attributes:
        listed: Its statement, and why it got none.
        deviation_mm: How far the path is from a straight line or from the arc, as predicted; None where that
            is not known.
    """

    listed: Listed
    deviation_mm: float | None


@dataclass(frozen=True, eq=False)
class Inserted:
    """What densification found.

    Attributes:
        texts: What is inserted, and moves that their language cannot say with waypoints.
        deviating: Moves that deviate, or may, by more and got no waypoints, those included, in the order of
            the text.
    """

    texts: StepTexts
    deviating: tuple[Deviating, ...] = ()


def deviation_notices(
    program: Program, deviating: Sequence[Deviating], spacing: Spacing | None
) -> tuple[Notice, ...]:
    """What is told of moves that deviate by more than `spacing` allows: the first by line."""
    if not deviating or spacing is None:
        return ()
    count, several = len(deviating), len(program.sources) > 1
    named = "; ".join(_in_words(program, one, several=several) for one in deviating[:MOVES_NAMED])
    more = f"; and {count - MOVES_NAMED} more" if count > MOVES_NAMED else ""
    deviate = "deviates" if count == 1 else "deviate"
    may = ", or may," if any(one.deviation_mm is None for one in deviating) else ""
    largest_mm = MM_PER_METRE * spacing.deviation_m
    text = (
        f"{count_of(count, 'move')} {deviate}{may} by more than {largest_mm:g} mm (--densify-mm), "
        f"and waypoints could not be inserted there: {named}{more}"
    )
    return (Notice("deviation", text, tuple(sorted({one.listed.line for one in deviating}))),)


def _in_words(program: Program, one: Deviating, *, several: bool) -> str:
    file = f"{program.sources[one.listed.file].path.name}, " if several else ""
    far = "how far is not known" if one.deviation_mm is None else f"{one.deviation_mm:.3g} mm"
    return f"{file}line {one.listed.line} ({far}; {one.listed.reason})"


class Densifier:
    """Inserts waypoints before linear moves."""

    def __init__(
        self,
        program: Program,
        models: tuple[Robot, Inverse, Compensator],
        encoder: Encoder,
        spacing: Spacing,
    ) -> None:
        self._program, self._encoder, self._spacing = program, encoder, spacing
        self._robot, inverse, self._compensator = models
        self._follower = Follower(self._robot, inverse)
        self._deviation_mm: dict[int, float] = {}

    def insert(self, nominal: Floats, changed: Mask, tell: Callable[[int, int], None]) -> Inserted:
        """Waypoints for every linear move between two changed targets.

        A move to a changed one from where the arm may be anywhere, as behind calls and at the heads of
        loops, is told as one that may deviate. So are arcs that do between changed targets.

        Args:
            nominal: Readings of all targets, (t, N).
            changed: Which are changed, (t,); so are places of a changed one with an offset, as in Offsets.
            tell: Called with how many of these moves are done, and how many there are.
        """
        moves = self._program.moves
        ends = np.stack([moves.before, moves.target], axis=1)
        lines = (moves.motion == Motion.LINEAR) & changed[moves.target]
        anywhere = moves.before == NOWHERE
        why = dict.fromkeys(np.flatnonzero(lines & anywhere).tolist(), FROM_ANYWHERE)
        stepped: list[list[LinearStep]] = []
        numbers = np.flatnonzero(lines & ~anywhere & changed[moves.before]).tolist()
        for done, move in enumerate(numbers):
            tell(done, len(numbers))
            tool = self._environment(move).tool
            # Where the point that moves along the line is not known, neither is where waypoints belong.
            found = tool.unknown or self._between(move, ends[move], nominal[ends[move]])
            if isinstance(found, str):
                why[move] = found
            elif found:
                stepped.append(found)
        tell(len(numbers), len(numbers))
        texts = self._program.language.linear_steps(self._program, stepped) if stepped else StepTexts()
        why.update(dict.fromkeys(texts.impossible, texts.why))
        why.update(self._arcs(nominal, changed))
        deviating = (
            Deviating(listed_move(self._program, move, reason), self._deviation_mm.get(move))
            for move, reason in sorted(why.items())
        )
        return Inserted(texts, tuple(deviating))

    def _between(self, move: int, targets: Integers, ends: Floats) -> list[LinearStep] | str:
        """Waypoints before a move, or why it gets none though it deviates by more.

        Args:
            move: Its number.
            targets: Where the arm stands before it, and where it leads, (2,).
            ends: Readings of these, (2, N).
        """
        environment = self._environment(move)
        shares, within = _shares(line := Line(*self._tools(move, targets, ends)), self._spacing.least_m)
        q = self._corrected(move, line, shares, targets, ends)
        if isinstance(q, str):
            return q
        points = self._written(q, environment)
        deviation_m = _deviation(points)
        self._deviation_mm[move] = MM_PER_METRE * deviation_m
        if deviation_m <= self._spacing.deviation_m:
            return []
        chosen = self._chosen(move, points, within)
        if isinstance(chosen, str):
            return chosen
        return self._steps(move, environment, q[list(chosen)], tuple(chosen.values()))

    def _environment(self, move: int) -> Environment:
        return self._program.environments[int(self._program.moves.environment[move])]

    def _tools(self, move: int, targets: Integers, q: Floats) -> Floats:
        """Poses (k, 4, 4) of the tool where a move begins, where it passes and where it ends.

        Args:
            move: Its number.
            targets: The targets there, (k,).
            q: Readings of these, (k, N).
        """
        uses, tool = self._encoder.uses, self._environment(move).tool.controller
        start, *_, end = uses.displaced[targets].tolist()
        poses = self._robot.flange_chain.pose(np.ascontiguousarray(self._robot.joints_from_readings(q)))
        if start != end:
            moved = rigid_inverse(_moved(uses.displacements[end])) @ _moved(uses.displacements[start])
            poses[0] = moved @ poses[0]
        return poses @ tool

    def _corrected(
        self, move: int, way: Course, shares: Floats, targets: Integers, ends: Floats
    ) -> Floats | str:
        """Corrected readings (n, N) at shares (n,) of the way of a move, or why they are not known.

        Args:
            move: Its number.
            way: The line or the arc.
            shares: The shares, both ends among them.
            targets: Where the arm stands before it, and where it leads, (2,).
            ends: Readings of these, (2, N).
        """
        uses, tool = self._encoder.uses, self._environment(move).tool
        nominal = self._followed(way, tool.controller, shares, ends)
        if isinstance(nominal, str):
            return nominal
        start, end = uses.displaced[targets].tolist()
        if start == end:
            nominal[0] = ends[0]
        found = self._compensator.joints(
            nominal, tool=tool.true, author=author_of(self._robot, tool, uses.displacements[end])
        )
        if found.refused.any():
            return f"places between its ends are refused: {found.refusals[0].reason}"
        return found.q

    def _arcs(self, nominal: Floats, changed: Mask) -> dict[int, str]:
        """Arcs that deviate, or may, by more, and why they got no waypoints, by number of the move.

        Args:
            nominal: Readings of all targets, (t, N).
            changed: As of `insert`.
        """
        moves, arcs = self._program.moves, {arc.end: arc for arc in stated_arcs(self._program.moves)}
        vias = moves.motion == Motion.VIA
        passing = set(zip(moves.source[vias].tolist(), moves.at[vias].tolist(), strict=True))
        found: dict[int, str] = {}
        for move in np.flatnonzero((moves.motion == Motion.CIRCULAR) & changed[moves.target]).tolist():
            arc = arcs.get(move)
            statement = int(moves.source[move]), int(moves.at[move])
            if moves.before[move] == NOWHERE or (arc is None and statement in passing):
                found[move] = FROM_ANYWHERE
            elif arc is None or any(self._program.vias.get(via) == Via.OPEN for via in arc.vias):
                found[move] = NO_ARC
            elif changed[moves.target[list(arc.all)]].all():
                why = self._environment(move).tool.unknown or self._off_arc(arc, nominal)
                found.update({move: why} if why else {})
        return found

    def _off_arc(self, arc: StatedArc, nominal: Floats) -> str:
        """Why an arc is told: it deviates by more, or that is not known; empty if it does not."""
        targets = self._program.moves.target[list(arc.all)]
        start, *vias, end = self._tools(arc.end, targets, nominal[targets])
        way = Arc.through(start, vias, end)
        if way is None:
            return NO_ARC
        passed = np.array([0.0, *(way.share_of(pose[:3, 3]) for pose in vias), 1.0])
        shares = np.union1d(_shares(way, self._spacing.least_m)[0], passed)
        q = self._corrected(arc.end, way, shares, targets[[0, -1]], nominal[targets[[0, -1]]])
        if isinstance(q, str):
            return q
        points = self._written(q, self._environment(arc.end))
        through = np.tile(np.eye(4), (len(passed), 1, 1))
        through[:, :3, 3] = points[np.searchsorted(shares, passed)]
        commanded = Arc.through(through[0], list(through[1:-1]), through[-1])
        if commanded is None:
            return NO_ARC
        deviation_m = float(commanded.off_m(points).max())
        self._deviation_mm[arc.end] = MM_PER_METRE * deviation_m
        return ARC if deviation_m > self._spacing.deviation_m else ""

    def _followed(self, way: Course, tool: Floats, shares: Floats, ends: Floats) -> Floats | str:
        """Readings (n, N) at shares (n,) of a way between those at its `ends` (2, N), or why not."""
        found = self._follower.along(way, tool, shares, ends[0], ends[-1])
        if found is None:
            return SINGULAR
        if np.isnan(found).any():
            return UNREACHED
        if np.abs(found[-1] - ends[-1]).max() > CLOSE_RAD:
            return ELSEWHERE
        found[-1] = ends[-1]
        return found

    def _chosen(self, move: int, points: Floats, within: int) -> dict[int, float] | str:
        """Which of the points (n, 3), `within` steps in the least spacing, become waypoints of a move, and
        the room in m that each of them has; or why they cannot.
        """
        least_mm = MM_PER_METRE * self._spacing.least_m
        if within == 0:
            return f"it is shorter than twice the least spacing of {least_mm:g} mm"
        blends = self._program.language.blends(self._program, move)
        if blends is None:
            return BLENDED
        clear = _clear_of(blends, points, self._spacing.least_m / 2.0)
        if not clear:
            return NO_ROOM
        chosen = _needed(points, self._spacing.deviation_m, clear, within)
        if chosen is None:
            return f"the least spacing of {least_mm:g} mm is too wide"
        rooms = _rooms(points[[0, *chosen, len(points) - 1]], blends)
        return dict(zip(chosen, rooms, strict=True))

    def _written(self, q: Floats, environment: Environment) -> Floats:
        """Where the controller believes the tool, (n, 3)."""
        robot = self._encoder.robot
        poses = robot.flange_chain.pose(np.ascontiguousarray(robot.joints_from_readings(q)))
        points: Floats = (poses @ environment.tool.controller)[:, :3, 3]
        return points

    def _steps(
        self, move: int, environment: Environment, q: Floats, rooms: Sequence[float]
    ) -> list[LinearStep] | str:
        """Waypoints that say readings (n, N), with their rooms, or why one cannot be said with certainty.

        A waypoint is written out in numbers, without the offsets that the move's own target has.
        """
        if not environment.places_as_stored:
            return OFFSET
        program, moves = self._program, self._program.moves
        target, file = int(moves.target[move]), int(moves.source[move])
        layout = program.layouts[int(program.targets.layout[target])]
        which = np.full(len(q), target)
        if of_pose(layout):
            values, decimals = self._encoder.pose_numbers(which, layout, environment, q)
        elif of_joints(layout):
            values, decimals = self._encoder.joint_numbers(which, layout, q)
        reason = self._encoder.reasons.pop(target, None)
        if reason is not None:
            return f"waypoints between cannot be written: {reason}"
        values = within_half_turn(layout, values)
        line, _ = program.sources[file].place(int(moves.at[move]))
        return [
            LinearStep(line, file, move, tuple(row.tolist()), tuple(digits.tolist()), room)
            for row, digits, room in zip(values, decimals, rooms, strict=True)
        ]


def _moved(displacement: Transform | None) -> Transform:
    return np.eye(4) if displacement is None else displacement


def _shares(way: Course, least_m: float) -> tuple[Floats, int]:
    """Shares (n,) of a way, both ends included, and how many steps lie in the least spacing; 0 where no
    waypoint has that on both sides.
    """
    least = max(LEAST_SAMPLES, int(np.ceil(way.turn_rad / TURN_RAD)))
    count = min(int(way.length_m / least_m) * WITHIN, MOST_SAMPLES)
    if count < LEAST_SAMPLES:
        count, within = least, 0
    else:
        finer = -(-least // count)
        count, within = count * finer, WITHIN * finer
    return np.linspace(0.0, 1.0, count + 1), within


def _clear_of(blends: tuple[float, float], points: Floats, margin_m: float) -> range:
    """Which of the points (n, 3) lie a margin outside of where the ends are blended; all do at an end that
    is not.
    """
    clear = np.ones(len(points), dtype=bool)
    for radius, end in zip(blends, (points[0], points[-1]), strict=True):
        if radius > 0.0:
            clear &= np.linalg.norm(points - end, axis=1) >= radius + margin_m
    found = np.flatnonzero(clear)
    return range(int(found[0]), int(found[-1]) + 1) if len(found) else range(0)


def _rooms(points: Floats, blends: tuple[float, float]) -> list[float]:
    """How far, in m, the arm may leave the line around each of the points (n, 3) but the first and the last.

    Half the way to a neighbouring point, and no farther than to where the ends are blended.
    """
    ways = np.linalg.norm(np.diff(points, axis=0), axis=1)
    before, behind = ways[:-1] / 2.0, ways[1:] / 2.0
    if blends[0] > 0.0:
        before[0] = ways[0] - blends[0]
    if blends[1] > 0.0:
        behind[-1] = ways[-1] - blends[1]
    rooms: list[float] = np.minimum(before, behind).tolist()
    return rooms


def _needed(points: Floats, deviation_m: float, clear: range, within: int) -> list[int] | None:
    """Which of the points (n, 3), ends apart, a chain of straight lines needs; None if they do not suffice.

    Equal steps lie between the points, `within` of them in the least spacing, so a line from point i to
    point j passes each point between at an equal share of its way. Points that are not `clear` are not used:
    there the arm leaves the lines anyway, for it is blended.
    """
    chosen: list[int] = []
    start, last = 0, len(points) - 1
    while not chosen or clear.stop - start > within:
        end = _farthest(points, start, deviation_m, within)
        if end is None:
            return None
        if end == last:
            break
        start = min(max(end, clear.start), clear.stop - 1)
        chosen.append(start)
    return chosen


def _farthest(points: Floats, start: int, deviation_m: float, within: int) -> int | None:
    """The last point to which a straight line from `start` stays within the deviation; None without one."""
    last = len(points) - 1
    if _deviation(points[start:]) <= deviation_m:
        return last
    low, high = start + within, last - within
    if high < low or _deviation(points[start : low + 1]) > deviation_m:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        if _deviation(points[start : middle + 1]) <= deviation_m:
            low = middle
        else:
            high = middle
    return low


def _deviation(points: Floats) -> float:
    share = np.linspace(0.0, 1.0, len(points))[:, None]
    straight = points[0] + share * (points[-1] - points[0])
    return float(np.linalg.norm(points - straight, axis=1).max())
