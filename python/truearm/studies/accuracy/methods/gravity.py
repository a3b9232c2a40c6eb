"""Constant D-H with joints that give way to gravity; links weigh at their ends, the base is upright."""

from typing import Final

import numpy as np

from truearm.studies.accuracy.fitted import Correction
from truearm.studies.accuracy.methods.linear import Ridge, fit_linear
from truearm.studies.accuracy.methods.searching import Effort
from truearm.studies.accuracy.poses import Poses
from truearm.types import Floats

COMPLIANCES: Final = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
"""Standard deviations of compliance times weight, rad per metre of lever."""


def torque_columns(poses: Poses) -> Floats:
    """Derivatives of the position with respect to compliance times weight, joint by link (n, 3, N L).

    A joint's torque is the sum over the links of their weight times the change of their end's height with the
    joint; it turns the joint by its compliance times that.
    """
    moves, levers = poses.joint_columns(), poses.heights  # (n, 3, N), (n, L, N)
    found: Floats = np.einsum("nij,nlj->nijl", moves, levers).reshape(len(poses), 3, -1)
    return found


def fit_gravity(poses: Poses, residuals: Floats, effort: Effort) -> Correction:
    """Compliances with the ridge that predicts best."""
    count = poses.heights.shape[1] * poses.heights.shape[2]
    family = [
        Ridge(torque_columns, np.eye(count) / size**2, {"compliance": size})
        for size in effort.some(COMPLIANCES)
    ]
    return fit_linear([family], poses, residuals, effort)
