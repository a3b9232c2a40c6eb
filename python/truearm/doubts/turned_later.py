"""A joint whose readings change their sign in the course of a set-up, or have it in one set-up alone, as of
another export of the rest.
"""

from dataclasses import dataclass, replace

import numpy as np

from truearm.doubts.nominal_misfit import FEWEST_ROWS, NominalArm, Seen
from truearm.doubts.of_results import FITS_OTHERWISE
from truearm.errors import Notice
from truearm.fits.fitting import Task
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.rows.evenly import some_rows
from truearm.types import Floats, Rows
from truearm.units import MM_PER_METRE

PARTS = 3
"""Of so many parts of a set-up the first and the last are each read in one way."""


@dataclass(frozen=True)
class Change:
    """A joint of which some readings of a set-up have the other sign.

    Attributes:
        joint: Which, from 0.
        off_m: What the arm misses so, median, m.
        later: Whether those are the later ones.
        row: The first, or the last, of them, among the rows that were looked at; None where all have it.
    """

    joint: int
    off_m: float
    later: bool = False
    row: int | None = None


def turned_in_setups(task: Task, data: Measurements, better: float, near_m: float) -> list[Notice]:
    """Notices of set-ups in which one joint's readings have the other sign, where another is read rightly.

    Arguments are those of `turned_later`.
    """
    groups = _setups(task, data)
    if len(groups) < 2:
        return []
    arm, seen = NominalArm.of(task.arm.robot), Seen.of(data, data.most_held(task.selection.targets))
    before_m = [arm.misfit_m(seen.select(some_rows(rows)), task.threads) for rows in groups]
    if min(before_m) >= near_m:
        return []
    told = list[Notice]()
    for rows, off_m in zip(groups, before_m, strict=True):
        own, limit_m = seen.select(rows), min(off_m / better, near_m)
        found = None
        if off_m >= near_m:
            found = _change(arm, own, limit_m, task.threads) or _throughout(arm, own, limit_m, task.threads)
        if found is not None:
            told.append(_notice(task, data, rows, found, off_m))
    return told


def turned_later(task: Task, data: Measurements, better: float, near_m: float) -> list[Notice]:
    """A notice where a joint's readings of the largest set-up have the other sign from a row on, or up to it.

    Args:
        task: What was fitted to the measurements.
        data: The measurements, those of each set-up in the order of their files.
        better: Times that it brings the nominal arm closer.
        near_m: A nominal arm that is read rightly is nearer, m.
    """
    groups = _setups(task, data)
    if not groups:
        return []
    rows = max(groups, key=len)
    arm = NominalArm.of(task.arm.robot)
    seen = Seen.of(data, data.most_held(task.selection.targets)).select(rows)
    before_m = arm.misfit_m(seen, task.threads)
    found = _change(arm, seen, min(before_m / better, near_m), task.threads)
    return [] if found is None else [_notice(task, data, rows, found, before_m)]


def _setups(task: Task, data: Measurements) -> list[Rows]:
    """Rows of each set-up with a point, where these are enough to tell; none of distances."""
    if task.selection.distances:
        return []
    seen = data.seen(data.most_held(task.selection.targets))
    groups = [np.flatnonzero(seen & (data.group == group)) for group in task.groups]
    return [rows for rows in groups if len(rows) >= FEWEST_ROWS]


def _notice(task: Task, data: Measurements, rows: Rows, found: Change, before_m: float) -> Notice:
    """What would fit, and what to do; `rows` are those of the set-up."""
    group, several = data.group[rows[0]], len(task.groups) > 1
    where = f"in all rows of {group}"
    if found.row is not None:
        row = data.row_names(np.arange(len(data)) == rows[found.row])
        where = f"from {row} on" if found.later else f"up to {row}"
    off, instead = (length_mm(value * MM_PER_METRE, 3) for value in (found.off_m, before_m))
    text = (
        f"The measurements{several * f' of {group}'} fit {task.arm.robot.name}, with a median of {off} in "
        f"place of {instead} before any calibration, if joint {found.joint + 1} is counted the other way "
        f"{where}. Give all of its readings one sign, and calibrate again."
    )
    return Notice(FITS_OTHERWISE, text)


def _throughout(arm: NominalArm, seen: Seen, limit_m: float, threads: int | None) -> Change | None:
    """The joint all of whose readings have the other sign; None where none does with which the arm is near
    enough.
    """
    joint, off_m = _joint(arm, seen, some_rows(np.arange(len(seen.readings))), threads)
    return Change(joint, off_m) if off_m < limit_m else None


def _change(arm: NominalArm, seen: Seen, limit_m: float, threads: int | None) -> Change | None:
    """Where a joint's readings change their sign; None where none does with which the arm is near enough."""
    part = len(seen.readings) // PARTS
    if part < FEWEST_ROWS:
        return None
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
    return Change(joint, off_m, later, first if later else first - 1) if off_m < limit_m else None


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
