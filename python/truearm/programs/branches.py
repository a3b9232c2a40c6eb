"""Which of its postures a six-axis arm with a spherical wrist is in: the geometry behind configuration data.

Vendors name these postures differently and agree on where they change: where the wrist centre passes axis 1,
where the arm is stretched, and where axes 4 and 6 are in line.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm._core import Chain
from truearm.errors import InputError
from truearm.robot import Robot
from truearm.types import Floats
from truearm.units import FULL_TURN

MEET_M: Final = 1e-6
PARALLEL: Final = 1e-6


@dataclass(frozen=True, eq=False)
class Branches:
    """The postures of an arm; every method takes readings (n, 6), rad.

    Attributes:
        robot: The arm.
        above: 1 or -1: where the wrist centre is in front, axis 3 is above the line from axis 2 to it where
            the elbow times this is positive.
    """

    robot: Robot
    above: float
    _to_wrist: Chain
    _forward: Floats
    _on_axis_1: Floats
    _stretched: float
    _sense: float

    @classmethod
    def of(cls, robot: Robot) -> "Branches":
        """The postures of `robot`.

        Raises:
            InputError: If it is no arm of six revolute axes with parallel axes 2 and 3 whose last three meet.
        """
        if robot.joints != ("revolute",) * 6:
            raise _unsuited(robot, "it has not six revolute axes")
        points, directions = _axes(robot)
        wrist = _meeting(points[3:], directions[3:])
        if wrist is None:
            raise _unsuited(robot, "its last three axes do not meet in a point")
        if np.linalg.norm(np.cross(directions[1], directions[2])) > PARALLEL:
            raise _unsuited(robot, "its second and third axis are not parallel")
        upper = _across(points[2] - points[1], directions[1])
        fore = _across(wrist - points[2], directions[1])
        swept = np.arctan2(np.dot(np.cross(fore, upper), directions[2]), np.dot(fore, upper))
        forward = np.cross(directions[1], directions[0])
        if np.linalg.norm(forward) < PARALLEL:
            raise _unsuited(robot, "its first two axes are parallel")
        sense = float(np.sign(robot.coupling[2, 2]))
        forward *= np.sign(forward @ robot.base[:3, 0] or 1.0) / np.linalg.norm(forward)
        up = directions[0] * np.sign(directions[0] @ robot.base[:3, 2] or 1.0)
        return cls(
            robot,
            float(np.sign(sense * directions[2] @ np.cross(up, forward))),
            _chain_to(robot, wrist),
            forward,
            points[0],
            float(swept),
            sense,
        )

    def reach(self, q: Floats) -> Floats:
        """How far the wrist centre is in front of axis 1, m, (n,), negative behind it.

        In front is, with axis 1 at zero, where the base's x axis points.
        """
        turned = np.array(q)
        turned[:, 0] = 0.0
        values = np.ascontiguousarray(self.robot.joints_from_readings(turned)[:, :3])
        reach: Floats = (self._to_wrist.position(values) - self._on_axis_1) @ self._forward
        return reach

    def bent(self, q: Floats) -> Floats:
        """How far axis 3 is turned from the stretched arm, rad, (n,), in its own sense, whole turns included.

        Within half a turn for every arm that cannot fold through itself.
        """
        bent: Floats = self._sense * (self.robot.joints_from_readings(q)[:, 2] - self._stretched)
        return bent

    def elbow(self, q: Floats) -> Floats:
        """The same within half a turn."""
        return _half_turn(self.bent(q))

    def wrist(self, q: Floats) -> Floats:
        """How far axis 5 is turned from where axes 4 and 6 are in line, rad, (n,), within half a turn."""
        return _half_turn(q[:, 4])


def _axes(robot: Robot) -> tuple[Floats, Floats]:
    """A point on each axis and its direction, (6, 3) each, at zero readings, in the base frame."""
    points, directions = np.empty((6, 3)), np.empty((6, 3))
    for axis in range(6):
        links = axis if robot.convention == "standard" else axis + 1
        frame = robot.base if links == 0 else _partial(robot, links, np.eye(4)).pose(np.zeros((1, links)))[0]
        points[axis], directions[axis] = frame[:3, 3], frame[:3, 2]
    return points, directions


def _partial(robot: Robot, links: int, end: Floats) -> Chain:
    table = np.ascontiguousarray(robot.table[:links])
    return Chain(robot.convention, list(robot.joints[:links]), table, robot.base, end)


def _chain_to(robot: Robot, wrist_in_base: Floats) -> Chain:
    """The chain of the first three joints to a point that they carry, given at zero readings."""
    frame = _partial(robot, 3, np.eye(4)).pose(np.zeros((1, 3)))[0]
    end = np.eye(4)
    end[:3, 3] = frame[:3, :3].T @ (wrist_in_base - frame[:3, 3])
    return _partial(robot, 3, end)


def _meeting(points: Floats, directions: Floats) -> Floats | None:
    """The point where lines meet; None if they do not."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    wanted = (across @ points[:, :, None]).sum(axis=0)[:, 0]
    place: Floats = np.linalg.lstsq(across.sum(axis=0), wanted, rcond=None)[0]
    apart = np.linalg.norm((across @ (place - points)[:, :, None])[:, :, 0], axis=1)
    return place if apart.max() < MEET_M else None


def _across(vector: Floats, direction: Floats) -> Floats:
    """The part of a vector at right angles to a direction."""
    across: Floats = vector - np.dot(vector, direction) * direction
    return across


def _half_turn(angles: Floats) -> Floats:
    wrapped: Floats = angles - FULL_TURN * np.round(angles / FULL_TURN)
    return wrapped


def _unsuited(robot: Robot, why: str) -> InputError:
    return InputError(
        f"the configuration data of {robot.name} cannot be computed: {why}",
        rule="Six revolute axes, 1 and 2 crosswise, 2 and 3 parallel, 4 to 6 meeting in the wrist centre",
        way_out="Write its targets as joints",
    )
