"""From the targets of a program to the joint readings that its author meant, q^n.

Configuration data and the target before tell of the author's readings: those of the nominal arm with tools
and work objects as the controller has them, wherever these truly are.
"""

from collections.abc import Callable, Set
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from truearm.inverse import Inverse
from truearm.programs.carrying import Origins
from truearm.programs.configuration import ANY, meant
from truearm.programs.following import CLOSE_RAD, Arrived, Follower, Way
from truearm.programs.layouts import of_joints
from truearm.programs.program import Program, flange_poses_of, motion_is_straight, numbers_of
from truearm.programs.rounding import rounded_rad
from truearm.programs.tables import NOWHERE, Motion, placed, run_of
from truearm.programs.turning import EDGE_RAD as COMPUTED_RAD
from truearm.programs.uses import SEVERAL, UNUSED, Uses
from truearm.programs.vias import passed_vias
from truearm.robot import Robot
from truearm.turns import EDGE_RAD, NearestTurns, turned_away, with_turns
from truearm.types import Floats, Integers, Mask
from truearm.units import FULL_TURN

OUT_OF_REACH: Final = "the nominal arm does not reach it"
NO_BRANCH: Final = "the nominal arm does not reach it in the configuration that it states"
AMBIGUOUS: Final = "several configurations of the arm reach it, and the program does not tell which is meant"
UNKNOWN_BEFORE: Final = (
    "several configurations of the arm reach it, of which the one nearest to the target before is meant, and "
    "that is not known: none comes before, or another may (a loop, a branch, a call), or it is listed"
)
CONTRADICTS: Final = "its configuration data is another than a line from the target before arrives in"
UNHEEDED: Final = (
    "the controller does not heed its configuration data there (ConfJ or ConfL is off), and the target "
    "before does not tell which configuration is meant"
)
PERHAPS_HEEDED: Final = (
    "whether the controller heeds its configuration data there (ConfJ, ConfL) depends on how the program "
    "runs, and that may decide which configuration is meant"
)
SINGULAR: Final = "it lies at a singularity, where a pose does not determine the joints"
DIFFERENT: Final = "it is reached in several configurations of the arm, and one change cannot suit them all"

FAR_SEED: Final = (
    "the arm reaches it in infinitely many ways, and none was found near the seed or the target before: give "
    "joints beside it"
)

DETERMINED: Final = 6
"""With more joints than this infinitely many readings reach a pose."""
NEAR_SEED: Final = 0.5
"""Farther away, rad or m, a search may have ended in another posture than was meant."""
SAME_RAD: Final = 1e-6
NEARER: Final = 0.8
LEAST_GAIN: Final = 2e-3
AT_ONCE: Final = 1000


@dataclass(frozen=True, eq=False)
class Solved:
    """What a program means.

    Attributes:
        q: Readings of each target, (t, N), rad and m; NaN where they are not known.
        reasons: Why a target cannot be changed, by its number.
        open_turns: Numbers of those that the arm may reach at other turns of its joints than `q` says.
        points: Targets of which only the position counts.
    """

    q: Floats
    reasons: dict[int, str]
    open_turns: frozenset[int]
    points: Set[int] = frozenset()


def solve_targets(
    program: Program, uses: Uses, robot: Robot, inverse: Inverse, tell: Callable[[int, int], None]
) -> Solved:
    """The readings of all targets.

    Args:
        program: The program.
        uses: How its targets are used.
        robot: The programming model.
        inverse: Its inverse kinematics.
        tell: Called now and then with how many moves to Cartesian targets are done, and how many there are.
    """
    solver = _Solver(program, uses, robot, inverse)
    solver.take_joints()
    solver.take_poses(tell)
    return Solved(
        solver.q, solver.reasons, frozenset(solver.open_turns - solver.reasons.keys()), solver.points
    )


class _Named(NamedTuple):
    """Readings that configuration data names.

    Attributes:
        q: The readings, (k, N).
        singular: Whether they lie at a singularity, (k,).
        exact: Whether the data names them as they are, and not only as rounding may have changed them, (k,).
    """

    q: Floats
    singular: Mask
    exact: Mask


@dataclass(frozen=True, eq=False)
class _Possible:
    """What the readings of a Cartesian target can be.

    Attributes:
        branches: One turn of each branch, (b, N).
        at_singularity: Whether these lie at a singularity, (b,).
        named: Those that its configuration data names; None where it has none.
        flange: Pose (4, 4) of the flange where infinitely many readings reach it, so that no list holds those
            that are meant; else None.
    """

    branches: Floats
    at_singularity: Mask
    named: _Named | None
    flange: Floats | None = None


