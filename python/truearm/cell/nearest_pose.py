"""Readings that bring the nominal tool to a pose, nearest to given ones."""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from truearm.errors import WorkError
from truearm.robot import Robot

Floats = NDArray[np.float64]

STEPS: Final = 60
LONGEST_STEP_RAD: Final = 0.2
DAMPING: Final = 1e-6
TOLERANCE_M: Final = 1e-5
LEVER_M: Final = 0.3


def readings_for_pose(arm: Robot, base_from_tool: Floats, seed: Floats) -> Floats:
    """Readings (N,) whose nominal pose is closest to a pose (4, 4), by damped Newton steps from `seed`.

    With fewer than six joints the point is met, and of the orientation what the arm can.

    Raises:
        WorkError: If the point is out of reach.
    """
    readings = np.array(seed, dtype=np.float64)
    weights = np.array([1.0, 1.0, 1.0, LEVER_M, LEVER_M, LEVER_M])
    if arm.joint_count < 6:
        weights[3:] *= 1e-2
    for _ in range(STEPS):
        jacobian = arm.joint_jacobian(readings, pose=True) * weights[:, None]
        missing = weights * _difference(arm.pose(readings), base_from_tool)
        normal = jacobian.T @ jacobian + DAMPING * np.eye(arm.joint_count)
        step = np.clip(np.linalg.solve(normal, jacobian.T @ missing), -LONGEST_STEP_RAD, LONGEST_STEP_RAD)
        readings = np.clip(readings + step, *arm.limits.T)
    off_m = float(np.linalg.norm(arm.position(readings) - base_from_tool[:3, 3]))
    if off_m > TOLERANCE_M:
        raise WorkError(
            f"the pose is out of reach: the nearest is {1e3 * off_m:.2f} mm away",
            rule="A pose must be reachable from the present one within the joint limits",
        )
    return readings


def _difference(pose: Floats, target: Floats) -> Floats:
    """Translation and rotation vector (6,) from a pose to another, in the base frame."""
    turn = Rotation.from_matrix(target[:3, :3] @ pose[:3, :3].T).as_rotvec()
    return np.concatenate([target[:3, 3] - pose[:3, 3], turn])
