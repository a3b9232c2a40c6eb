"""Whether the old calibration still holds, and whether its field does: tests of sums of squares."""

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from scipy.special import fdtrc, stdtr

from truearm.types import Floats, Mask
from truearm.updating.estimating import Estimate
from truearm.updating.unknowns import Unknowns

TOLD: Final = 1.0
"""A direction is tested when the rows tell more of it than the prior."""
NEGLIGIBLE: Final = 1e-2
"""A direction that moves the rows by less, in standard deviations, for one of the prior's stays in."""


@dataclass(frozen=True)
class SquaresTest:
    """A sum of squares in units of a scale that the calibration's own rows told, hence F distributed.

    `truearm.update` makes one of what may have moved, `update.changed`, and of what is left, `update.rest`.

    Attributes:
        squares: The sum.
        freedom: Degrees of freedom.
        p: How often an unchanged arm shows as much or more.
    """

    squares: float
    freedom: int
    p: float

    @classmethod
    def of(cls, values: Floats, freedom: int, known: int) -> "SquaresTest":
        """Internal: that of standardised values (k,), whose scale `known` degrees of freedom tell."""
        squares = float(np.square(values).sum())
        return cls(squares, freedom, float(fdtrc(freedom, known, squares / freedom)) if freedom else 1.0)

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return asdict(self)


def change_test(unchanged: Estimate, unknowns: Unknowns, known: int) -> SquaresTest:
    """Whether offsets and tool are as they were; `unchanged` holds them there.

    What says nothing about a change, such as a frame that is found anew, is projected out.
    """
    beside = unknowns.anew | unknowns.caused
    return _beside(unchanged, unknowns, unknowns.free & ~beside, beside, known)


def cause_test(without: Estimate, unknowns: Unknowns, known: int) -> SquaresTest:
    """Whether there is what else is asked for; `without` has all but that estimated."""
    return _beside(without, unknowns, unknowns.caused, unknowns.free & ~unknowns.caused, known)


def rest_test(estimated: Estimate, unknowns: Unknowns, known: int) -> SquaresTest:
    """Whether what is left after offsets, frame and tool were estimated is what field and noise may leave.

    What visits to a pose differ by, which says how far they scatter, is no part of it, unless that is more
    than calibration and noise leave.
    """
    residual, free = _whitened(estimated, unknowns, unknowns.free)
    out = _basis(free, NEGLIGIBLE)
    return SquaresTest.of(residual - out @ (out.T @ residual), len(residual) - out.shape[1], known)


def student_p(ratio: float, known: int) -> float:
    """How often a value that is that many standard errors off or more is chance."""
    return float(2.0 * stdtr(known, -abs(ratio)))


def wald(change: Floats, covariance: Floats, known: int) -> SquaresTest:
    """Whether changes (k,) of a covariance (k, k) are zero."""
    return SquaresTest.of(np.linalg.solve(np.linalg.cholesky(covariance), change), len(change), known)


def _beside(estimate: Estimate, unknowns: Unknowns, tested: Mask, beside: Mask, known: int) -> SquaresTest:
    """Whether unknowns (u,) that are `tested` are as they are held, whatever those `beside` are."""
    residual, others = _whitened(estimate, unknowns, beside)
    _, change = _whitened(estimate, unknowns, tested)
    out = _basis(others, NEGLIGIBLE)
    left = residual - out @ (out.T @ residual)
    told = _basis(change - out @ (out.T @ change), TOLD)
    return SquaresTest.of(told.T @ left, told.shape[1], known)


def _whitened(estimate: Estimate, unknowns: Unknowns, chosen: Mask) -> tuple[Floats, Floats]:
    """Residuals (r,) and columns of the chosen unknowns (r, k) in standard deviations, of both: of all visits
    to a pose as of one, which is their mean.
    """
    linear = estimate.linear
    columns = linear.jacobian[:, chosen] * unknowns.std[chosen]
    whitened = estimate.scatter.whitened(np.column_stack([linear.residual, columns]))
    count = int(linear.quantity.max()) + 1
    if count < len(linear.residual):
        alike = np.equal.outer(linear.quantity, np.arange(count)).astype(np.float64)
        whitened = np.linalg.qr(estimate.scatter.whitened(alike))[0].T @ whitened
    return whitened[:, 0], whitened[:, 1:]


def _basis(columns: Floats, least: float) -> Floats:
    """Orthonormal directions (R, k) that the columns reach farther than `least`."""
    if columns.shape[1] == 0:
        return columns
    directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(directions[:, sizes > least])
