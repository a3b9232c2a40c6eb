"""Distances that are far off among those that constants are fitted to.

A distance is one value of its row, and constants by least squares follow the one that is far off until hardly
anything is left of it. So distances are held against constants that rows far off do not bend.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from truearm._core import ConstantFit, fit_constant
from truearm.doubts.unbent import UNBENT, unbent
from truearm.fits.core_set import core_set, distance_ends
from truearm.fits.fitted_rows import OVERWHELMING, FittedRows, at_rows
from truearm.fits.fitting import Fits, Task, constant_variances, core_errors, fit_options
from truearm.types import Floats, Mask

MOST_TESTED: Final = 20
"""Distances far off, those nearest to the limit, each of which is tested by a fit of its own."""


def distances_judged(task: Task, rows: FittedRows, fits: Fits) -> FittedRows:
    """Rows of distances with `score` and `distance_m` by constants that rows far off do not bend.

    Where distances are few for the unknowns a robust loss takes some for far off whatever they are. Such a
    one is an outlier if least squares without all others leave overwhelmingly less without it too.
    """
    apart = fits if task.options.robust == UNBENT else unbent(task, rows)
    judged = FittedRows.of(apart, rows.side, task.selection)
    if (judged.score > 1.0).any():
        judged = replace(judged, score=_confirmed(task, apart, judged.score))
    return replace(rows, score=judged.score, distance_m=judged.distance_m)


def _confirmed(task: Task, apart: Fits, score: Floats) -> Floats:
    """Scores (n,), less where distances were taken for far off that least squares would explain.

    It is the F test of a shift of a distance, where all others that are far off have one too.
    """
    from scipy.special import fdtri  # noqa: PLC0415 - slow to import

    first = distance_ends(apart.data)[:, 0]
    own = score[first]
    far = own > 1.0
    free = int((~far).sum()) - apart.identifiability.total_rank
    if free < 1:
        return np.minimum(score, 1.0)
    without = _least_squares(task, apart, far)
    variance = constant_variances(replace(apart, constant=without), task.selection)[first, 0]
    left = _left(without, variance, far)
    order = np.flatnonzero(far)
    for place in order[np.argsort(own[order], kind="stable")][:MOST_TESTED].tolist():
        others = far.copy()
        others[place] = False
        more = _left(_least_squares(task, apart, others), variance, others) - left
        own[place] = min(own[place], more / (left / free) / fdtri(1, free, 1.0 - OVERWHELMING))
    return at_rows(own, apart.data)


def _left(fit: ConstantFit, variance: Floats, apart: Mask) -> float:
    """Squares that a fit leaves of distances, in parts of their variances (d,), of all but those `apart`."""
    return float((fit.residuals.ravel() ** 2 / variance)[~apart].sum())


def _least_squares(task: Task, apart: Fits, far: Mask) -> ConstantFit:
    """Constants without the distances that are far off (d,)."""
    weight = np.ones(len(apart.data))
    weight[distance_ends(apart.data)[far, 0]] = 0.0
    measured = core_set(task.arm.robot, apart.data, task.selection, task.groups, weight)
    options = fit_options(task.threads, prior=task.options.prior)
    with core_errors(apart.data):
        return fit_constant(task.problem(measured, task.columns(apart.identifiability.determined)), options)