class _Came(NamedTuple):
    """How the arm comes to a target.

    Attributes:
        before: The readings that it comes from, or a seed; None where they are not known.
        way: The line or the arc on which it comes from there; None where it comes joint by joint.
        nearest: As in Program, of the move; None where configuration data counts.
        origin: Where the last readings are not known, those of the last known place, if lines and arcs alone
            lead from there to the target; else None.
        open_turns: Whether the arm may come at other turns of its joints.
    """

    before: Floats | None
    way: Way | None
    nearest: bool | None
    origin: Floats | None = None
    open_turns: bool = False


class _Solver:
    """Gathers readings and reasons."""

    def __init__(self, program: Program, uses: Uses, robot: Robot, inverse: Inverse) -> None:
        self.program, self.uses, self.robot, self.inverse = program, uses, robot, inverse
        self._nearest_turns = NearestTurns(robot)
        self._follower = Follower(robot, inverse)
        self._passed = passed_vias(program, uses, robot)
        self.q: Floats = np.broadcast_to(np.nan, (len(program.targets), robot.joint_count))
        self.reasons: dict[int, str] = {}
        self.open_turns: set[int] = set()
        self._refused: frozenset[int] = frozenset()
        self._origins = Origins(program.moves, self._known, self._is_lost)
        self._unheeded = {int(program.moves.target[move]) for move in program.nearest}

    @property
    def points(self) -> Set[int]:
        """Targets of which only the position counts."""
        return self._passed.flange.keys()

    def take_joints(self) -> None:
        """Joint targets say their readings; all that cannot be changed whatever they say are named."""
        for number, layout in enumerate(self.program.layouts):
            which = np.flatnonzero(self.program.targets.layout == number)
            if of_joints(layout):
                readings = layout.to_readings(numbers_of(self.program, which, layout))
                self.q = placed(self.q, run_of(which), readings)
        self.reasons.update(self.program.fixed)
        for target in np.flatnonzero(~self.uses.mentioned):
            self.reasons.setdefault(int(target), UNUSED)
        for target in np.flatnonzero(self.uses.several):
            self.reasons.setdefault(int(target), SEVERAL)
        for number, environment in enumerate(self.program.environments):
            here = self.uses.environment == number
            self._refuse(here & self.uses.of_joints, environment.problem)
            self._refuse(here & ~self.uses.of_joints, environment.why_not_poses)
        for passed, why in self._passed.reasons.items():
            self.reasons.setdefault(passed, why)

    def _refuse(self, which: Mask, reason: str) -> None:
        if reason:
            for target in np.flatnonzero(which & ~self.uses.several):
                self.reasons.setdefault(int(target), reason)

    def take_poses(self, tell: Callable[[int, int], None]) -> None:
        """Cartesian targets, in the order of the moves, each near its seed or where the arm stands."""
        self._refused = frozenset(self.reasons)
        poses = self._flange_poses()
        points = {number: pose for number, pose in self._passed.flange.items() if number not in self.reasons}
        poses.update(points)
        moves = self.program.moves
        moved = np.flatnonzero(moves.moving & np.isin(moves.target, list(poses)))
        if len(moved) == 0:
            return
        self.q = np.array(self.q)  # may be the program's own numbers, where all of them are joints
        self.q[list(points)] = np.nan
        for start in range(0, len(moved), AT_ONCE):
            tell(start, len(moved))
            self._take_some(moved[start : start + AT_ONCE], poses)
        tell(len(moved), len(moved))

    def _take_some(self, moved: Integers, poses: dict[int, Floats]) -> None:
        """The targets of these moves, all of which are in `poses`."""
        moves = self.program.moves
        targets, nears = moves.target[moved], moves.near[moved]
        possible = self._possible(np.unique(targets), poses)
        followed = np.where(nears == moves.before[moved], moves.motion[moved], Motion.JOINT)
        columns = (column.tolist() for column in (moved, targets, nears, followed, moves.environment[moved]))
        for move, target, near, motion, environment in zip(*columns, strict=True):
            way = None
            if motion_is_straight(motion):
                tool = self.program.environments[environment].tool.controller
                way = Way(tool, poses[target], motion != Motion.LINEAR)
            self._take(target, possible[target], self._came(move, near, way, possible[target]))

    def _came(self, move: int, near: int, way: Way | None, possible: _Possible) -> _Came:
        """How the arm comes to a target; at turns that are not known on lines and arcs alone."""
        before, nearest = self._before(move, near), self.program.nearest.get(move)
        at_open_turns = near in self.open_turns
        if way is None or possible.named is not None or possible.flange is not None:
            return _Came(None if at_open_turns else before, way, nearest)
        origin = self._origins.of(move) if before is None else None
        return _Came(before, way, nearest, origin, at_open_turns or origin is not None)

    def _is_lost(self, target: int) -> bool:
        """Whether the way to a target whose readings are not known, or the target, may change the posture."""
        return target not in self._refused and self.reasons.get(target) != UNKNOWN_BEFORE

    def _before(self, move: int, near: int) -> Floats | None:
        """The readings near which those of a move are looked for, at its target `near`, if they are known.

        On an arc those at its start otherwise, be it that the start itself cannot be changed.
        """
        arc = self._passed.starts.get(move)
        known = None if arc is not None and near in self._passed.reasons else self._known(near)
        if known is not None or arc is None:
            return known
        start, flange = arc
        known = self._known(start)
        if known is not None:
            return known
        possible = self._possible(np.array([start]), {start: flange})[start]
        found = self._chosen(possible, _Came(None, None, None))
        return None if isinstance(found, str) else found

    def _known(self, target: int) -> Floats | None:
        """The readings of a target; None where they are not known."""
        unknown = target == NOWHERE or target in self.program.unsure or np.isnan(self.q[target, 0])
        return None if unknown else self.q[target]

    def _possible(self, some: Integers, poses: dict[int, Floats]) -> dict[int, _Possible]:
        """What the readings of the targets `some` can be, with the poses of the flange at them."""
        if self.robot.joint_count > DETERMINED and self.program.configuration is None:
            nothing = np.empty((0, self.robot.joint_count)), np.empty(0, dtype=bool), None
            return {number: _Possible(*nothing, poses[number]) for number in some.tolist()}
        branches = self.inverse.branches(np.stack([poses[number] for number in some.tolist()]))
        named = self._named(some, branches)
        reached: Mask = np.asarray(np.isfinite(branches).all(axis=2))
        at_singularity = np.zeros(reached.shape, dtype=bool)
        at_singularity[reached] = are_singular(self.robot, branches[reached])
        return {
            number: _Possible(solutions[finite], singular[finite], named.get(row))
            for row, (number, solutions, finite, singular) in enumerate(
                zip(some.tolist(), branches, reached, at_singularity, strict=True)
            )
        }

    def _named(self, some: Integers, branches: Floats) -> dict[int, _Named]:
        """By row: readings that the configuration data of the targets `some` names."""
        wanted = self._wanted(some)
        if self.program.configuration is None or wanted is None:
            return {}
        stated = (wanted != ANY).any(axis=1)
        rows, candidates = with_turns(branches, self.robot)
        exact, agree = np.array(stated[rows]), np.array(stated[rows])
        exact[agree], agree[agree] = meant(self.program.configuration, wanted[rows[agree]], candidates[agree])
        rows, candidates, exact = rows[agree], candidates[agree], exact[agree]
        near = self._near(some, rows, candidates, wanted, exact)
        rows, candidates, exact = rows[near], candidates[near], exact[near]
        singular = are_singular(self.robot, candidates)
        places = np.searchsorted(rows, np.arange(len(some) + 1))
        found = {}
        for row in np.flatnonzero(stated).tolist():
            here = slice(places[row], places[row + 1])
            found[row] = _Named(candidates[here], singular[here], exact[here])
        return found

    def _near(
        self, some: Integers, rows: Integers, candidates: Floats, wanted: Integers, exact: Mask
    ) -> Mask:
        """Which candidates (m, N) of the targets `some[rows]` are left where several agree with their data,
        not all of them exactly: those that do within what the rounding of the text and the controller's
        arithmetic leave open, if there are any.
        """
        left = np.ones(len(rows), dtype=bool)
        count = len(some)
        doubtful = np.bincount(rows, minlength=count) > np.bincount(rows[exact], minlength=count)
        doubtful &= np.bincount(rows, minlength=count) > 1
        asked = np.flatnonzero(doubtful[rows])
        if len(asked) == 0 or self.program.configuration is None:
            return left
        open_rad = rounded_rad(self.program, self.uses, some[rows[asked]], candidates[asked], self.robot)
        edge = np.fmin(open_rad + 2.0 * COMPUTED_RAD, EDGE_RAD)
        _, near = meant(self.program.configuration, wanted[rows[asked]], candidates[asked], edge)
        some_near = np.bincount(rows[asked[near]], minlength=count) > 0
        left[asked] = near | ~some_near[rows[asked]]
        return left

    def _wanted(self, some: Integers) -> Integers | None:
        """Digits (n, D) of targets' configuration data, ANY where open; None where no target has any."""
        configuration, wanted = self.program.configuration, None
        for number, layout in enumerate(self.program.layouts):
            count = layout.configuration
            here = self.program.targets.layout[some] == number
            if configuration is None or count == 0 or not here.any():
                continue
            values = numbers_of(self.program, some[here], layout)[:, -count:]
            digits = configuration.digits_of_text(values)
            if wanted is None:
                wanted = np.full((len(some), digits.shape[1]), ANY, dtype=np.int64)
            wanted[here] = digits
        if wanted is not None:
            wanted[np.isin(some, list(self.points))] = ANY
        return wanted

    def _flange_poses(self) -> dict[int, Floats]:
        """Poses of the flange for every Cartesian target that may be changed."""
        usable = ~self.uses.of_joints & (self.uses.environment >= 0)
        usable[list(self.reasons)] = False
        which = np.flatnonzero(usable)
        poses = flange_poses_of(self.program, which, self.uses.environment[which], self.robot)
        known = np.isfinite(poses[:, 0, 0])
        return dict(zip(which[known].tolist(), poses[known], strict=True))

    def _take(self, target: int, possible: _Possible, came: _Came) -> None:
        if target in self.reasons:
            return
        known = None if np.isnan(self.q[target, 0]) else self.q[target]
        if known is not None and possible.named is not None and target not in self._unheeded:
            return
        if possible.flange is not None:
            found = self._from_seed(possible.flange, came.before)
        else:
            found = self._chosen(possible, came)
        if isinstance(found, str):
            self.reasons[target] = found
            self.q[target] = np.nan
        elif known is not None and np.abs(known - found).max() > SAME_RAD:
            self.reasons[target] = DIFFERENT
            self.q[target] = np.nan
        else:
            self.q[target] = found
            if came.open_turns and (turned_away(found[None], self.robot) != found).any():
                self.open_turns.add(target)

    def _chosen(self, possible: _Possible, came: _Came) -> Floats | str:
        """The readings that are meant, or why they are not known."""
        if len(possible.branches) == 0:
            return OUT_OF_REACH
        if possible.named is None:
            return self._unnamed(possible, came)
        if came.nearest is None:
            return self._stated(possible, possible.named, came)
        found = self._unnamed(possible, came)
        if isinstance(found, str):
            if found in {AMBIGUOUS, UNKNOWN_BEFORE}:
                return UNHEEDED if came.nearest else PERHAPS_HEEDED
            return found
        stated = found if came.nearest else self._stated(possible, possible.named, came)
        agree = not isinstance(stated, str) and np.abs(stated - found).max() <= SAME_RAD
        return found if agree else PERHAPS_HEEDED

    def _stated(self, possible: _Possible, named: _Named, came: _Came) -> Floats | str:
        """The readings among those `named` that configuration data means, or why they are not known."""
        if len(named.q) == 0:
            return NO_BRANCH
        before = came.before
        place = the_nearest(named.q, before)
        if place is not None and _may_be_turned(named, place):
            place = None
        found = AMBIGUOUS if place is None else named.q[place]
        if came.way is not None and before is not None:
            near = place is not None and np.abs(named.q[place] - before).max() <= CLOSE_RAD
            found = found if near else self._stated_on(came.way, before, possible, named.q, found)
        return SINGULAR if not isinstance(found, str) and named.singular.any() else found

    def _stated_on(
        self, way: Way, before: Floats, possible: _Possible, named: Floats, found: Floats | str
    ) -> Floats | str:
        """The readings that a line or an arc arrives in, if they are among those `named` (k, N).

        Where it does not tell, those `found` without it, if none are nearer to the readings (N,) before.
        """
        turned = self._nearest_turns(possible.branches, before)
        arrived = self._follower.arrived(before, way, possible.branches, turned)
        if isinstance(arrived, Arrived):
            same = np.abs(named - arrived.q).max(axis=1) <= SAME_RAD
            return arrived.q if same.any() else CONTRADICTS
        if isinstance(found, str) or is_nearest(found, turned[1], before):
            return found
        return arrived or CONTRADICTS

    def _from_seed(self, flange: Floats, before: Floats | None) -> Floats | str:
        """The readings that a search from those before arrives at, where it arrives near by."""
        if before is None:
            return UNKNOWN_BEFORE
        (found,) = self.inverse.near_or_nan(flange[None], before[None])
        if np.isnan(found).any():
            return OUT_OF_REACH
        if np.abs(found - before).max() > NEAR_SEED:
            return FAR_SEED
        return SINGULAR if are_singular(self.robot, found[None])[0] else found

    def _unnamed(self, possible: _Possible, came: _Came) -> Floats | str:
        """The readings that the way arrives in, or those nearest to where it comes from, where the text does
        not tell.
        """
        if came.before is None:
            return self._kept(possible, came.origin)
        turned = self._nearest_turns(possible.branches, came.before)
        arrived = None
        if came.way is not None:
            arrived = self._follower.arrived(came.before, came.way, possible.branches, turned)
        if isinstance(arrived, str):
            return arrived
        if arrived is None:
            which, candidates = turned
            place = the_nearest(candidates, came.before) if len(candidates) else None
            if place is None:
                return AMBIGUOUS
            arrived = Arrived(int(which[place]), candidates[place])
        return SINGULAR if possible.at_singularity[arrived.branch] else arrived.q

    def _kept(self, possible: _Possible, origin: Floats | None) -> Floats | str:
        """The readings in the posture of those from where lines and arcs lead there, at the turns nearest to
        them, if they tell it.
        """
        if origin is None or are_singular(self.robot, origin[None])[0]:
            return UNKNOWN_BEFORE
        kept = self._follower.kept(origin, self._nearest_turns(possible.branches, origin))
        if kept is None:
            return UNKNOWN_BEFORE
        return SINGULAR if possible.at_singularity[kept.branch] else kept.q


