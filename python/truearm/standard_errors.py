"""How far the constants of the constant model are from those of the arm."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from truearm._core import ConstantFit, FieldFit
from truearm.identified import IdentifiedArm

Floats = NDArray[np.float64]


def of_covariance(covariance: Floats, count: int) -> Floats:
    """Standard errors (count,) of the first unknowns of a covariance (u, u)."""
    return np.sqrt(np.diagonal(covariance)[:count])


def standard_errors(
    arm: IdentifiedArm, names: Sequence[str], constant: ConstantFit, variable: FieldFit | None
) -> Floats:
    """Standard errors (k,) of the constants with these names, rad and m.

    Constants that are fitted alone take over what they can imitate of everything that varies, however many
    poses there are; their own covariance, to which that is noise, does not know of it. Where a field was
    fitted beside constants, its posterior N(m, V) says where the arm's are, and the root mean square
    distance of the estimate c from them is `sqrt((c - m)^2 + V)`.
    """
    if variable is None:
        return of_covariance(constant.covariance, len(names))
    columns = list(arm.candidates.columns)
    column_of = dict(zip(arm.candidates.names, columns, strict=True))
    variances = dict(zip(columns, np.diagonal(variable.constant_covariance), strict=True))
    apart = np.ravel(constant.parameters) - np.ravel(variable.parameters)
    chosen = [column_of[name] for name in names]
    known = np.array([variances[column] for column in chosen])
    return np.asarray(np.sqrt(apart[chosen] ** 2 + np.maximum(known, 0.0)))
