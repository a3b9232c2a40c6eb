"""How well the rows of a fit tell the scale of its standard deviations, and what sigma they stated."""

from dataclasses import dataclass

import numpy as np

from truearm.measurements import Measurements
from truearm.rows.own_sigmas import sigmas_of_turns
from truearm.types import Floats


@dataclass(frozen=True)
class KnownScale:
    """What an update compares new rows with; it stays what it was when the calibration is updated.

    `truearm.calibrate` makes one, `calibration.constant.scale`.

    Attributes:
        freedom: Degrees of freedom that the scale of standard deviations is known from.
        sigma_m: What half of the rows state as their sigma, or less, m; zero where more of them state none,
            None in files of earlier versions that do not tell.
        common: Share of the variance that constants leave of positions which all targets of a pose have in
            common: it is the flange that is off.
        widened: Factor on the standard deviations of an update. The noise of a robust loss is a median, which
            is theirs of normal errors alone: it is the root mean square of what rows that are no outliers
            leave, in units of it. One for least squares, and for what varies.
        sigma_rad: What half of the rows state as the sigma of their orientation, or less, rad; zero where
            more of them state none.
    """

    freedom: int
    sigma_m: float | None
    common: float = 0.0
    widened: float = 1.0
    sigma_rad: float = 0.0

    @classmethod
    def of(
        cls, residual: Floats, rank: int, data: Measurements, common: float, widened: float = 1.0
    ) -> "KnownScale":
        """Internal: that of residuals, zero where not measured, of `rank` unknowns and of rows."""
        freedom = max(int(np.count_nonzero(residual)) - rank, 1)
        turned = usual_sigma(sigmas_of_turns(data))
        return cls(freedom, usual_sigma(data.stated_sigma_m), common, widened, turned)


def usual_sigma(stated_m: Floats) -> float:
    """What half of the rows state as their sigma (n,), m, or less; zero counts for those that state none."""
    return float(np.quantile(stated_m, 0.5, method="lower"))


def common_share(residual: Floats, weight: Floats, targets: int, noise_m: float, stated_m: Floats) -> float:
    """Share of the noise of positions that all targets of a pose have in common, from 0 to 1.

    It is the correlation of two targets of one pose along the same axis, as weighted residuals have it,
    whatever the scale that a fit or its loss leaves them, times the whole variance `noise^2 + sigma^2` over
    that of the noise: what rows state as their sigma is of each target by itself.

    Args:
        residual: Of n rows, of positions first (3 t each), m; zero where not measured.
        weight: Of the rows (n,).
        targets: How many there are, t.
        noise_m: Standard deviation of what is left of a coordinate, beside sigmas of the rows.
        stated_m: These sigmas (n,), m; zero where none is stated.
    """
    if targets < 2 or noise_m <= 0.0:
        return 0.0
    points = residual.reshape(len(weight), -1)[:, : 3 * targets].reshape(-1, targets, 3)
    seen = (points != 0.0).any(axis=2).astype(np.float64)
    apart = ~np.eye(targets, dtype=np.bool_)
    products = np.einsum("n,nki,nli->kl", weight, points, points)[apart].sum()
    squares = np.einsum("n,nki,nki,nl->kl", weight, points, points, seen)[apart].sum()
    if squares <= 0.0:
        return 0.0
    pairs = weight * seen.sum(axis=1) * (seen.sum(axis=1) - 1.0)
    whole = noise_m**2 + float(np.average(np.square(stated_m), weights=pairs))
    return float(np.clip(products / squares * whole / noise_m**2, 0.0, 1.0))
