"""In which readings an arm arrives on a line or an arc, where it does not change its posture at will."""

from typing import Final, NamedTuple, Protocol

import numpy as np

from truearm.inverse import Inverse
from truearm.robot import Robot
from truearm.rotations import matrix_from_rotation_vector, rigid_inverse, rotation_vector_from_matrix
from truearm.turns import NearestTurns
from truearm.types import Floats, Integers

UNFOLLOWED: Final = (
    "the way from the target before leads too near to a singularity, or out of the arm's reach, and does not "
    "tell which configuration it arrives in"
)

WRIST: Final = 6
CLOSE_RAD: Final = 0.1
"""Readings no farther, rad or m, are arrived in: in another posture the wrist would turn half round."""
FEWER_RAD: Final = 1.0
"""The same for arms with fewer than six axes, which have no wrist to turn over."""
TOLD_RAD: Final = np.pi / 2.0
"""Where a line crosses a singularity, the posture from before turns axes by about half a turn: by more."""
TOLD_ON_ARCS_RAD: Final = 0.75 * np.pi
STEP_RAD: Final = 0.25
"""How far the joints may go, rad or m, from one pose on a line to the next that is solved for."""
AT_EVEN_PACE: Final = 2
"""Poses that are solved for at once, for each such step that the joints would go at an even pace."""
LEAST_STEP: Final = 1.0 / 256.0
"""Part of a line. Joints that go a step farther within it turn so fast that they pass a singularity."""


class Way(NamedTuple):
    """How the tool moves to a target.

    Attributes:
        tool: flange_from_tool (4, 4), as the controller has it.
        flange: Pose (4, 4) of the flange at the target, as the controller computes it.
        arc: Whether it leads along an arc, and not along a line.
    """

    tool: Floats
    flange: Floats
    arc: bool


class Course(Protocol):
    """Where a tool goes, and how it turns on the way.

    Attributes:
        length_m: How long it is.
        turn_rad: How far the tool turns.
    """

    length_m: float
    turn_rad: float

    def poses(self, shares: Floats) -> Floats:
        """Poses (n, 4, 4) at shares (n,) of the way."""
        ...


class Line:
    """A straight line of a tool that turns evenly about one axis on the way.

    Attributes:
        length_m: How long it is.
        turn_rad: How far the tool turns.
    """

    def __init__(self, start: Floats, end: Floats) -> None:
        self._start, self._end = start, end
        self._turn = rotation_vector_from_matrix(start[:3, :3].T @ end[:3, :3])
        self.length_m = float(np.linalg.norm(end[:3, 3] - start[:3, 3]))
        self.turn_rad = float(np.linalg.norm(self._turn))

    def poses(self, shares: Floats) -> Floats:
        """Poses (n, 4, 4) at shares (n,) of the way."""
        found = np.tile(np.eye(4), (len(shares), 1, 1))
        start, end = self._start, self._end
        found[:, :3, 3] = start[:3, 3] + shares[:, None] * (end[:3, 3] - start[:3, 3])
        found[:, :3, :3] = start[:3, :3] @ matrix_from_rotation_vector(shares[:, None] * self._turn)
        return found


class Arrived(NamedTuple):
    """Where the arm arrives.

    Attributes:
        branch: Number of a branch of the target.
        q: Its readings (N,) at the turns in which it arrives.
    """

    branch: int
    q: Floats


