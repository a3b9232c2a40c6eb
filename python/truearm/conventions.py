"""Readings that would fit the nominal arm in another convention: directions, joint 3, a mirrored frame."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, combinations, product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.doubts import FITS_OTHERWISE
from truearm.errors import Notice, count_of
from truearm.fitting import Task
from truearm.measurements import Measurements
from truearm.nominal_misfit import FEWEST_ROWS, misfit_m, some_rows
from truearm.robot import Robot
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]

BETTER: Final = 5.0
"""Times that the right convention brings the nominal arm closer: one that is wrong leaves centimetres."""
NEAR_M: Final = 0.02
"""A nominal arm that is read rightly is nearer."""
AS_WELL: Final = 1.5
EXACT_M: Final = 1e-4
"""Conventions fit as well whose misfits are within this factor of the least, or are none to speak of."""
ALL_OF_JOINTS: Final = 7
"""With as many joints all combinations of them are tried, with more those of MOST_TURNED."""
MOST_TURNED: Final = 3
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

    @property
    def order(self) -> tuple[bool, int, bool]:
        """The least comes first: a left-handed frame beside other changes last, then few changes."""
        return self.mirrored and self.changes > 1, self.changes, self.mirrored

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

    Of an arm that is its own mirror image, as most with a spherical wrist are, a left-handed frame with some
    joints counted the other way is the same as a right-handed one with others: no measurement tells them
    apart. Of those that fit as well one with a right-handed frame is named, of these the one with the fewest
    changes, and that there are others is said. A left-handed frame alone, with all joints as the robot file
    has them, is one change: it is named where no single change of a right-handed frame fits.

    Args:
        task: What was fitted to the measurements.
        data: The measurements.
    """
    if task.selection.distances:
        return []
    target, robot = data.most_held(task.selection.targets), task.arm.robot
    rows = _some_rows(task, data, target)
    if len(rows) < FEWEST_ROWS:
        return []

    def misfit(convention: Convention) -> float:
        return misfit_m(convention.robot(robot), convention.points(rows), target, task.threads)

    before = misfit(Convention())
    found = {convention: misfit(convention) for convention in _conventions(robot) if convention.changes}
    best = min(found.values())
    if best >= min(before / BETTER, NEAR_M):
        return []
    fitting = [convention for convention, off in found.items() if off <= max(AS_WELL * best, EXACT_M)]
    named, *others = sorted(fitting, key=lambda convention: (convention.order, found[convention]))
    off, instead = (f"{value * MM_PER_METRE:.3g} mm" for value in (found[named], before))
    instead = f" in place of {instead}" if np.isfinite(before) else ""
    text = (
        f"The measurements fit {robot.name}, with a median of {off}{instead} before any "
        f"calibration, if {named.words(robot)}. Put that right in a robot file of the arm or "
        f"in the measurements, and calibrate again.{_words_of_others(robot, others)}"
    )
    return [Notice(FITS_OTHERWISE, text)]


def _words_of_others(robot: Robot, others: list[Convention]) -> str:
    """That, and what, fits as well as what was named."""
    if not others:
        return ""
    rest = f", or in {count_of(len(others) - 1, 'other way')}" if len(others) > 1 else ""
    return (
        f" They fit as well if {others[0].words(robot)}{rest}: measurements alone do not tell which is true. "
        "Jog each joint that is named, and look which way it turns."
    )


def _some_rows(task: Task, data: Measurements, target: int) -> Measurements:
    """Some rows of the set-up with the most, with points that were measured."""
    seen = np.isfinite(data.targets[:, target]).all(axis=1)
    groups = [np.flatnonzero(seen & (data.group == group)) for group in task.groups]
    return data.select(some_rows(max(groups, key=len)))


def _conventions(robot: Robot) -> Iterator[Convention]:
    """All conventions of a robot; with many joints those that turn few of them."""
    count = robot.joint_count
    most = count if count <= ALL_OF_JOINTS else MOST_TURNED
    turned = chain.from_iterable(combinations(range(count), turning) for turning in range(most + 1))
    coupled: list[float | None] = [None]
    if robot.joints[:3] == ("revolute",) * 3:
        known = float(robot.coupling[ELBOW, SHOULDER])
        coupled += [value for value in (0.0, 1.0, -1.0) if value != known]
    yield from (Convention(*parts) for parts in product(turned, coupled, (False, True)))