def the_nearest(candidates: Floats, before: Floats | None) -> int | None:
    """The one of the candidates (k, N) that is meant: the only one, or clearly the nearest to `before`."""
    distances = None if before is None else np.abs(candidates - before).max(axis=1)
    place = 0 if distances is None else int(distances.argmin())
    others = np.abs(candidates - candidates[place]).max(axis=1) > SAME_RAD
    if not others.any():
        return place
    if distances is None or distances[place] > NEARER * distances[others].min():
        return None
    return place


def _may_be_turned(named: _Named, place: int) -> bool:
    """Whether other readings are whole turns from those at `place`, and the data, which tells the two apart,
    is not certain enough to do so.
    """
    apart = (named.q - named.q[place]) / FULL_TURN
    turns = np.rint(apart)
    turned = (np.abs(apart - turns).max(axis=1) < SAME_RAD / FULL_TURN) & turns.any(axis=1)
    return bool((turned & ~(named.exact & named.exact[place])).any())


def is_nearest(found: Floats, candidates: Floats, before: Floats) -> bool:
    """Whether none of the candidates (k, N) is nearer to `before` than `found`."""
    nearest = np.abs(candidates - before).max(axis=1).min()
    return bool(np.abs(found - before).max() <= nearest + SAME_RAD)


def are_singular(robot: Robot, q: Floats) -> Mask:
    """Where a small change of the pose asks for a large one of the joints, (n,) (six axes or more)."""
    if robot.joint_count < 6 or len(q) == 0:
        return np.zeros(len(q), dtype=bool)
    jacobian = robot.joint_jacobian(q, pose=True)
    doubtful = np.ones(len(q), dtype=bool)
    if robot.joint_count == 6:
        # The least gain is at least the reciprocal of the inverse's Frobenius norm; rounding is far from 2.
        invertible = np.flatnonzero(np.linalg.det(jacobian))
        norms = np.linalg.norm(np.linalg.inv(jacobian[invertible]), axis=(1, 2))
        doubtful[invertible] = norms * 2.0 * LEAST_GAIN > 1.0
    found = np.zeros(len(q), dtype=bool)
    found[doubtful] = np.linalg.svd(jacobian[doubtful], compute_uv=False)[:, 5] < LEAST_GAIN
    return found
