"""Periods in a curve along a joint, without a word on what may cause them."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FEWEST_TURNS: Final = 2.0
"""Of a wave that the curve must hold to be called one."""
POINTS_A_TURN: Final = 6
TRIED: Final = 400
FLAT: Final = 1e-6
"""A curve that differs from a parabola by so small a part of its reach is one."""
SHARE: Final = 1.0 / 3.0
"""Of the curve's variance that a wave must make."""


@dataclass(frozen=True)
class Wave:
    """The strongest wave in a curve.

    Attributes:
        period: In the units of x.
        amplitude: In the units of y.
        share: Of the variance of the curve, its trend apart.
    """

    period: float
    amplitude: float
    share: float


def strongest_wave(x: Floats, y: Floats) -> Wave | None:
    """The wave that takes most of the variance of y (n,) over evenly spaced x (n,), a parabola aside.

    Each period is tried by least squares with sine, cosine and parabola together. None where no wave makes
    a third of the variance, or the curve is none but a parabola.
    """
    span, step = float(x[-1] - x[0]), float(x[1] - x[0])
    longest, shortest = span / FEWEST_TURNS, POINTS_A_TURN * step
    trend = np.stack([np.ones_like(x), x - x.mean(), np.square(x - x.mean())], axis=1)
    left = _residual(trend, y)
    total = float(left @ left)
    if longest <= shortest or np.ptp(left) <= FLAT * np.ptp(y):
        return None
    best = Wave(0.0, 0.0, 0.0)
    for period in 1.0 / np.linspace(1.0 / longest, 1.0 / shortest, TRIED):
        angle = 2.0 * np.pi * x / period
        basis = np.column_stack([trend, np.cos(angle), np.sin(angle)])
        found = np.linalg.lstsq(basis, y, rcond=None)[0]
        rest = y - basis @ found
        share = 1.0 - float(rest @ rest) / total
        if share > best.share:
            best = Wave(float(period), float(np.hypot(found[-2], found[-1])), share)
    return best if best.share >= SHARE else None


def _residual(basis: Floats, y: Floats) -> Floats:
    return np.asarray(y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0])
