"""Visits to poses that no other supports: what was measured there is too unlikely given all the others."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.fits.fitted_rows import overwhelming
from truearm.types import Floats, Integers, Mask
from truearm.updating.estimating import Estimate, unexplained

LINEAR: Final = 1e-3
"""Steps of the unknowns, m and rad, over which residuals are linear to about a micrometre."""


def unsupported(found: Estimate, std: Floats, free: Mask, most: int) -> list[int]:
    """Visits of an estimate that no other supports, the worst one first, each judged without those before it.

    Args:
        found: Of all visits.
        std: Prior standard deviations of the unknowns (u,), m and rad.
        free: Which of them were estimated (u,).
        most: Visits that are looked for.

    Returns:
        No more than `most`, and none after those without which the estimate moves so far that it has to be
        made again before others are judged.
    """
    left, out = _Left.of(found, std, free), list[int]()
    while len(out) < most and np.abs(left.moved).max() < LINEAR:
        visit, score = left.worst()
        if score <= 1.0:
            break
        out.append(visit)
        left = left.without(visit)
    return out


@dataclass(frozen=True, eq=False)
class _Left:
    """R values of the visits that are left, linearised at the estimate of all visits.

    Attributes:
        residual: Without what the unknowns explain (R,).
        metric: Inverse covariance (R, R) of these.
        gain: What the unknowns become by them (u, R).
        visit: Of each value (R,).
        bound: What the squares of a visit may sum up to, at each number of a visit.
        moved: How far the estimate of what is left is from that of all (u,).
    """

    residual: Floats
    metric: Floats
    gain: Floats
    visit: Integers
    bound: Floats
    moved: Floats

    @classmethod
    def of(cls, found: Estimate, std: Floats, free: Mask) -> "_Left":
        """All visits."""
        linear = found.linear
        metric, residual = unexplained(found, std, free)
        gain = found.covariance @ linear.jacobian.T @ found.scatter.precision
        bound = overwhelming(np.bincount(linear.visit))
        return cls(residual, metric, gain, linear.visit, bound, np.zeros(len(gain)))

    def worst(self) -> tuple[int, float]:
        """The visit that is the most unlikely given all others, and how many times what is allowed for."""
        visits, squares = surprise(self.metric, self.residual, self.visit)
        score = squares / self.bound[visits]
        worst = int(np.argmax(score))
        return int(visits[worst]), float(score[worst])

    def without(self, visit: int) -> "_Left":
        """What is left without a visit.

        With P the inverse of a covariance, that of the values other than o is `P - P_o^T P_oo^-1 P_o`.
        """
        out = self.visit == visit
        kept = ~out
        pull = self.metric[out]
        taken = np.linalg.solve(pull[:, out], np.column_stack([pull[:, kept], pull @ self.residual]))
        gain, own = self.gain[:, kept], self.gain[:, out]
        return _Left(
            residual=self.residual[kept],
            metric=self.metric[np.ix_(kept, kept)] - pull[:, kept].T @ taken[:, :-1],
            gain=gain - own @ taken[:, :-1],
            visit=self.visit[kept],
            bound=self.bound,
            moved=self.moved - own @ taken[:, -1],
        )


def surprise(metric: Floats, residual: Floats, visit: Integers) -> tuple[Integers, Floats]:
    """How unlikely each visit is given all others.

    Args:
        metric: Inverse covariance (R, R) of the residuals.
        residual: (R,).
        visit: Of each value (R,), ascending.

    Returns:
        Visits (n,), and of each the squared standardised length (n,) of what the others do not predict.
    """
    pull = metric @ residual
    visits, first, counts = np.unique(visit, return_index=True, return_counts=True)
    squares = np.empty(len(visits))
    for count in np.unique(counts):
        which = counts == count
        own = first[which, None] + np.arange(count)
        blocks, pulls = metric[own[:, :, None], own[:, None, :]], pull[own]
        squares[which] = (pulls * np.linalg.solve(blocks, pulls[:, :, None])[:, :, 0]).sum(axis=1)
    return visits, squares
