"""What stood otherwise from some row on while an arm was measured again: its calibration is not to blame."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from truearm.doubts.at_once import BESIDE, Left
from truearm.doubts.slips import Derivatives, Session, Slip, slips_of
from truearm.drifting import Drift
from truearm.fits.enough_values import FRAME_UNKNOWNS
from truearm.types import Floats
from truearm.updating.estimating import Estimate, unexplained
from truearm.updating.scene import Scene


def meanwhile(scene: Scene, found: Estimate) -> list[Slip]:
    """What an estimate of what moved leaves as a step in the order of measuring."""
    return slips_of(list(_sessions(scene, found)))


def _sessions(scene: Scene, found: Estimate) -> Iterator[Session]:
    """The set-ups of a scene."""
    task, unknowns, linear = scene.task, scene.unknowns, found.linear
    metric, residual = unexplained(found, unknowns.std, unknowns.free)
    pull, noise = metric @ residual, scene.scatter(found.state)
    freedom = float(len(residual) - unknowns.free.sum())
    is_point = np.broadcast_to(~scene.orientation, scene.seen.shape)[scene.seen]
    progress, frame = Drift.none(scene.data).progress, 0 if task.arm.world_is_known else FRAME_UNKNOWNS
    for number in range(len(task.groups)):
        values = np.flatnonzero(scene.number[linear.pose] == number)
        values = values[np.argsort(progress[linear.pose[values]], kind="stable")]
        rows, first = np.unique(progress[linear.pose[values]], return_index=True)
        if len(rows) < 2 * BESIDE:
            continue
        own, visit = np.ix_(values, values), np.searchsorted(rows, progress[linear.pose[values]])
        alone = _of_each(noise[own], visit)
        left = Left(pull[values], metric[own], alone, visit, float(residual @ pull), freedom)
        by = Derivatives(
            linear.jacobian[values][:, unknowns.group(number)],
            linear.jacobian[values, : task.arm.robot.joint_count],
            is_point[values],
            frame,
            task.selection.targets,
        )
        several = len(task.groups) > 1
        yield Session(task.arm.robot, scene.data, linear.pose[values[first]], left, by, several)


def _of_each(noise: Floats, visit: NDArray[np.int64]) -> Floats:
    """Inverse of a covariance (n, n) of which each visit's values are by themselves."""
    inverse = np.zeros_like(noise)
    for number in range(visit[-1] + 1):
        own = np.ix_(visit == number, visit == number)
        inverse[own] = np.linalg.inv(noise[own])
    return inverse
