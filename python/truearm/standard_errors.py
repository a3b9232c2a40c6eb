"""How far the constants of the constant model are from those of the arm."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.core_set import distances_apart
from truearm.fitting import Fits, Task, constant_variances
from truearm.measured_parts import held_parts
from truearm.shots import variance_factor
from truearm.visits import pose_numbers

Floats = NDArray[np.float64]

AXES: Final = 3


def of_covariance(covariance: Floats, count: int) -> Floats:
    """Standard errors (count,) of the first unknowns of a covariance (u, u)."""
    return np.sqrt(np.diagonal(covariance)[:count])


def counted_covariance(task: Task, fits: Fits) -> Floats:
    """Covariance (u, u) of the constant fit, in which shots of a pose count as far as they do not agree.

    The fit took each for a measurement of its own. All shots of a pose share what the arm did not repeat
    there, and what constants do not hold.
    """
    constant, data, selection = fits.constant, fits.data, task.selection
    poses, variances = pose_numbers(data.readings, data.group), constant_variances(fits, selection)
    weights = constant.weights
    if selection.distances:
        rows, poses = distances_apart(data, poses)
        variances, weights, held = variances[rows], weights[rows], np.ones((len(rows), 1), dtype=np.bool_)
    else:
        parts = held_parts(data, selection)
        held = np.repeat(parts if selection.orientation else parts[:, :-1], AXES, axis=1)
    missed = constant.residuals.reshape(held.shape) * np.sqrt(weights[:, None] / variances)
    factor = variance_factor(np.where(held, missed, np.nan), poses, len(constant.covariance))
    return np.asarray(factor * constant.covariance)


def standard_errors(task: Task, fits: Fits, covariance: Floats) -> Floats:
    """Standard errors (k,) of the constants that a fit determined, rad and m; `covariance` (u, u) is theirs.

    Constants that are fitted alone take over what they can imitate of everything that varies, however many
    poses there are; their own covariance, to which that is noise, does not know of it. Where a field was
    fitted beside constants, its posterior N(m, V) says where the arm's are, and the root mean square
    distance of the estimate c from them is `sqrt((c - m)^2 + V)`.
    """
    names, variable = fits.identifiability.determined, fits.variable
    if variable is None:
        return of_covariance(covariance, len(names))
    columns = list(task.arm.candidates.columns)
    column_of = dict(zip(task.arm.candidates.names, columns, strict=True))
    variances = dict(zip(columns, np.diagonal(variable.constant_covariance), strict=True))
    apart = np.ravel(fits.constant.parameters) - np.ravel(variable.parameters)
    chosen = [column_of[name] for name in names]
    known = np.array([variances[column] for column in chosen])
    return np.asarray(np.sqrt(apart[chosen] ** 2 + np.maximum(known, 0.0)))
