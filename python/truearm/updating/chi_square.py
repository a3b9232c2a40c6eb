"""Whether the old calibration still holds, and whether its field does: chi-square tests."""

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import erfc, gammaincc

from truearm.updating.estimating import Estimate
from truearm.updating.unknowns import Unknowns

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

TOLD: Final = 1.0
"""A direction is tested when the rows tell more of it than the prior."""
NEGLIGIBLE: Final = 1e-2
"""A direction that moves the rows by less, in standard deviations, for one of the prior's stays in."""


@dataclass(frozen=True)
class ChiSquare:
    """A sum of squares that is chi-square distributed if nothing happened.

    Attributes:
        squares: The sum.
        freedom: Degrees of freedom.
        p: How often an unchanged arm shows as much or more.
    """

    squares: float
    freedom: int
    p: float

    @classmethod
    def of(cls, values: Floats, freedom: int) -> "ChiSquare":
        """That of standardised values (k,)."""
        squares = float(np.square(values).sum())
        return cls(squares, freedom, float(gammaincc(freedom / 2.0, squares / 2.0)) if freedom else 1.0)

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return asdict(self)


def change_test(unchanged: Estimate, unknowns: Unknowns) -> ChiSquare:
    """Whether offsets and tool are as they were; `unchanged` holds them there.

    What says nothing about a change, such as a frame that is found anew, is projected out.
    """
    residual, nuisance = _whitened(unchanged, unknowns, unknowns.nuisance)
    _, change = _whitened(unchanged, unknowns, unknowns.free & ~unknowns.nuisance)
    out = _basis(nuisance, NEGLIGIBLE)
    left = residual - out @ (out.T @ residual)
    told = _basis(change - out @ (out.T @ change), TOLD)
    return ChiSquare.of(told.T @ left, told.shape[1])


def rest_test(estimated: Estimate, unknowns: Unknowns) -> ChiSquare:
    """Whether what is left after offsets, frame and tool were estimated is what field and noise may leave."""
    residual, free = _whitened(estimated, unknowns, unknowns.free)
    out = _basis(free, NEGLIGIBLE)
    return ChiSquare.of(residual - out @ (out.T @ residual), len(residual) - out.shape[1])


def normal_p(ratio: float) -> float:
    """How often a standard normal value is farther from zero."""
    return float(erfc(abs(ratio) / np.sqrt(2.0)))


def wald(change: Floats, covariance: Floats) -> ChiSquare:
    """Whether changes (k,) of a covariance (k, k) are zero."""
    return ChiSquare.of(np.linalg.solve(np.linalg.cholesky(covariance), change), len(change))


def _whitened(estimate: Estimate, unknowns: Unknowns, chosen: Mask) -> tuple[Floats, Floats]:
    """Residuals (R,) and columns of the chosen unknowns (R, k) in standard deviations, of both."""
    columns = estimate.linear.jacobian[:, chosen] * unknowns.std[chosen]
    both = np.column_stack([estimate.linear.residual, columns])
    whitened = solve_triangular(estimate.factor, both, lower=True)
    return whitened[:, 0], whitened[:, 1:]


def _basis(columns: Floats, least: float) -> Floats:
    """Orthonormal directions (R, k) that the columns reach farther than `least`."""
    if columns.shape[1] == 0:
        return columns
    directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(directions[:, sizes > least])
