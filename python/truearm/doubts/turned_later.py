"""A joint whose readings change their sign in the course of a set-up, as of another export of the rest."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truearm.doubts.nominal_misfit import FEWEST_ROWS, NominalArm, Seen
from truearm.doubts.of_results import FITS_OTHERWISE
from truearm.errors import Notice
from truearm.fits.fitting import Task
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

PARTS = 3
"""Of so many parts of a set-up the first and the last are each read in one way."""


@dataclass(frozen=True)
class Change:
    """A joint of which some readings have the other sign.

    Attributes:
        joint: Which, from 0.
        later: Whether those are the later ones.
        row: The first, or the last, of them, among the rows that were looked at.
        off_m: What the arm misses so, median, m.
    """

    joint: int
    later: bool
    row: int
    off_m: float


def turned_later(task: Task, data: Measurements, better: float, near_m: float) -> list[Notice]:
    """A notice where one joint's readings have the other sign from a row on, or up to it.

    Args:
        task: What was fitted to the measurements.
        data: The measurements, those of each set-up in the order of their files.
        better: Times that it brings the nominal arm closer.
        near_m: A nominal arm that is read rightly is nearer, m.
    """
    if task.selection.distances:
        return []
    target = data.most_held(task.selection.targets)
    groups = [np.flatnonzero(data.seen(target) & (data.group == group)) for group in task.groups]
    rows = max(groups, key=len)
    if len(rows) < PARTS * FEWEST_ROWS:
        return []
    arm, seen = NominalArm.of(task.arm.robot), Seen.of(data, target).select(rows)
    before_m = arm.misfit_m(seen, task.threads)
    found = _change(arm, seen, min(before_m / better, near_m), task.threads)
    if found is None:
        return []
    row = data.row_names(np.arange(len(data)) == rows[found.row])
    where = f"from {row} on" if found.later else f"up to {row}"
    off, instead = (length_mm(value * MM_PER_METRE, 3) for value in (found.off_m, before_m))
    text = (
        f"The measurements fit {task.arm.robot.name}, with a median of {off} in place of {instead} before "
        f"any calibration, if joint {found.joint + 1} is counted the other way {where}. Give all of its "
        "readings one sign, and calibrate again."
    )
    return [Notice(FITS_OTHERWISE, text)]


def _change(arm: NominalArm, seen: Seen, limit_m: float, threads: int | None) -> Change | None:
    """Where a joint's readings change their sign; None where none does with which the arm is near enough."""
    part = len(seen.readings) // PARTS
    ends = np.arange(part), np.arange(len(seen.readings))[-part:]
    right = [arm.misfit_m(seen.select(end), threads) < limit_m for end in ends]
    if sum(right) != 1:
        return None
    later = right[0]
    known, other = ends if later else ends[::-1]
    joint, off_m = _joint(arm, seen, other, threads)
    setup = arm.setup(seen.select(known), threads)
    if off_m >= limit_m or setup is None:
        return None
    own, turned = (arm.distances_m(each, setup) for each in (seen, _turned(seen, joint)))
    before, behind = (own, turned) if later else (turned, own)
    first = _first_behind(np.minimum(before, limit_m), np.minimum(behind, limit_m))
    off_m = float(np.median(np.concatenate([before[:first], behind[first:]])))
    return Change(joint, later, first if later else first - 1, off_m) if off_m < limit_m else None


def _joint(arm: NominalArm, seen: Seen, part: Rows, threads: int | None) -> tuple[int, float]:
    """The joint, from 0, with which turned a part of the rows fits best, and by how much it misses, m."""
    some = seen.select(part)
    off = [arm.misfit_m(_turned(some, joint), threads) for joint in range(seen.readings.shape[1])]
    return int(np.argmin(off)), float(min(off))


def _turned(seen: Seen, joint: int) -> Seen:
    """What was measured, with one joint counted the other way."""
    readings = seen.readings.copy()
    readings[:, joint] *= -1.0
    return replace(seen, readings=readings)


def _first_behind(before: Floats, behind: Floats) -> int:
    """The row from which on distances (n,) are best taken from those behind, with what is missed least."""
    missed = np.concatenate([[0.0], np.cumsum(before)]) + np.concatenate(
        [np.cumsum(behind[::-1])[::-1], [0.0]]
    )
    return int(missed.argmin())
