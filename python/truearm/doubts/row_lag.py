"""Readings that belong to the points of other rows: a log began a row late, or lost one on the way."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import Setup
from truearm.doubts.conventions import BETTER, NEAR_M
from truearm.doubts.nominal_misfit import FEWEST_ROWS, NominalArm, Seen
from truearm.doubts.of_results import ROWS_SHIFTED
from truearm.errors import Notice, count_of
from truearm.fits.fitting import Task
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.rows.evenly import some_rows
from truearm.types import Floats, Rows
from truearm.units import MM_PER_METRE

LAGS: Final = (0, 1, -1, 2, -2)
"""By how many rows the readings of a point may stand further on: logs lose one or two."""
PARTS: Final = 3
"""A part of this many is where frame and target are looked for: some part lies between two losses."""
CHANGE: Final = 2.0
"""What a change of the lag costs, in rows that fit nowhere: so many fit by chance, or are outliers."""
ROUNDS: Final = 3
"""Times that frame and target are found again from all rows that fit."""


@dataclass(frozen=True, eq=False)
class _Rows:
    """The rows of a set-up in the order of their files, and the arm that is said to have been measured."""

    robot: Robot
    data: Measurements
    target: int
    threads: int | None

    @cached_property
    def arm(self) -> NominalArm:
        """The arm up to its flange."""
        return NominalArm.of(self.robot)

    @property
    def seen(self) -> Rows:
        """Rows with a measured point."""
        return np.flatnonzero(self.data.seen(self.target))

    def has_partner(self, rows: Rows, lag: int | Rows) -> NDArray[np.bool_]:
        """Whether there are readings so many rows further on (m,)."""
        return np.asarray((rows + lag >= 0) & (rows + lag < len(self.data)))

    def setup(self, rows: Rows, lag: int | Rows) -> Setup | None:
        """Frame and target that rows tell; None where they cannot."""
        if len(rows) < FEWEST_ROWS:
            return None
        some = some_rows(np.arange(len(rows)))
        lags = np.broadcast_to(lag, rows.shape)
        return self.arm.setup(self._paired(rows[some], lags[some]), self.threads)

    def distances_m(self, rows: Rows, lag: int, setup: Setup) -> Floats:
        """Distances (m,) of the points of rows that have a partner so many rows further on."""
        return self.arm.distances_m(self._paired(rows, lag), setup)

    def distances(self, setup: Setup) -> Floats:
        """Distances (lags, n) of all points, in m: infinite without readings, NaN without a point."""
        found = np.full((len(LAGS), len(self.data)), np.inf)
        for own, lag in zip(found, LAGS, strict=True):
            rows = np.flatnonzero(self.has_partner(np.arange(len(self.data)), lag))
            own[rows] = self.distances_m(rows, lag, setup)
        return found

    def _paired(self, rows: Rows, lag: int | Rows) -> Seen:
        """Points of rows with the readings of those so many further on."""
        seen = Seen.of(self.data, self.target).select(rows)
        return replace(seen, readings=self.data.readings[rows + lag])


def fits_shifted(task: Task, data: Measurements) -> list[Notice]:
    """A notice of each set-up whose points fit the nominal arm far better with the readings of other rows.

    Args:
        task: What was fitted to the measurements.
        data: The measurements, those of each set-up in the order of their files.
    """
    if task.selection.distances:
        return []
    target = data.most_held(task.selection.targets)
    notices = []
    for group in task.groups:
        rows = _Rows(task.arm.robot, data.select(data.group == group), target, task.threads)
        notices += _of_set_up(rows, data)
    return notices


def _of_set_up(rows: _Rows, data: Measurements) -> list[Notice]:
    setup = _first_setup(rows)
    if setup is None:
        return []
    for _ in range(ROUNDS):
        found = rows.distances(setup)
        path = _path(np.nan_to_num(np.minimum(found / NEAR_M, 1.0), nan=0.0))
        lags, own = np.array(LAGS)[path], found[path, np.arange(len(path))]
        near = np.flatnonzero(own < NEAR_M)
        again = rows.setup(near, lags[near])
        setup = setup if again is None else again
    told = _telling(lags, found[0])
    if not np.isfinite(own[told]).any():
        return []
    off, before = np.nanmedian(own[told]), np.nanmedian(found[0, told])
    if off >= min(before / BETTER, NEAR_M):
        return []
    fit, instead = (length_mm(value * MM_PER_METRE, 3) for value in (off, before))
    fits = f"fit {rows.robot.name}, with a median of {fit} in place of {instead} before any calibration"
    if np.ptp(lags) == 0:
        text = (
            f"The measurements {fits}, if the readings of each row belong to the point "
            f"{count_of(abs(lags[0]), 'row')} {'before' if lags[0] > 0 else 'after'} it. Shift one against "
            "the other, and calibrate again."
        )
    else:
        text = (
            f"{_words(rows.data, lags, several=len(data.files) > 1)}. So the shifted points {fits}. Give "
            "each point its own readings, leave out what has no partner, and calibrate again."
        )
    return [Notice(ROWS_SHIFTED, text)]


def _telling(lags: Rows, unshifted_m: Floats) -> Rows:
    """Shifted rows that are far off with the readings beside them: other shots of a pose are not.

    Where hardly any is, all that are shifted.
    """
    shifted = np.flatnonzero(lags != 0)
    far = shifted[unshifted_m[shifted] >= NEAR_M]
    return far if len(far) > CHANGE else shifted


def _first_setup(rows: _Rows) -> Setup | None:
    """Frame and target of that part of the rows which fits best with some lag; None where none fits."""
    seen = rows.seen
    length = max(FEWEST_ROWS, len(seen) // PARTS)
    best, found = NEAR_M, None
    for start in range(0, len(seen) - length + 1, max(1, length // 2)):
        part = seen[start : start + length]
        for lag in LAGS:
            own = part[rows.has_partner(part, lag)]
            setup = rows.setup(own, lag)
            if setup is None:
                continue
            off = np.median(rows.distances_m(own, lag, setup))
            if off < best:
                best, found = float(off), setup
    return found


def _path(costs: Floats) -> Rows:
    """Of costs (k, n) of k lags in n rows, the lag of each row (n,) that is cheapest with its changes."""
    count, length = costs.shape
    came, total = np.empty((count, length), dtype=np.int64), costs[:, 0]
    for row in range(1, length):
        best = int(total.argmin())
        stays = total <= total[best] + CHANGE
        came[:, row] = np.where(stays, np.arange(count), best)
        total = np.where(stays, total, total[best] + CHANGE) + costs[:, row]
    path = np.empty(length, dtype=np.int64)
    path[-1] = total.argmin()
    for row in range(length - 1, 0, -1):
        path[row - 1] = came[path[row], row]
    return path


def _words(data: Measurements, lags: Rows, *, several: bool) -> str:
    """From which rows on points belong to other readings, and what was lost there."""
    parts = [f"In the first rows each point belongs to {_whose(lags[0])}"] if lags[0] else []
    for row in np.flatnonzero(np.diff(lags)) + 1:
        lost = int(lags[row] - lags[row - 1])
        few, many = ("point", "reading") if lost > 0 else ("reading", "point")
        was, is_ = ("was", "is") if abs(lost) == 1 else ("were", "are")
        file = f" of {data.sources[row]}" if several else ""
        parts.append(
            f"{'from' if parts else 'From'} row {data.rows[row]}{file} on each point belongs to "
            f"{_whose(lags[row])}: {count_of(abs(lost), few)} {was} lost there, or "
            f"{count_of(abs(lost), many)} {is_} too many"
        )
    return "; ".join(parts)


def _whose(lag: int) -> str:
    """Whose readings a point belongs to."""
    if lag == 0:
        return "the readings beside it"
    return f"the readings {count_of(abs(lag), 'row')} {'further on' if lag > 0 else 'before it'}"
