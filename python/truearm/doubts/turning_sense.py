"""Whether measured orientations can be of a given robot, and how they would have to be read."""

from dataclasses import dataclass
from itertools import permutations, product
from typing import Final

import numpy as np

from truearm.errors import InputError
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.rotations import matrix_from_quaternion
from truearm.tables.euler_orders import otherwise_read, usual_first, with_twin
from truearm.types import AXES, Floats

MISFIT: Final = 0.2
"""Turns from pose to pose that are off by so much (sine of the angle) are not those of the robot, nor are
positions that are off by this part of their spread."""
FIT: Final = 0.05
"""Those that are off by less are: no arm is off by 0.05 rad or a twentieth of its reach."""
FEWEST_POSES: Final = 6
MOST_POSES: Final = 60
"""Poses at the most that other kinds of angles are tried on."""
AS_WELL: Final = 1.5
"""Kinds fit as well whose misfits are within this factor of the least."""
MOST_NAMED: Final = 2
ABOUT_ONE: Final = 0.02
"""An arm turns its tool about one axis, as a SCARA does, where turns about others are less than this part."""
STILL: Final = 0.05
"""And about none where turns are less than this, rad."""
SAME: Final = 1e-3
"""Orientations that are within so much of one of them, rad, were not measured where the arm turned."""

IN_ORDER: Final = (0, 1, 2, 3)
NOTED: Final = "truearm import --rotation"
OTHER_SIGN: Final = "the other sign of qx, qy and qz turns them about"
COMPONENTS: Final = "wxyz"
READINGS: Final = tuple(product(permutations(range(4)), (False, True)))[1:]
"""Other readings of the four columns: which component each holds, and whether conjugate."""


@dataclass(frozen=True)
class _Arm:
    """How a nominal arm turns and moves a target, its frame and its tool unknown.

    Attributes:
        flanges: Poses of its flange (n, 4, 4).
        points: Measured positions (n, 3).
        turns: How the flange turns from pose to pose (n - 1, 3), see `_turns`.
        strengths: How much it turns about each of three directions (3), the most first.
        axis: The direction (3,) that it turns about most.
    """

    flanges: Floats
    points: Floats
    turns: Floats
    strengths: Floats
    axis: Floats

    @classmethod
    def of(cls, flanges: Floats, points: Floats) -> "_Arm":
        turns = _turns(flanges[:, :3, :3])
        _, strengths, axes = np.linalg.svd(turns, full_matrices=False)
        return cls(flanges, points, turns, strengths, axes[0])

    def misfit(self, quaternions: Floats) -> float:
        """How little the poses with these orientations (n, 4), w first, can be those of the arm.

        Turns from pose to pose, seen from the world, give the frame's orientation; where the arm turns about
        one axis, positions give the angle about it. The rest is then linear.

        Returns:
            The larger of the median distance between turns and that between positions, over their spread;
            of turns that are off by MISFIT or more that alone.
        """
        frames, between_turns = self.between_turns(quaternions[None])
        still = self.strengths[0] < STILL * np.sqrt(len(self.turns))
        if still or between_turns[0] >= MISFIT:
            return float(between_turns[0])
        return max(float(between_turns[0]), self._between_points(frames[0]))

    def between_turns(self, quaternions: Floats) -> tuple[Floats, Floats]:
        """Frames world_from_base (k, 3, 3) of k sets of orientations (k, n, 4), and misfits of turns (k)."""
        of_tool = _turns(matrix_from_quaternion(quaternions))
        u, _, vt = np.linalg.svd(np.swapaxes(of_tool, 1, 2) @ self.turns)
        u[:, :, -1] *= np.linalg.det(u @ vt)[:, None]
        frames = u @ vt
        distances = np.linalg.norm(of_tool - self.turns @ np.swapaxes(frames, 1, 2), axis=2)
        return frames, np.median(distances, axis=1)

    def _between_points(self, world_from_base: Floats) -> float:
        """Median distance between positions, over their spread, once tool and the frame's place are found."""
        points = self.points @ world_from_base
        if self.strengths[1] < ABOUT_ONE * self.strengths[0]:
            points = _turned_about(self.axis, points, self.flanges)
        unknown = _frame_and_tool(self.flanges)
        wanted = (points - self.flanges[:, :3, 3]).reshape(-1)
        left = wanted - unknown @ np.linalg.lstsq(unknown, wanted, rcond=None)[0]
        spread = np.linalg.norm(points - points.mean(axis=0), axis=1)
        return float(np.median(np.linalg.norm(left.reshape(-1, AXES), axis=1)) / np.median(spread))


