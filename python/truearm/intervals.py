"""How many held-out measurements lie within the 95 % intervals that the model gave before it saw them."""

from typing import Final

import numpy as np

from truearm._core import NORMAL_95, residuals
from truearm.fits.core_set import core_set
from truearm.fits.fitting import Fits, Task
from truearm.fits.models import VARIABLE
from truearm.judgement.judging import model_inputs
from truearm.measurements import Measurements
from truearm.rows.evenly import some_rows

MOST_ROWS: Final = 500
"""More rows change the share by less than its own uncertainty, and cost time."""


def interval_coverage(task: Task, fits: Fits, held: Measurements) -> float | None:
    """Share of the coordinates of held-out rows within their 95 % intervals; None without a field.

    None also where they hold nothing that was fitted, as where they are judged at another target alone.

    The intervals hold the uncertainty of arm and set-up, the noise, and the rows' own sigma.

    Args:
        task: What was fitted.
        fits: The fits to the training rows.
        held: Held-out rows, file by file; of many, some are taken that are spread evenly over all.
    """
    if fits.variable is None:
        return None
    rows = held.select(some_rows(np.arange(len(held)), MOST_ROWS))
    fit, model = fits.variable, fits.models(task.arm)[VARIABLE]
    measured = core_set(task.arm.robot, rows, task.selection, task.groups)
    problem = task.problem(measured, task.arm.candidates.columns)
    inputs = model_inputs(task.arm, rows, task.options.features)
    parameters = model.parameters(inputs)
    left = residuals(problem, parameters, model.setup)
    covariance = fit.posterior.measurement_covariance(problem, parameters, model.setup, inputs)
    bound = NORMAL_95 * fit.inflation * np.sqrt(np.einsum("nii->ni", covariance))
    was_measured = left != 0.0
    return float((np.abs(left) <= bound)[was_measured].mean()) if was_measured.any() else None
