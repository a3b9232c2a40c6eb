"""Lengths by which distances to several anchors are off, found in one fit with the constants."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from truearm._core import CoreError, fit_constant
from truearm.fits.core_set import anchor_names, core_set, distances_apart
from truearm.fits.enough_values import setup_unknowns
from truearm.fits.fitting import Task, fit_options
from truearm.fits.measured_parts import LEAST_LEFT_M
from truearm.measurements import Measurements
from truearm.types import AXES, Floats, Mask

STEP_M: Final = 1e-3
"""How far lengths are moved to see what follows."""
ENOUGH_M: Final = 1e-6
MOST_STEPS: Final = 20
ALIKE: Final = 3.0
"""Deviations that the squares of differing lengths may be above what chance makes of equal ones."""


@dataclass(frozen=True, eq=False)
class Lengths:
    """How much longer the distances of k wires are than they can be.

    Attributes:
        length_m: By how much (k,).
        covariance: Of that (k, k), m^2.
        left_m: What is missed once they are subtracted (k,), root mean square, rows weighed as in the fit.
    """

    length_m: Floats
    covariance: Floats
    left_m: Floats

    def of(self, some: Sequence[int]) -> "Lengths":
        """Those of some wires."""
        return Lengths(self.length_m[some], self.covariance[np.ix_(some, some)], self.left_m[some])

    @property
    def common(self) -> tuple[float, float] | None:
        """The length that all have and its standard error, m; None where there is one, or they differ."""
        count = len(self.length_m)
        precision = np.linalg.inv(self.covariance)
        worth = precision.sum(axis=0)
        length = float(worth @ self.length_m / worth.sum())
        away = self.length_m - length
        chance = count - 1 + ALIKE * np.sqrt(2.0 * (count - 1))
        return None if count < 2 or away @ precision @ away > chance else (length, float(worth.sum() ** -0.5))


def counted_parts(noise_m: float, stated_m: Floats) -> Floats:
    """Weights (n,) of rows with such sigmas in a fit that leaves so much beside them, one on average."""
    precision = 1.0 / (max(noise_m, LEAST_LEFT_M) ** 2 + stated_m**2)
    return np.asarray(precision / precision.mean())


def found_together(
    task: Task, data: Measurements, wires: Sequence[Mask], first_m: Floats, determined: Sequence[str]
) -> Lengths | None:
    """Lengths with which the residuals of every wire add up to nothing, everything else fitted anew for each.

    The sum of a wire's residuals, each in parts of its variance, is half of what the sum of squares falls by
    its length, whatever was fitted beside it. Newton's method finds where they vanish, its derivatives by
    differences, then by Broyden's rule.

    Args:
        task: What was fitted.
        data: The rows, n of them.
        wires: Which rows (n,) hold the distances of each of k wires.
        first_m: Lengths (k,) from which the search begins.
        determined: Names of the constants that the rows determine.

    Returns:
        None where no lengths are found.
    """
    columns = task.columns(determined)
    options = fit_options(task.threads, prior=task.options.prior)
    given = np.asarray(data.distance_m)
    holding, _ = distances_apart(data, np.arange(len(data)))
    own = np.array([rows[holding] for rows in wires])

    def left(lengths: Floats) -> tuple[Floats, Floats]:
        shorter = replace(data, distance_m=given - lengths @ np.array(wires))
        problem = task.problem(core_set(task.arm.robot, shorter, task.selection, task.groups), columns)
        fit = fit_constant(problem, options)
        options["start"] = fit.setup
        residuals = np.asarray(fit.residuals).ravel()
        return residuals, counted_parts(fit.noise[0], data.stated_sigma_m[holding])

    def unbalanced(found: tuple[Floats, Floats]) -> Floats:
        return np.asarray(own @ (found[0] * found[1]))

    freedom = len(holding) - len(columns) - setup_unknowns(task) - AXES * len(anchor_names(data)) - len(wires)
    if freedom <= 0:
        return None
    try:
        lengths, found = first_m, left(first_m)
        each = np.eye(len(wires)) * STEP_M
        moved = [unbalanced(left(lengths + step)) - unbalanced(found) for step in each]
        slopes = np.column_stack(moved) / STEP_M
        for _ in range(MOST_STEPS):
            step = -np.linalg.solve(slopes, unbalanced(found))
            lengths, found = lengths + step, left(lengths + step)
            if np.abs(step).max() < ENOUGH_M:
                break
            slopes += np.outer(unbalanced(found), step) / (step @ step)
        else:
            return None
    except (CoreError, np.linalg.LinAlgError):
        return None
    return _lengths(lengths, slopes, own, found, freedom)


def _lengths(
    lengths: Floats, slopes: Floats, own: Mask, found: tuple[Floats, Floats], freedom: int
) -> Lengths | None:
    """What is known of lengths (k,), by residuals and their weights, and how their sums follow (k, k)."""
    counted = -0.5 * (slopes + slopes.T)
    if np.linalg.eigvalsh(counted).min() <= 0.0:
        return None
    residuals, parts = found
    squares = parts * np.square(residuals)
    noise = float(squares.sum()) / freedom
    missed = np.sqrt((own @ squares) / (own @ parts))
    return Lengths(lengths, np.asarray(noise * np.linalg.inv(counted), dtype=np.float64), missed)
