"""How far measured points lie from where a nominal arm has them, once its frame and target are found."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm._core import Chain, ConstantFit, CoreError, Problem, Setup, fit_constant, residuals
from truearm.fits.core_set import measured_points
from truearm.fits.fitting import fit_options
from truearm.measurements import Measurements
from truearm.registration import spread_m
from truearm.robot import Robot
from truearm.rows.evenly import some_rows
from truearm.types import Floats, Rows

FEWEST_ROWS: Final = 12
"""Rows, at the least, that such a fit is asked of."""
LEAST_SPREAD_M: Final = 1e-4
"""Points that lie closer together are taken to be so far apart."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Points of one set-up, n of them, and where they were measured.

    Attributes:
        readings: Joint readings (n, N).
        points: The points (n, 3), m; NaN where none was measured.
        sigma_m: Their own sigma (n,); None where there is none.
    """

    readings: Floats
    points: Floats
    sigma_m: Floats | None = None

    @classmethod
    def of(cls, data: Measurements, target: int) -> "Seen":
        """The points of a target, index from 0."""
        return cls(data.readings, data.targets[:, target], data.sigma_m)

    @classmethod
    def first(cls, data: Measurements) -> "Seen | None":
        """Some points of the first set-up, of the target that most rows hold; None if too few."""
        if data.target_count == 0:
            return None
        target = data.most_held()
        held = data.seen(target) & (data.group == data.groups[0])
        rows = np.flatnonzero(held)
        return cls.of(data, target).select(some_rows(rows)) if len(rows) >= FEWEST_ROWS else None

    def select(self, rows: Rows) -> "Seen":
        """Some of them, by their indices."""
        sigma = None if self.sigma_m is None else self.sigma_m[rows]
        return Seen(self.readings[rows], self.points[rows], sigma)


@dataclass(frozen=True, eq=False)
class NominalArm:
    """A nominal arm up to its flange.

    Attributes:
        chain: Its links, compiled.
        table: Their parameters (L, 5).
        coupling: Joint values from readings (N, N).
    """

    chain: Chain
    table: Floats
    coupling: Floats

    @classmethod
    def of(cls, robot: Robot) -> "NominalArm":
        """That of a robot."""
        return cls(robot.flange_chain, robot.table, robot.coupling)

    def setup(self, seen: Seen, threads: int | None = None) -> Setup | None:
        """Frame and target with which the arm fits points best; None where they cannot be found.

        `threads` are those at the most.
        """
        fit = self._fit(seen, threads)
        return None if fit is None else fit.setup

    def distances_m(self, seen: Seen, setup: Setup) -> Floats:
        """Distances (n,) of points, in m, from where the arm with this frame and target has them.

        They are NaN in rows without the point.
        """
        return _distances(residuals(self._problem(seen), self.table, setup), seen.points)

    def misfit_m(self, seen: Seen, threads: int | None = None) -> float:
        """Median distance of points, in m, from where the arm, its frame and target fitted, has them.

        Returns:
            The distance; infinity where frame and target cannot be found.
        """
        fit = self._fit(seen, threads)
        return np.inf if fit is None else float(np.nanmedian(_distances(fit.residuals, seen.points)))

    def _fit(self, seen: Seen, threads: int | None) -> ConstantFit | None:
        try:
            return fit_constant(self._problem(seen), fit_options(threads))
        except CoreError:
            return None

    def _problem(self, seen: Seen) -> Problem:
        """That of frame and target alone."""
        values = seen.readings @ self.coupling.T
        return Problem(self.chain, measured_points(values, seen.points, sigma_m=seen.sigma_m), [], False)


def relative_misfit(robot: Robot, seen: Seen) -> float:
    """How far points are from those of the nominal arm, over their spread."""
    return NominalArm.of(robot).misfit_m(seen) / max(spread_m(seen.points), LEAST_SPREAD_M)


def _distances(left: Floats, points: Floats) -> Floats:
    """Lengths (n,) of residuals (n, 3) or (3 n,) of points (n, 3); NaN where there is no point."""
    lengths = np.linalg.norm(left.reshape(-1, 3), axis=1)
    return np.where(np.isfinite(points).all(axis=1), lengths, np.nan)