def check_turns(measurements: Measurements, robot: Robot) -> None:
    """Check that the tool turns and moves as the nominal arm's does, whatever frame and tool are.

    Raises:
        InputError: If it does not, and does so once the quaternions are read in another order or
            sense, or the angles that they were made from are of another kind; or if all orientations
            are the same while the arm turns.
    """
    turned = measurements.orientations
    if turned is None:
        return
    points = measurements.targets[:, measurements.most_held()]
    for group in measurements.groups:
        seen = (
            (measurements.group == group) & np.isfinite(turned).all(axis=1) & np.isfinite(points).all(axis=1)
        )
        if seen.sum() < FEWEST_POSES:
            continue
        rows, poses = measurements.select(seen), (points[seen], turned[seen])
        arm = _Arm.of(robot.pose(rows.readings), poses[0])
        if arm.misfit(poses[1]) < MISFIT:
            continue
        _check_they_turn(rows, poses[1], group)
        held, conjugate = _other_columns(arm, poses[1]) or (IN_ORDER, False)
        ways = [_words(held, conjugate=conjugate), _other_angles(arm, poses[1])]
        if any(ways):
            fitting = ", or if ".join(filter(None, ways))
            noted = [NOTED] if held != IN_ORDER or ways[1] else []
            both = " or " if held == IN_ORDER else " and "
            how = both.join([*noted, *([OTHER_SIGN] if conjugate else [])])
            raise InputError(
                f"the orientations do not turn as {robot.name} does. They would if {fitting}",
                where=f"{', '.join(rows.files)}, group {group}",
                rule="qw qx qy qz, w first, turn vectors of the target into the world",
                way_out=f"Put that right ({how}), or use positions alone: --use position",
            )


def _check_they_turn(rows: Measurements, quaternions: Floats, group: str) -> None:
    """Raise InputError if quaternions (n, 4) of an arm that turns are all the same."""
    if np.abs(quaternions @ quaternions[0]).min() < np.cos(0.5 * SAME):
        return
    raise InputError(
        f"all {len(quaternions)} orientations are the same, while the arm turns the target",
        where=f"{', '.join(rows.files)}, group {group}",
        rule="Orientations are columns of what measures them: many instruments fill them in without",
        way_out="Leave out qw qx qy qz, or use positions alone: --use position",
    )


def _other_columns(arm: _Arm, quaternions: Floats) -> tuple[tuple[int, ...], bool] | None:
    """The order of the quaternions that fits, and whether they are conjugate; None where nothing fits."""
    for held, conjugate in READINGS:
        sense = np.where((np.arange(4) > 0) & conjugate, -1.0, 1.0)
        if arm.misfit(quaternions[:, np.argsort(held)] * sense) < FIT:
            return held, conjugate
    return None


def _other_angles(arm: _Arm, quaternions: Floats) -> str:
    """In words, what the numbers are that orientations were made from, so that they fit; "" if nothing."""
    some = np.linspace(0, len(quaternions) - 1, min(len(quaternions), MOST_POSES)).astype(np.int64)
    arm, quaternions = _Arm.of(arm.flanges[some], arm.points[some]), quaternions[some]
    found: dict[tuple[str, str], float] = {}
    for kinds, meant, others in otherwise_read(quaternions):
        near = arm.between_turns(others)[1] < AS_WELL * FIT
        for k in np.flatnonzero(near):
            off = arm.misfit(others[k])
            found[kinds[k], meant] = min(off, found.get((kinds[k], meant), off))
    least = min(found.values(), default=np.inf)
    if least >= FIT:
        return ""
    fitting = sorted((kinds for kinds, off in found.items() if off <= AS_WELL * least), key=usual_first)
    ways = [way for taken, meant in fitting[:MOST_NAMED] for way in with_twin(taken, meant)]
    pairs = ", or those for ".join(f"{taken} are {meant}" for taken, meant in dict.fromkeys(ways))
    return f"the angles that were taken for {pairs} (capitals: moving axes, small letters: fixed axes)"


def _words(held: tuple[int, ...], *, conjugate: bool) -> str:
    """A reading in words: what its columns hold, and how it turns; "" of the stated one."""
    order = f"the columns qw qx qy qz hold {' '.join(COMPONENTS[part] for part in held)}"
    turn = "they turn the other way: target_from_world, where world_from_target is wanted"
    if held == IN_ORDER:
        return turn if conjugate else ""
    return f"{order}, and {turn}" if conjugate else order


def _frame_and_tool(flanges: Floats) -> Floats:
    """How points (n, 3), row by row, move with the target in the flange and with the frame: (3 n, 6)."""
    moved = np.broadcast_to(np.eye(AXES), (len(flanges), AXES, AXES))
    return np.concatenate([flanges[:, :3, :3], moved], axis=2).reshape(-1, 2 * AXES)


def _turned_about(axis: Floats, points: Floats, flanges: Floats) -> Floats:
    """Points (n, 3) turned about a unit vector (3,) so that they fit the flanges best.

    Cosine and sine are found as if they were free, together with frame and tool.
    """
    along = np.outer(points @ axis, axis)
    around = points - along
    across = np.cross(axis, around)
    columns = np.column_stack([_frame_and_tool(flanges), -around.reshape(-1), -across.reshape(-1)])
    found = np.linalg.lstsq(columns, (along - flanges[:, :3, 3]).reshape(-1), rcond=None)[0]
    cosine, sine = found[-2:] / np.hypot(*found[-2:])
    return np.asarray(along + cosine * around + sine * across)


def _turns(frames: Floats) -> Floats:
    """Axis times sine of the angle (..., n - 1, 3) of the turn from each frame to the next, in the world."""
    turns = frames[..., 1:, :, :] @ np.swapaxes(frames[..., :-1, :, :], -1, -2)
    parts = [turns[..., i - 1, i - 2] - turns[..., i - 2, i - 1] for i in range(AXES)]
    return 0.5 * np.stack(parts, axis=-1)