class Follower:
    """Follows lines and arcs with the programming model of an arm."""

    def __init__(self, robot: Robot, inverse: Inverse) -> None:
        self._robot, self._inverse = robot, inverse
        self._nearest_turns = NearestTurns(robot)
        self._fewer = robot.joint_count < WRIST
        self._close = FEWER_RAD if self._fewer else CLOSE_RAD

    def arrived(
        self, before: Floats, way: Way, branches: Floats, turned: tuple[Integers, Floats]
    ) -> Arrived | str | None:
        """Where the arm arrives, or why the way does not tell it.

        None where readings are so close that the nearest count, where limits allow none, and on arcs of an
        arm whose branches have no names.

        Args:
            before: Readings (N,) that it comes from.
            way: How it comes.
            branches: One turn of each branch of the target, (b, N).
            turned: Numbers (k,) of those that limits allow, and their readings (k, N) at the turns nearest to
                `before`.
        """
        which, candidates = turned
        far = np.abs(candidates - before).max(axis=1, initial=0.0)
        if len(far) == 0 or far.min() <= self._close:
            return None
        here, *names = self._inverse.branch_names(np.concatenate([before[None], candidates]))
        kept = np.flatnonzero([name == here for name in names])
        place = int(kept[far[kept].argmin()]) if len(kept) else int(far.argmin())
        most = TOLD_ON_ARCS_RAD if way.arc else TOLD_RAD
        if self._told_by(here) and len(kept) and far[place] <= most:
            return Arrived(int(which[place]), candidates[place])
        if way.arc:
            return UNFOLLOWED if here else None
        end = self._end(before, way, candidates[place])
        if end is None:
            return UNFOLLOWED
        which, candidates = self._nearest_turns(branches, end[0])
        off = np.abs(candidates - end).max(axis=1, initial=0.0)
        same = np.flatnonzero(off < CLOSE_RAD)
        return Arrived(int(which[same[0]]), candidates[same[0]]) if len(same) == 1 else UNFOLLOWED

    def kept(self, before: Floats, turned: tuple[Integers, Floats]) -> Arrived | None:
        """Where the arm arrives over places that are not known, on lines and arcs alone.

        None where its posture is not told or a joint is turned by more than a quarter turn, as it is in the
        posture from before where the way has led through a singularity.

        Args:
            before: Readings (N,) that it comes from.
            turned: As in :meth:`arrived`.
        """
        which, candidates = turned
        here, *names = self._inverse.branch_names(np.concatenate([before[None], candidates]))
        kept = np.flatnonzero([name == here for name in names])
        if not self._told_by(here) or len(kept) != 1:
            return None
        place = int(kept[0])
        near = np.abs(candidates[place] - before).max() <= TOLD_RAD
        return Arrived(int(which[place]), candidates[place]) if near else None

    def _told_by(self, name: str) -> bool:
        """Whether a name tells all that an arm keeps on its way: the turn of the wrist where it has one."""
        return name.count(" ") == 2 or (self._fewer and bool(name))

    def _end(self, before: Floats, way: Way, likely: Floats) -> Floats | None:
        """The readings (1, N) at the end of a line; None where the arm cannot follow it."""
        values = np.ascontiguousarray(self._robot.joints_from_readings(before[None]))
        start = self._robot.flange_chain.pose(values)[0]
        line = Line(start @ way.tool, way.flange @ way.tool)
        count = int(np.ceil(AT_EVEN_PACE * np.abs(likely - before).max() / STEP_RAD))
        found = self.along(line, way.tool, np.arange(1, count + 1) / count, before, likely)
        return None if found is None or np.isnan(found).any() else found[-1:]

    def along(
        self, line: Course, tool: Floats, shares: Floats, before: Floats, likely: Floats
    ) -> Floats | None:
        """Readings (n, N) at shares (n,) of a way, in their order, NaN where some pose is not reached.

        None where the arm cannot follow it: near a singularity, or at a limit of a joint.

        Args:
            line: The line or the arc.
            tool: flange_from_tool (4, 4).
            shares: Shares of the way.
            before: Readings (N,) at its start.
            likely: Those at its end, if all goes evenly.
        """
        back = rigid_inverse(tool)
        seeds = before + shares[:, None] * (likely - before)
        found = self._inverse.near_or_nan(line.poses(shares) @ back, seeds)
        if np.isnan(found).any() or self._is_one_way(np.concatenate([before[None], found])):
            return found
        q, share = before, 0.0
        for number, until in enumerate(shares.tolist()):
            further = self._further(line, back, q, (share, until))
            if further is None:
                return None
            found[number] = q = further
            share = until
        return found

    def _further(self, line: Course, back: Floats, q: Floats, way: tuple[float, float]) -> Floats | None:
        """From readings (N,) at one share of a way to those at another, step by step."""
        share, until = way
        step = until - share
        while share < until:
            ahead = min(share + step, until)
            found = self._inverse.near_or_nan(line.poses(np.array([ahead])) @ back, q)[0]
            if self._is_one_way(np.stack([q, found])):
                q, share = found, ahead
                continue
            step /= 2.0
            if step < LEAST_STEP:
                return None
        return q

    def _is_one_way(self, q: Floats) -> bool:
        """Whether readings (n, N) follow one another in small steps and in one posture."""
        small = np.abs(np.diff(q, axis=0)).max() <= STEP_RAD
        return bool(small) and len(set(self._inverse.branch_names(q))) == 1
