"""How well the rows of a fit tell the scale of its standard deviations, and what sigma they stated."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class KnownScale:
    """What an update compares new rows with; it stays what it was when the calibration is updated.

    `truearm.calibrate` makes one, `calibration.constant.scale`.

    Attributes:
        freedom: Degrees of freedom that the scale of standard deviations is known from.
        sigma_m: What half of the rows state as their sigma, or less, m; zero where none does, None in files
            of earlier versions that do not tell.
        common: Share of the variance that constants leave of positions which all targets of a pose have in
            common: it is the flange that is off.
        widened: Factor on the standard deviations of an update. The noise of a robust loss is a median, which
            is theirs of normal errors alone: it is the root mean square of what rows that are no outliers
            leave, in units of it. One for least squares, and for what varies.
    """

    freedom: int
    sigma_m: float | None
    common: float = 0.0
    widened: float = 1.0

    @classmethod
    def of(
        cls, residual: Floats, rank: int, stated: Floats | None, common: float, widened: float = 1.0
    ) -> "KnownScale":
        """Internal: that of residuals, zero where not measured, `rank` unknowns and stated sigmas (n,), m."""
        told = np.empty(0) if stated is None else stated[np.isfinite(stated)]
        usual = float(np.median(told)) if len(told) else 0.0
        return cls(max(int(np.count_nonzero(residual)) - rank, 1), usual, common, widened)


def common_share(residual: Floats, weight: Floats, targets: int, noise_m: float) -> float:
    """Share of the variance of positions that all targets of a pose have in common, from 0 to 1.

    It is the mean product of residuals of two targets of one pose along the same axis, over noise^2.

    Args:
        residual: Of n rows, of positions first (3 t each), m; zero where not measured.
        weight: Of the rows (n,).
        targets: How many there are, t.
        noise_m: Standard deviation of what is left of a coordinate, beside sigmas of the rows.
    """
    if targets < 2 or noise_m <= 0.0:
        return 0.0
    points = residual.reshape(len(weight), -1)[:, : 3 * targets].reshape(-1, targets, 3)
    seen = (points != 0.0).any(axis=2).astype(np.float64)
    apart = ~np.eye(targets, dtype=np.bool_)
    pairs = np.einsum("n,nk,nl->kl", weight, seen, seen)[apart].sum()
    products = np.einsum("n,nki,nli->kl", weight, points, points)[apart].sum() / 3.0
    return float(np.clip(products / pairs / noise_m**2, 0.0, 1.0)) if pairs > 0.0 else 0.0
