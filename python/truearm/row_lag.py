"""Readings that belong to the points of other rows: one log began a row earlier than the other."""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.conventions import BETTER, NEAR_M
from truearm.errors import Notice, count_of
from truearm.fitting import Task
from truearm.measurements import Measurements
from truearm.nominal_misfit import FEWEST_ROWS, misfit_m, some_rows
from truearm.units import MM_PER_METRE

Rows = NDArray[np.int64]

LAGS: Final = (1, -1, 2, -2)
"""Rows that are tried: logs that begin together and lose a row are off by one or two."""


def fits_shifted(task: Task, data: Measurements) -> list[Notice]:
    """A notice where the nominal arm fits measured points far better with the readings of other rows.

    Args:
        task: What was fitted to the measurements.
        data: The measurements, those of each set-up in the order of their files.
    """
    if task.selection.distances:
        return []
    target = data.most_held(task.selection.targets)
    rows = max((np.flatnonzero(data.group == group) for group in task.groups), key=len)
    inner = rows[max(LAGS) : -max(LAGS)]
    inner = inner[np.isfinite(data.targets[inner, target]).all(axis=1)]
    if len(inner) < FEWEST_ROWS:
        return []
    places = np.searchsorted(rows, some_rows(inner))

    def misfit(lag: int) -> float:
        shifted = replace(data.select(rows[places]), readings=data.readings[rows[places + lag]])
        return misfit_m(task.arm.robot, shifted, target, task.threads)

    before, found = misfit(0), {lag: misfit(lag) for lag in LAGS}
    lag = min(found, key=lambda lag: found[lag])
    if found[lag] >= min(before / BETTER, NEAR_M):
        return []
    off, instead = (f"{value * MM_PER_METRE:.3g} mm" for value in (found[lag], before))
    text = (
        f"The measurements fit {task.arm.robot.name}, with a median of {off} in place of {instead} before "
        f"any calibration, if the readings of each row belong to the point {count_of(abs(lag), 'row')} "
        f"{'before' if lag > 0 else 'after'} it. Shift one against the other, and calibrate again."
    )
    return [Notice("rows_shifted", text)]
