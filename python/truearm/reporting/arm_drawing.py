"""The arm as a line in space: the frames of its chain at one pose, and the way from each to the next."""

from itertools import pairwise
from typing import Any

import numpy as np

from truearm._core import Chain
from truearm.fits.parameters import A, D
from truearm.reporting.numbers import lean
from truearm.robot import Robot
from truearm.types import Floats
from truearm.units import MM_PER_METRE


def link_path(robot: Robot, readings: Floats, end: Floats) -> tuple[Floats, Floats]:
    """Corners (k, 3) of the arm's line from base to `end`, and the joints' places (N, 3), base frame, m.

    Between two frames the line follows d and a of the Denavit-Hartenberg row, so that offsets show.

    Args:
        robot: The nominal arm.
        readings: Joint readings (N,).
        end: Point (3,) in the flange frame that the line ends at.
    """
    values = robot.joints_from_readings(readings[None])
    frames = [robot.base, *(_frame(robot, values, count) for count in range(1, robot.joint_count + 1))]
    corners = [robot.base[:3, 3]]
    for row, (before, after) in enumerate(pairwise(frames)):
        corners += [_corner(robot, before, row, values[0, row]), after[:3, 3]]
    last = frames[-1] @ robot.flange
    corners += [last[:3, 3], last[:3, :3] @ end + last[:3, 3]]
    return np.array(corners), np.array([frame[:3, 3] for frame in frames[:-1]])


def _frame(robot: Robot, values: Floats, count: int) -> Floats:
    """Pose (4, 4) of the frame behind the first `count` rows."""
    chain = Chain(
        robot.convention, list(robot.joints[:count]), robot.table[:count].copy(), robot.base, np.eye(4)
    )
    return np.asarray(chain.pose(np.ascontiguousarray(values[:, :count]))[0])


def _corner(robot: Robot, before: Floats, row: int, value: float) -> Floats:
    offset = np.zeros(3)
    if robot.convention == "standard":
        offset[2] = robot.table[row, D] + (value if robot.joints[row] == "prismatic" else 0.0)
    else:
        offset[0] = robot.table[row, A]
    return np.asarray(before[:3, :3] @ offset + before[:3, 3])


def arm_traces(robot: Robot, readings: Floats, end: Floats) -> list[dict[str, Any]]:
    """The arm as traces of a scene in mm: a thick line, and its joints."""
    corners, joints = (MM_PER_METRE * places for places in link_path(robot, readings, end))
    body = {"mode": "lines", "line": {"color": "@arm", "width": 9}, "hoverinfo": "skip"}
    knots = {"mode": "markers", "marker": {"color": "@joint", "size": 5}, "hoverinfo": "skip"}
    return [
        {"type": "scatter3d", "name": "arm", **_places(corners), **body},
        {"type": "scatter3d", "name": "joints", **_places(joints), **knots},
    ]


def _places(points: Floats) -> dict[str, Any]:
    return {name: lean(points[:, k]) for k, name in enumerate("xyz")}
