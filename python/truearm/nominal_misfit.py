"""How far measured points lie from where a nominal arm has them, once its frame and target are found."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import CoreError, Setup, fit_constant
from truearm.core_set import Selection, core_set
from truearm.fitting import Task, fit_options
from truearm.identified import IdentifiedArm
from truearm.measurements import Measurements
from truearm.models import CONSTANT
from truearm.options import Options
from truearm.robot import Robot
from truearm.validation import row_errors

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

MOST_ROWS: Final = 60
FEWEST_ROWS: Final = 12
"""Rows, at the most and at the least, that such a fit is asked of."""


def some_rows(rows: Rows, most: int = MOST_ROWS) -> Rows:
    """At most so many of row indices, spread evenly."""
    return rows[np.unique(np.linspace(0, len(rows) - 1, most).astype(np.int64))]


def nominal_setup(
    robot: Robot, rows: Measurements, target: int = 0, threads: int | None = None
) -> Setup | None:
    """Frame and target with which the nominal arm fits points best; None where they cannot be found.

    Args:
        robot: The nominal arm.
        rows: Measurements of one set-up.
        target: The measured point, index from 0.
        threads: Threads at the most.
    """
    task = _task(robot, rows, target, threads)
    measured = core_set(robot, rows, task.selection, task.groups)
    try:
        return fit_constant(task.problem(measured, []), fit_options(task)).setup
    except CoreError:
        return None


def distances_m(robot: Robot, rows: Measurements, setup: Setup, target: int = 0) -> Floats:
    """Distances (n,) of points, in m, from where the arm with this frame and target has them.

    They are NaN in rows without the point. The arguments are those of `nominal_setup`.
    """
    task = _task(robot, rows, target, None)
    return row_errors(task.arm, rows, task.selection, task.groups, task.arm.table, setup).distance_m


def misfit_m(robot: Robot, rows: Measurements, target: int = 0, threads: int | None = None) -> float:
    """Median distance of points, in m, from where the arm, its frame and target fitted, has them.

    The arguments are those of `nominal_setup`.

    Returns:
        The distance; infinity where frame and target cannot be found.
    """
    setup = nominal_setup(robot, rows, target, threads)
    return np.inf if setup is None else float(np.nanmedian(distances_m(robot, rows, setup, target)))


def _task(robot: Robot, rows: Measurements, target: int, threads: int | None) -> Task:
    selection = Selection((target,), judge=target)
    return Task(IdentifiedArm(robot), selection, rows.groups, Options(model=CONSTANT), threads)
