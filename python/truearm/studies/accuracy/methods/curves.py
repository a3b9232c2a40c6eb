"""Constant D-H with a curve of theta for each joint: closed cubic splines, as smooth as the data says."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from scipy.interpolate import BSpline

from truearm.studies.accuracy.fitted import Correction
from truearm.studies.accuracy.methods.linear import Ridge, fit_linear
from truearm.studies.accuracy.methods.searching import Effort
from truearm.studies.accuracy.poses import Poses
from truearm.types import Floats
from truearm.units import FULL_TURN

DEGREE: Final = 3
CELLS: Final = (24, 48, 96, 144)
HEIGHTS_RAD: Final = (1e-3, 3e-4, 1e-4)
BENDS_RAD: Final = (1e-3, 3e-4, 1e-4, 3e-5)


@dataclass(frozen=True, eq=False)
class Curves:
    """Splines of all joints with the same number of cells.

    Attributes:
        cells: Of each joint; over a whole turn, or over its range where it slides.
        ranges: Lowest and highest value of each joint (N, 2).
    """

    cells: int
    ranges: Floats

    def columns(self, poses: Poses) -> Floats:
        """Derivatives of the position with respect to the splines' weights (n, 3, N K)."""
        moves = poses.joint_columns()
        return np.concatenate(
            [
                moves[:, :, joint, None] * self._members(poses, joint)[:, None, :]
                for joint in range(moves.shape[2])
            ],
            axis=2,
        )

    def _members(self, poses: Poses, joint: int) -> Floats:
        """Memberships (n, K) of one joint."""
        values, steps = poses.joints[:, joint], self.cells
        low, high = self.ranges[joint]
        if poses.revolute[joint]:
            values, low, high = np.mod(values, FULL_TURN), 0.0, FULL_TURN
        step = max(high - low, np.finfo(float).tiny) / steps
        knots = low + step * np.arange(-DEGREE, steps + DEGREE + 1)
        inside = np.clip(values, low, np.nextafter(high, low))
        open_members = BSpline.design_matrix(inside, knots, DEGREE).toarray()
        if not poses.revolute[joint]:
            return np.asarray(open_members)
        closed = open_members[:, :steps].copy()
        closed[:, :DEGREE] += open_members[:, steps:]
        return closed

    def penalty(self, poses: Poses, height: float, bend: float) -> Floats:
        """Inverse covariance: weights about zero, and their second differences."""
        sizes = [self.cells if turns else self.cells + DEGREE for turns in poses.revolute]
        whole = np.zeros((sum(sizes), sum(sizes)))
        first = 0
        for size, turns in zip(sizes, poses.revolute, strict=True):
            part = slice(first, first + size)
            bends = _second_differences(size, closed=bool(turns))
            whole[part, part] = np.eye(size) / height**2 + bends.T @ bends / bend**2
            first += size
        return whole


def fit_curves(poses: Poses, residuals: Floats, effort: Effort) -> Correction:
    """Curves with the number of cells, height and bend that predict best."""
    ranges = np.column_stack([poses.joints.min(axis=0), poses.joints.max(axis=0)])
    grid = [_settings(Curves(cells, ranges), poses, effort) for cells in effort.some(CELLS)]
    return fit_linear(grid, poses, residuals, effort)


def _settings(curves: Curves, poses: Poses, effort: Effort) -> Sequence[Ridge]:
    return [
        Ridge(
            curves.columns,
            curves.penalty(poses, height, bend),
            {"cells": curves.cells, "height_rad": height, "bend_rad": bend},
        )
        for height, bend in effort.some(list(product(HEIGHTS_RAD, BENDS_RAD)))
    ]


def _second_differences(size: int, *, closed: bool) -> Floats:
    """Rows that take second differences of weights (k, size)."""
    rows = np.eye(size) - 2.0 * np.roll(np.eye(size), 1, axis=1) + np.roll(np.eye(size), 2, axis=1)
    return rows if closed else rows[:-2]
