"""How well the rows of a fit tell the scale of its standard deviations, and what sigma they stated."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class KnownScale:
    """What an update compares new rows with; it stays what it was when the calibration is updated.

    Attributes:
        freedom: Degrees of freedom that the scale of standard deviations is known from.
        sigma_m: What half of the rows state as their sigma, or less, m; zero where none does, None in files
            of earlier versions that do not tell.
    """

    freedom: int
    sigma_m: float | None

    @classmethod
    def of(cls, residual: Floats, rank: int, stated: Floats | None) -> "KnownScale":
        """That of residuals, zero where not measured, with `rank` unknowns and stated sigmas (n,), m."""
        told = np.empty(0) if stated is None else stated[np.isfinite(stated)]
        usual = float(np.median(told)) if len(told) else 0.0
        return cls.of_values(int(np.count_nonzero(residual)), rank, usual)

    @classmethod
    def of_values(cls, values: int, rank: int, sigma_m: float | None) -> "KnownScale":
        """That of so many measured values with `rank` unknowns."""
        return cls(max(values - rank, 1), sigma_m)
