"""How far shots of a pose count as measurements of their own: they share what the arm did not repeat."""

from dataclasses import dataclass

import numpy as np

from truearm.types import Floats, Rows


@dataclass(frozen=True)
class Scatter:
    """What a model leaves of shots, as two variances.

    Attributes:
        shared: What all shots of a pose share: what the arm did not repeat, and what no model holds.
        own: What each shot has of its own, the instrument's noise.
    """

    shared: float
    own: float

    @classmethod
    def of(cls, missed: Floats, poses: Rows, unknowns: int = 0) -> "Scatter":
        """The variances within and between poses of errors (n, k), NaN where not measured.

        Unknowns that were fitted to the rows have taken their part of what differs between poses.

        Args:
            missed: Measured minus predicted.
            poses: Number of each row's pose (n,).
            unknowns: How many were fitted.
        """
        value, cell = _cells(missed, poses)
        count = np.bincount(cell)
        mean = np.bincount(cell, value) / count
        within = float(np.square(value - mean[cell]).sum())
        own = within / max(len(value) - len(count), 1)
        free = len(count) / max(len(count) - unknowns, 1)
        between = float((count * np.square(mean)).sum()) * free
        return cls(max((between - len(count) * own) / len(value), 0.0), own)

    def counts(self, poses: Rows) -> Floats:
        """How many measurements each row (n,) counts for: one where it is alone, or shots share nothing."""
        _, pose, shots = np.unique(poses, return_inverse=True, return_counts=True)
        whole = self.shared + self.own
        share = self.shared / whole if whole > 0.0 else 0.0
        return np.asarray(1.0 / (1.0 + (shots - 1.0) * share))[pose.reshape(-1)]


def variance_factor(missed: Floats, poses: Rows, unknowns: int) -> float:
    """By how much the covariance of a fit grows that took each shot for a measurement of its own.

    Args:
        missed: Residuals (n, k) over the standard deviations that the fit took for them, NaN where not
            measured.
        poses: Number of each row's pose (n,).
        unknowns: How many were fitted.
    """
    if len(np.unique(poses)) == len(poses):
        return 1.0
    found = Scatter.of(missed, poses, unknowns)
    _, cell = _cells(missed, poses)
    count = np.bincount(cell)
    return max(float((count * (count * found.shared + found.own)).sum()) / len(cell), 1.0)


def _cells(missed: Floats, poses: Rows) -> tuple[Floats, Rows]:
    """The known values (v,), and which of the quantities, each of a pose, each is a shot of (v,)."""
    rows, columns = np.nonzero(np.isfinite(missed))
    _, cell = np.unique(poses[rows] * missed.shape[1] + columns, return_inverse=True)
    return missed[rows, columns], cell.reshape(-1).astype(np.int64)
