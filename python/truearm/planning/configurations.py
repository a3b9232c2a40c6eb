"""Configurations: the branches in which an arm can reach one point."""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from truearm._core import Chain
from truearm.errors import UsageError
from truearm.kinds import check_values
from truearm.robot import Robot
from truearm.types import Floats

FEWEST_JOINTS: Final = 3
WORDS: Final = {"arm": ("front", "back"), "elbow": ("up", "down"), "wrist": ("noflip", "flip")}


@dataclass(frozen=True)
class Configuration:
    """A branch of the inverse kinematics, named by arm, elbow and wrist; None where it does not matter.

    Attributes:
        arm: "front" where the wrist lies on that side of joint 1's axis to which the x axis of link 1 points.
        elbow: "up" where the elbow lies above the line from shoulder to wrist as seen with the arm in front;
            it changes only where the arm is straight.
        wrist: "noflip" where the sine of the last joint but one is not negative.
    """

    arm: Literal["front", "back"] | None = None
    elbow: Literal["up", "down"] | None = None
    wrist: Literal["noflip", "flip"] | None = None

    def __post_init__(self) -> None:
        check_values(self, choices={name: (None, *known) for name, known in WORDS.items()})

    def holds(self, robot: Robot, readings: Floats) -> NDArray[np.bool_]:
        """Whether readings (n, N) are in this configuration, (n,)."""
        held = np.ones(len(readings), dtype=np.bool_)
        values = robot.joints_from_readings(readings)
        if self.wrist is not None:
            sine = np.sin(values[:, -2])
            held &= (sine >= 0.0) if self.wrist == "noflip" else (sine < 0.0)
        if self.arm is None and self.elbow is None:
            return held
        elbow, wrist = _in_plane_of_arm(robot, values)
        if self.arm is not None:
            held &= (wrist[:, 0] > 0.0) == (self.arm == "front")
        if self.elbow is not None:
            below = elbow[:, 0] * wrist[:, 1] - elbow[:, 1] * wrist[:, 0]
            held &= (below < 0.0) == (self.elbow == "up")
        return held


def _in_plane_of_arm(robot: Robot, values: Floats) -> tuple[Floats, Floats]:
    """Elbow and wrist (n, 2), from the shoulder: along the x axis of link 1, and up joint 1's axis."""
    if robot.joint_count < FEWEST_JOINTS:
        raise UsageError(f"{robot.name} has {robot.joint_count} joints", rule="Arm and elbow need three")
    standard = robot.convention == "standard"
    first = link_frames(robot, values, 1)
    links = (1, 2, 3) if standard else (2, 3, min(4, robot.joint_count))
    shoulder, elbow, wrist = (link_frames(robot, values, link)[:, :3, 3] for link in links)
    axis = np.broadcast_to(robot.base[:3, 2], shoulder.shape) if standard else first[:, :3, 2]
    up = axis * np.where(axis[:, 2:] >= 0.0, 1.0, -1.0)
    plane = np.stack([first[:, :3, 0], up], axis=1)
    return (
        np.einsum("nij,nj->ni", plane, elbow - shoulder),
        np.einsum("nij,nj->ni", plane, wrist - shoulder),
    )


def link_frames(robot: Robot, values: Floats, link: int) -> Floats:
    """base_from_link (n, 4, 4) of a link, from 1, at Denavit-Hartenberg joint values (n, N)."""
    rows = np.ascontiguousarray(robot.table[:link])
    chain = Chain(robot.convention, list(robot.joints[:link]), rows, robot.base, np.eye(4))
    return chain.pose(np.ascontiguousarray(values[:, :link]))
