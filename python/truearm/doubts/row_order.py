"""Whether rows were measured in an order of their poses, so that time and pose cannot be told apart."""

from typing import Final

import numpy as np

from truearm.defaults import NO_DRIFT
from truearm.errors import Notice
from truearm.fits.fitting import Task
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.rows.visits import visit_numbers
from truearm.types import Floats

FEWEST_VISITS: Final = 30
FOLLOWED: Final = 0.6
"""Share of the variance of the rows' numbers that their poses explain, from which it is told."""
ORDER_OF_POSES: Final = "order_of_poses"
WINDOW: Final = 10
"""Visits before and behind a place whose poses are compared."""
FEWEST_BEHIND: Final = 3
SURELY: Final = 4.0
"""Difference of two means, in its standard errors, that chance hardly brings."""
LARGE: Final = 1.0
"""Difference of two means, in standard deviations of all poses, that errors may change by at once."""


def order_notices(task: Task, data: Measurements, progress: Floats) -> list[Notice]:
    """A notice where the order of the rows of a set-up follows their poses.

    Args:
        task: Which arm; its option `drift` may say that the rows are in no order.
        data: All rows, as they were measured.
        progress: When each was measured, from 0 for the first of its set-up to 1 for the last (n,).
    """
    if task.options.drift == NO_DRIFT:
        return []
    ordered = {group: places(task, data, progress, group)[0] for group in task.groups}
    shares = {group: share_explained(poses, np.arange(float(len(poses)))) for group, poses in ordered.items()}
    told = [f"{share:.0%} in {group}" for group, share in shares.items() if share > FOLLOWED]
    if not told:
        return []
    text = (
        "The rows come in an order of their poses: joint readings and place tell most of when a row was "
        f"measured ({', '.join(told)}). What drifts meanwhile cannot be distinguished there from what varies "
        "with the pose, and held-out rows do not show it. Measure in another order, such as the one there "
        "and back that truearm plan gives. If the rows were sorted later, give them in the order of "
        "measuring, or --drift none."
    )
    return [Notice(ORDER_OF_POSES, text)]


def places(task: Task, data: Measurements, progress: Floats, group: str) -> tuple[Floats, Floats]:
    """Poses of the visits of a set-up in the order of measuring.

    Returns:
        Of each visit the joint readings and the nominal place of the flange (v, N + 3), rad and m; and its
        progress (v,).
    """
    own = np.flatnonzero(data.group == group)
    own = own[np.argsort(progress[own], kind="stable")]
    _, first = np.unique(visit_numbers(data.readings[own], data.group[own]), return_index=True)
    own = own[first]
    return poses_of(task.arm.robot, data.readings[own]), progress[own]


def poses_of(robot: Robot, readings: Floats) -> Floats:
    """Joint readings and the nominal place of the flange (v, N + 3), rad and m."""
    flange = robot.flange_chain.position(robot.joints_from_readings(readings))
    return np.hstack([readings, flange])


def poses_change(poses: Floats, when: Floats, between: tuple[float, float]) -> bool:
    """Whether poses (v, F) change at once between two times, from one sort to another.

    Args:
        poses: In the order of measuring.
        when: Times of the poses (v,).
        between: The last time before and the first behind.
    """
    before, behind = poses[when <= between[0]][-WINDOW:], poses[when >= between[1]][:WINDOW]
    if min(len(before), len(behind)) < FEWEST_BEHIND:
        return False
    apart = np.abs(before.mean(axis=0) - behind.mean(axis=0))
    error = np.sqrt(before.var(axis=0, ddof=1) / len(before) + behind.var(axis=0, ddof=1) / len(behind))
    return bool(((apart > SURELY * error) & (apart > LARGE * poses.std(axis=0))).any())


def share_explained(poses: Floats, values: Floats) -> float:
    """Share of the variance of values (v,) that a linear function of poses (v, F) has beyond chance."""
    count = len(poses)
    if count < FEWEST_VISITS:
        return 0.0
    wide = poses[:, np.ptp(poses, axis=0) > 0.0]
    basis = np.column_stack([np.ones(count), (wide - wide.mean(axis=0)) / wide.std(axis=0)])
    fitted, _, rank, _ = np.linalg.lstsq(basis, values, rcond=None)
    free = count - int(rank)
    if free < 1:
        return 0.0
    left = np.square(values - basis @ fitted).sum() / free
    return float(max(0.0, 1.0 - left / values.var(ddof=1)))
