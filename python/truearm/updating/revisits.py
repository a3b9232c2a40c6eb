"""Visits to one pose: what a calibration misses there they have in common, and noise is each one's own."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from truearm.measurements import Measurements
from truearm.rows.visits import visit_numbers
from truearm.types import Floats, Mask, Rows

LEAST_APART: Final = 1e-6
"""Part of the noise that visits to a pose differ by at the least: rows may be copies of others."""


@dataclass(frozen=True)
class Apart:
    """How far visits to a pose differ, beside what their rows state.

    As rows of poses that were visited once do, by all of the noise, without arguments.

    Attributes:
        part: Part of the noise that each visit has of its own; what else there is of it they share.
        seen: Variances of positions, m^2, and of orientations, rad^2, that visits differ by. Each has them
            beside its noise where it shares none: of poses that were visited once, a calibration may take
            noise for its field, or that of the device for that of joints.
        contradict: Whether they differ by more than that: by more than the calibration leaves uncertain.
    """

    part: float = 1.0
    seen: tuple[float, float] = (0.0, 0.0)
    contradict: bool = False

    @classmethod
    def of(
        cls, residual: Floats, held: Mask, poses: Rows, variances: tuple[Floats, Floats], orientation: Mask
    ) -> "Apart":
        """What half of the visits differ by, or less: one that is far off tells nothing of the others.

        Args:
            residual: Measured minus predicted (n, m).
            held: What was measured (n, m).
            poses: Number of each row's pose (n,).
            variances: Of noise, above zero, and of what rows state beside (n, m).
            orientation: Which of the values are in rad (m,).
        """
        _, pose = np.unique(poses, return_inverse=True)
        pose = pose.reshape(-1)
        visits, sums = np.zeros((2, pose.max() + 1, held.shape[1]))
        np.add.at(visits, pose, held)
        np.add.at(sums, pose, np.where(held, residual, 0.0))
        again = held & (visits[pose] > 1)
        if not again.any():
            return cls()
        count = np.where(again, visits[pose], 2.0)
        squares = np.square(residual - sums[pose] / count) * count / (count - 1.0)
        noise, stated = variances
        part = _of_half(squares / noise, stated / noise, again)
        kinds = (again & ~orientation, again & orientation)
        points, turns = (max(_of_half(squares, stated, kind), 0.0) for kind in kinds)
        return cls(min(max(part, LEAST_APART), 1.0), (points, turns))

    def limited(self, expected: Floats, orientation: Mask) -> "Apart":
        """The same of visits that differ by no more than poses do, which calibration and noise leave with
        variances (n, m); `orientation` (m,) tells those in rad.
        """
        most = [
            float(np.nanmedian(expected[:, kind])) if kind.any() else 0.0
            for kind in (~orientation, orientation)
        ]
        points, turns = (min(pair) for pair in zip(self.seen, most, strict=True))
        return Apart(self.part, (points, turns), (points, turns) != self.seen)

    @property
    def without_common(self) -> "Apart":
        """The same where visits to a pose vouch for one another as poses do."""
        return replace(self, part=1.0)

    def noise(self, noise: Floats, stated: Floats, orientation: Mask) -> Floats:
        """Covariances (n, m, m) of what each visit has of its own, from those of noise and what is stated."""
        if self.part < 1.0:
            return np.asarray(self.part * noise + stated)
        return np.asarray(noise + stated + np.diag(np.where(orientation, *self.seen[::-1])))

    def in_common(self, noise: Floats, poses: Rows) -> Floats:
        """Covariance (n m, n m) of what visits to a pose share.

        Args:
            noise: Covariances (n, m, m).
            poses: First row of each row's pose (n,).
        """
        size = noise.shape[0] * noise.shape[1]
        shared = (1.0 - self.part) * noise[poses]
        same = poses[:, None] == poses
        return np.asarray((same[:, None, :, None] * shared[:, :, None]).reshape(size, size))


UNSEEN: Final = Apart()
"""Where no pose was visited again, or nobody has looked yet."""


def _of_half(squares: Floats, known: Floats, chosen: Mask) -> float:
    """The variance of normal values beyond a known one (n, m), in the median over rows with any that are
    chosen (n, m), from their squares (n, m); zero without any.
    """
    from scipy.special import gammaincinv  # noqa: PLC0415 - slow to import

    values = chosen.sum(axis=1)
    if not values.any():
        return 0.0
    typical = values / (2.0 * gammaincinv(np.maximum(values, 1) / 2.0, 0.5))
    beyond = typical * (squares * chosen).sum(axis=1) - (known * chosen).sum(axis=1)
    return float(np.median((beyond / np.maximum(values, 1))[values > 0]))


def shots_of(visits: Measurements, merged: Measurements, given: Measurements) -> Rows:
    """Places among the given rows of those that some visits, a part of those `merged`, are the means of:
    visit after visit, its shots in the order of measuring.
    """
    kin = np.char.add(np.char.add(given.sources, "\n"), given.group)
    held = np.column_stack([visit_numbers(given.readings, kin), given.seen(), given.oriented])
    names = _names(given)
    place = {name: k for k, name in enumerate(names)}
    further = ~np.isin(np.arange(len(given)), [place[name] for name in _names(merged)])
    found = [np.zeros(0, dtype=np.int64)]
    for name in _names(visits):
        own = (held == held[place[name]]).all(axis=1) & further
        found.append(np.append(place[name], np.flatnonzero(own)))
    return np.concatenate(found)


def _names(data: Measurements) -> list[tuple[str, int]]:
    """File and row of each row (n,)."""
    return list(zip(data.sources.tolist(), data.rows.tolist(), strict=True))
