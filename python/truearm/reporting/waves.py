"""Periods in a curve along a joint, without a word on what may cause them."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.types import Floats

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

    Each period is tried by least squares with sine, cosine and parabola together. A wave takes more than
    those that are a little longer or shorter: what goes on growing with the period has none that can be told.
    None where no wave makes a third of the variance, or the curve is none but a parabola.
    """
    span, step = float(x[-1] - x[0]), float(x[1] - x[0])
    longest, shortest = span / FEWEST_TURNS, POINTS_A_TURN * step
    trend = np.stack([np.ones_like(x), x - x.mean(), np.square(x - x.mean())], axis=1)
    left = _residual(trend, y)
    total = float(left @ left)
    if longest <= shortest or np.ptp(left) <= FLAT * np.ptp(y):
        return None
    found = [
        _wave(trend, x, y, float(period), total)
        for period in 1.0 / np.linspace(1.0 / longest, 1.0 / shortest, TRIED)
    ]
    peaks = [
        wave
        for before, wave, behind in zip(found, found[1:], found[2:], strict=False)
        if wave.share >= max(before.share, behind.share)
    ]
    best = max(peaks, key=lambda wave: wave.share, default=found[0])
    return best if peaks and best.share >= SHARE else None


def _wave(trend: Floats, x: Floats, y: Floats, period: float, total: float) -> Wave:
    angle = 2.0 * np.pi * x / period
    basis = np.column_stack([trend, np.cos(angle), np.sin(angle)])
    found = np.linalg.lstsq(basis, y, rcond=None)[0]
    rest = y - basis @ found
    return Wave(period, float(np.hypot(found[-2], found[-1])), 1.0 - float(rest @ rest) / total)


def _residual(basis: Floats, y: Floats) -> Floats:
    return np.asarray(y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0])
