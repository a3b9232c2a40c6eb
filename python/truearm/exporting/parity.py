"""Forward kinematics of a written file against those of the calibration."""

from collections.abc import Callable
from typing import Final

import numpy as np

from truearm.errors import WorkError
from truearm.robot import Robot
from truearm.types import Floats

Poses = Callable[[Floats], Floats]

WITHIN_M: Final = 1e-9
POSES: Final = 200
OPEN_REACH_M: Final = 1.0


def largest_difference(robot: Robot, first: Poses, second: Poses) -> float:
    """Largest difference of two models' poses at readings drawn over the limits: m, or rad times a metre."""
    low, high = robot.finite_limits(OPEN_REACH_M)
    q = np.random.default_rng(0).uniform(low, high, (POSES, robot.joint_count))
    return float(np.abs(first(q) - second(q)).max())


def checked(robot: Robot, reloaded: Poses, what: str) -> float:
    """The largest difference between the robot's flange and what a written file makes of it.

    Raises:
        WorkError: If it exceeds 1e-9 m.
    """
    difference = largest_difference(robot, lambda q: flange_poses(robot, q), reloaded)
    if not difference <= WITHIN_M:
        raise WorkError(
            f"read again, {what} differs from the calibration by {difference:.1e} m",
            rule=f"It must be within {WITHIN_M:.0e} m; nothing was written",
        )
    return difference


def flange_poses(robot: Robot, q: Floats) -> Floats:
    """base_from_flange (n, 4, 4) at readings (n, N)."""
    return robot.flange_chain.pose(np.ascontiguousarray(robot.joints_from_readings(q)))
