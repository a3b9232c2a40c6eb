"""Readings that would fit the nominal arm in another convention: directions, joint 3, a mirrored frame."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, combinations, product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import CoreError, fit_constant
from truearm.core_set import Selection, core_set
from truearm.errors import Notice
from truearm.fitting import Task, fit_options
from truearm.identified import IdentifiedArm
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.units import MM_PER_METRE
from truearm.validation import row_errors

Floats = NDArray[np.float64]

BETTER: Final = 5.0
"""Times that the right convention brings the nominal arm closer: one that is wrong leaves centimetres."""
NEAR_M: Final = 0.02
"""A nominal arm that is read rightly is nearer."""
MOST_ROWS: Final = 60
FEWEST_ROWS: Final = 12
MOST_CHANGES: Final = 4
SHOULDER, ELBOW = 1, 2
MIRROR: Final = np.array([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Convention:
    """How readings and points may have to be read.

    Attributes:
        turned: Joints, from 0, that the controller counts the other way.
        coupled: How much joint 2's reading turns joint 3; None as the robot file has it.
        mirrored: Whether the device's frame is left-handed.
    """

    turned: tuple[int, ...] = ()
    coupled: float | None = None
    mirrored: bool = False

    @property
    def changes(self) -> int:
        """In how much it differs from what robot file and measurements say."""
        return len(self.turned) + (self.coupled is not None) + self.mirrored

    def robot(self, robot: Robot) -> Robot:
        """A robot with directions and coupling of this convention."""
        coupling = robot.coupling.copy()
        if self.coupled is not None:
            coupling[ELBOW, SHOULDER] = self.coupled
        coupling[:, self.turned] *= -1.0
        return replace(robot, coupling=coupling)

    def points(self, data: Measurements) -> Measurements:
        """Measurements with the points of this convention."""
        return replace(data, targets=data.targets * MIRROR) if self.mirrored else data

    def words(self, robot: Robot) -> str:
        """What is otherwise, and what the robot file then says."""
        own, parts = self.robot(robot), list[str]()
        signs = np.where(np.diag(own.coupling) < 0.0, -1.0, 1.0)
        parts += [
            f"joint {joint + 1} is counted the other way (direction = {signs[joint]:.0f} in its link)"
            for joint in self.turned
        ]
        if self.coupled is not None:
            row = ", ".join(f"{entry + 0.0:g}" for entry in own.coupling[ELBOW] * signs)
            against = "the horizontal" if self.coupled else "link 2"
            parts.append(f"joint 3 is counted against {against} (row 3 of [coupling] is [{row}])")
        if self.mirrored:
            parts.append("the device's frame is left-handed (one axis reversed, or two exchanged)")
        return ", and ".join(parts)


def fits_otherwise(task: Task, data: Measurements) -> list[Notice]:
    """A notice where the nominal arm fits measured points far better in another convention.

    Conventions with few changes come first; the best of those with as few is named.

    Args:
        task: What was fitted to the measurements.
        data: The measurements.
    """
    if task.selection.distances:
        return []
    rows = _some_rows(task, data)
    if len(rows) < FEWEST_ROWS:
        return []
    robot = task.arm.robot
    before = _misfit_m(task, rows, Convention())
    for changes in range(1, MOST_CHANGES + 1):
        tried = [convention for convention in _conventions(robot) if convention.changes == changes]
        misfits = [_misfit_m(task, rows, convention) for convention in tried]
        best = int(np.argmin(misfits))
        if misfits[best] < min(before / BETTER, NEAR_M):
            off, instead = (f"{value * MM_PER_METRE:.3g} mm" for value in (misfits[best], before))
            text = (
                f"The measurements fit {robot.name}, with a median of {off} in place of {instead} before any "
                f"calibration, if {tried[best].words(robot)}. Put that right in a robot file of the arm or "
                "in the measurements, and calibrate again."
            )
            return [Notice("fits_otherwise", text)]
    return []


def _some_rows(task: Task, data: Measurements) -> Measurements:
    """Some rows of the set-up with the most, with points that were measured."""
    seen = np.isfinite(data.targets[:, task.selection.targets[0]]).all(axis=1)
    groups = [np.flatnonzero(seen & (data.group == group)) for group in task.groups]
    rows = max(groups, key=len)
    return data.select(rows[np.unique(np.linspace(0, len(rows) - 1, MOST_ROWS).astype(np.int64))])


def _conventions(robot: Robot) -> Iterator[Convention]:
    """All conventions of a robot."""
    joints = range(robot.joint_count)
    turned = list(chain.from_iterable(combinations(joints, count) for count in range(MOST_CHANGES + 1)))
    coupled: list[float | None] = [None]
    if robot.joints[:3] == ("revolute",) * 3:
        known = float(robot.coupling[ELBOW, SHOULDER])
        coupled += [value for value in (0.0, 1.0, -1.0) if value != known]
    yield from (Convention(*parts) for parts in product(turned, coupled, (False, True)))


def _misfit_m(task: Task, rows: Measurements, convention: Convention) -> float:
    """Median distance of points from where the nominal arm, its frame and target fitted, has them."""
    arm, data = IdentifiedArm(convention.robot(task.arm.robot)), convention.points(rows)
    own = replace(task, arm=arm, selection=Selection(task.selection.targets[:1]), groups=data.groups)
    measured = core_set(arm.robot, data, own.selection, own.groups)
    try:
        setup = fit_constant(own.problem(measured, []), fit_options(own)).setup
    except CoreError:
        return np.inf
    errors = row_errors(arm, data, own.selection, own.groups, arm.table, setup)
    return float(np.nanmedian(errors.distance_m))
