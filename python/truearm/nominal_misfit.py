"""How far measured points lie from where a nominal arm has them, once its frame and target are found."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import Chain, ConstantFit, CoreError, Problem, Setup, fit_constant, residuals
from truearm.core_set import measured_points
from truearm.fitting import fit_options
from truearm.robot import Robot

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

MOST_ROWS: Final = 60
FEWEST_ROWS: Final = 12
"""Rows, at the most and at the least, that such a fit is asked of."""


def some_rows(rows: Rows, most: int = MOST_ROWS) -> Rows:
    """At most so many of row indices, spread evenly."""
    return rows[np.unique(np.linspace(0, len(rows) - 1, most).astype(np.int64))]


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

    def setup(self, readings: Floats, points: Floats, threads: int | None = None) -> Setup | None:
        """Frame and target with which the arm fits points best; None where they cannot be found.

        Args:
            readings: Joint readings (n, N) of one set-up.
            points: The points that were measured there (n, 3), m; NaN where none was.
            threads: Threads at the most.
        """
        fit = self._fit(readings, points, threads)
        return None if fit is None else fit.setup

    def distances_m(self, readings: Floats, points: Floats, setup: Setup) -> Floats:
        """Distances (n,) of points, in m, from where the arm with this frame and target has them.

        They are NaN in rows without the point. The arguments are those of `setup`.
        """
        return _distances(residuals(self._problem(readings, points), self.table, setup), points)

    def misfit_m(self, readings: Floats, points: Floats, threads: int | None = None) -> float:
        """Median distance of points, in m, from where the arm, its frame and target fitted, has them.

        The arguments are those of `setup`.

        Returns:
            The distance; infinity where frame and target cannot be found.
        """
        fit = self._fit(readings, points, threads)
        return np.inf if fit is None else float(np.nanmedian(_distances(fit.residuals, points)))

    def _fit(self, readings: Floats, points: Floats, threads: int | None) -> ConstantFit | None:
        try:
            return fit_constant(self._problem(readings, points), fit_options(threads))
        except CoreError:
            return None

    def _problem(self, readings: Floats, points: Floats) -> Problem:
        """That of frame and target alone."""
        return Problem(self.chain, measured_points(readings @ self.coupling.T, points), [], False)


def _distances(left: Floats, points: Floats) -> Floats:
    """Lengths (n,) of residuals (n, 3) or (3 n,) of points (n, 3); NaN where there is no point."""
    lengths = np.linalg.norm(left.reshape(-1, 3), axis=1)
    return np.where(np.isfinite(points).all(axis=1), lengths, np.nan)
