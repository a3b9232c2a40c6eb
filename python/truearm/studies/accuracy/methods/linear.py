"""Least squares with a ridge: a correction linear in its weights, fitted together with the constants."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from truearm.fits.parameters import are_lengths
from truearm.studies.accuracy.methods.searching import Effort, folds, search_rows
from truearm.studies.accuracy.poses import Poses
from truearm.types import Floats

Columns = Callable[[Poses], Floats]

CONSTANT_M: Final = 2e-3
CONSTANT_RAD: Final = 2e-3
"""Standard deviations of constants, as in `truearm calibrate`."""
SETUP: Final = 1.0
"""Of frame and target, m and rad: next to free."""


@dataclass(frozen=True, eq=False)
class Ridge:
    """One setting of a linear correction.

    Attributes:
        columns: Derivatives of the position with respect to the weights (n, 3, p).
        penalty: Inverse covariance of the weights (p, p).
        settings: What is special about it.
    """

    columns: Columns
    penalty: Floats
    settings: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Linear:
    """A fitted linear correction."""

    columns: Columns
    weights: Floats
    settings: Mapping[str, Any] = field(default_factory=dict)

    def predict(self, poses: Poses) -> Floats:
        """The correction in the base frame (n, 3), m."""
        found: Floats = with_constants(self.columns, poses) @ self.weights
        return found

    def spread(self, _: Poses) -> None:
        """It gives no intervals."""


def fit_linear(grid: Sequence[Sequence[Ridge]], poses: Poses, residuals: Floats, effort: Effort) -> Linear:
    """The best setting by cross-validation, fitted to all poses.

    Args:
        grid: Settings, those with the same columns together.
        poses: Training poses, n of them.
        residuals: Of the constant model there (n, 3), m.
        effort: How hard to look.
    """
    rows = search_rows(len(poses))
    noise = float(np.square(residuals).mean())
    scored = [
        pair
        for family in grid
        for pair in _scores(family, poses.select(rows), residuals[rows], noise, effort)
    ]
    _, best = min(scored, key=lambda pair: pair[0])
    weights = _solve(*_normal(best, poses, residuals), _penalty(best, poses), noise)
    return Linear(best.columns, weights, best.settings)


def with_constants(columns: Columns, poses: Poses) -> Floats:
    """Columns (n, 3, p + q): those of a correction, of all constants, of frame and of target."""
    return np.concatenate([columns(poses), poses.jacobian, poses.setup], axis=2)


def _scores(
    family: Sequence[Ridge], poses: Poses, residuals: Floats, noise: float, effort: Effort
) -> list[tuple[float, Ridge]]:
    """Mean cross-validated error of each setting; normal equations of the folds are shared by all."""
    divided = folds(poses, effort.seed)
    columns = with_constants(family[0].columns, poses)
    parts = [_sums(columns[judge], residuals[judge]) for _, judge in divided]
    gram, right = (np.sum([part[k] for part in parts], axis=0) for k in (0, 1))
    scored = []
    for ridge in family:
        penalty, error = _penalty(ridge, poses), 0.0
        for (_, judge), part in zip(divided, parts, strict=True):
            weights = _solve(gram - part[0], right - part[1], penalty, noise)
            error += float(np.linalg.norm(residuals[judge] - columns[judge] @ weights, axis=1).sum())
        scored.append((error / len(poses), ridge))
    return scored


def _normal(ridge: Ridge, poses: Poses, residuals: Floats) -> tuple[Floats, Floats]:
    return _sums(with_constants(ridge.columns, poses), residuals)


def _sums(columns: Floats, residuals: Floats) -> tuple[Floats, Floats]:
    rows = columns.reshape(-1, columns.shape[2])
    return rows.T @ rows, rows.T @ residuals.reshape(-1)


def _penalty(ridge: Ridge, poses: Poses) -> Floats:
    """Inverse covariance of all weights."""
    own, links = len(ridge.penalty), poses.jacobian.shape[2]
    lengths = are_lengths(range(links))
    whole = np.zeros((own + links + 9, own + links + 9))
    whole[:own, :own] = ridge.penalty
    deviations = np.concatenate([np.where(lengths, CONSTANT_M, CONSTANT_RAD), np.full(9, SETUP)])
    whole[own:, own:] = np.diag(deviations**-2)
    return whole


def _solve(gram: Floats, right: Floats, penalty: Floats, noise: float) -> Floats:
    found: Floats = cho_solve(cho_factor(gram + noise * penalty, lower=True), right)
    return found
