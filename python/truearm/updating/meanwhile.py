"""What stood otherwise from some row on while an arm was measured again: its calibration is not to blame."""

from collections.abc import Iterator

import numpy as np

from truearm.doubts.at_once import BESIDE, Left
from truearm.doubts.slips import Derivatives, Session, Slip, slips_of
from truearm.drifting import progress_of
from truearm.types import Floats, Rows
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
    progress = progress_of(scene.data)
    for number in range(len(task.groups)):
        values = np.flatnonzero(scene.number[linear.visit] == number)
        values = values[np.argsort(progress[linear.visit[values]], kind="stable")]
        rows, first = np.unique(progress[linear.visit[values]], return_index=True)
        if len(rows) < 2 * BESIDE:
            continue
        own, visit = np.ix_(values, values), np.searchsorted(rows, progress[linear.visit[values]])
        alone = _of_each(noise[own], linear.pose[values])
        left = Left(pull[values], metric[own], alone, visit, float(residual @ pull), freedom)
        by = Derivatives(
            linear.jacobian[values][:, unknowns.group(number)],
            linear.jacobian[values, : task.arm.robot.joint_count],
            is_point[values],
            task.arm.frame_unknowns,
            task.selection.targets,
        )
        several = len(task.groups) > 1
        yield Session(task.arm.robot, scene.data, linear.visit[values[first]], left, by, several)


def _of_each(noise: Floats, pose: Rows) -> Floats:
    """Inverse of a covariance (n, n) of which each pose's values are by themselves."""
    inverse = np.zeros_like(noise)
    for number in np.unique(pose):
        own = np.ix_(pose == number, pose == number)
        inverse[own] = np.linalg.inv(noise[own])
    return inverse
