"""How far residuals may scatter together: a covariance that is factored and inverted once."""

from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpotri

from truearm.errors import WorkError
from truearm.types import Floats


class Scatter:
    """What residuals of an unchanged arm may scatter by.

    Args:
        covariance: Of the residuals (R, R), m and rad.
    """

    def __init__(self, covariance: Floats) -> None:
        self._covariance = covariance

    @cached_property
    def factor(self) -> Floats:
        """Lower Cholesky factor (R, R).

        Raises:
            WorkError: If there is none.
        """
        try:
            return np.asarray(np.linalg.cholesky(self._covariance))
        except np.linalg.LinAlgError:
            raise WorkError(
                "the calibration's spread at these poses is not positive definite",
                way_out="Look for poses that were measured several times without noise",
            ) from None

    @cached_property
    def precision(self) -> Floats:
        """Inverse of the covariance (R, R)."""
        lower, _ = dpotri(self.factor, lower=True)
        return np.asarray(np.tril(lower) + np.tril(lower, -1).T)

    def whitened(self, values: Floats) -> Floats:
        """Values (R,) or (R, k) in standard deviations, without correlation."""
        return np.asarray(solve_triangular(self.factor, values, lower=True))
