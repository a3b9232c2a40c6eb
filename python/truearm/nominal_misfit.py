"""How far measured points lie from where a nominal arm has them, once its frame and target are found."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import CoreError, fit_constant
from truearm.core_set import Selection, core_set
from truearm.fitting import Task, fit_options
from truearm.identified import IdentifiedArm
from truearm.measurements import Measurements
from truearm.models import CONSTANT
from truearm.options import Options
from truearm.robot import Robot
from truearm.validation import row_errors

Rows = NDArray[np.int64]

MOST_ROWS: Final = 60
FEWEST_ROWS: Final = 12
"""Rows, at the most and at the least, that such a fit is asked of."""


def some_rows(rows: Rows) -> Rows:
    """At most MOST_ROWS of row indices, spread evenly."""
    return rows[np.unique(np.linspace(0, len(rows) - 1, MOST_ROWS).astype(np.int64))]


def misfit_m(robot: Robot, rows: Measurements, target: int = 0, threads: int | None = None) -> float:
    """Median distance of points, in m, from where the arm, its frame and target fitted, has them.

    Args:
        robot: The nominal arm.
        rows: Measurements of one set-up.
        target: The measured point, index from 0.
        threads: Threads at the most.

    Returns:
        The distance; infinity where frame and target cannot be found.
    """
    options = Options(model=CONSTANT)
    task = Task(IdentifiedArm(robot), Selection((target,), judge=target), rows.groups, options, threads)
    measured = core_set(robot, rows, task.selection, task.groups)
    try:
        setup = fit_constant(task.problem(measured, []), fit_options(task)).setup
    except CoreError:
        return np.inf
    errors = row_errors(task.arm, rows, task.selection, task.groups, task.arm.table, setup)
    return float(np.nanmedian(errors.distance_m))
