"""How sure it is that parameters vary: standard deviations of their differences from the mean."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from truearm.arrays import as_rows
from truearm.inputs import Features
from truearm.types import AXES, Floats

if TYPE_CHECKING:
    from truearm.calibration import Calibration


def variation_std(
    calibration: "Calibration", q: ArrayLike, names: Sequence[str], features: Features | None
) -> Floats:
    """Standard deviations (n, c), or (c,) for readings (N,), see Calibration.variation_std."""
    robot, arm = calibration.robot, calibration.arm
    rows, single = as_rows(q, robot.joint_count, what=f"joint readings of {robot.name}")
    count = AXES * -(-len(names) // AXES)
    picked = np.zeros((len(rows), count, arm.table.size))
    for k, name in enumerate(names):
        picked[:, k, arm.candidates.column(name)] = 1.0
    if not len(rows):
        return np.empty((0, len(names)))
    together = calibration.spread.joint(calibration.field_inputs(rows, features), picked)
    covariance = np.einsum("ikjk->kij", together.reshape(len(rows), count, len(rows), count))
    centred = covariance - covariance.mean(axis=1, keepdims=True)
    variances = np.einsum("kii->ik", centred - centred.mean(axis=2, keepdims=True))
    found = np.asarray(np.sqrt(np.maximum(variances[:, : len(names)], 0.0)))
    return found[0] if single else found
