"""Interpolation between the nodes of a grid of errors, over the workspace or over the first three joints."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, Final

import numpy as np
from scipy.interpolate import NdBSpline
from scipy.sparse import csr_array, eye_array
from scipy.sparse.linalg import spsolve

from truearm.studies.accuracy.fitted import Correction
from truearm.studies.accuracy.methods.searching import Effort, best_setting
from truearm.studies.accuracy.methods.spaces import Kind, Space
from truearm.studies.accuracy.poses import Poses
from truearm.types import AXES, Floats, Rows

SPACES: Final[tuple[Kind, ...]] = ("cartesian", "joints")
NODES: Final = (3, 5, 8)
RIDGES: Final = (0.03, 0.3, 3.0)


@dataclass(frozen=True, eq=False)
class Nodes:
    """A grid with the same number of nodes along each of three axes.

    Attributes:
        space: What it lies in.
        low: Lowest coordinates of training poses (3,).
        high: Highest ones (3,).
        count: Nodes along an axis.
    """

    space: Space
    low: Floats
    high: Floats
    count: int

    def shares(self, poses: Poses) -> csr_array:
        """Shares (n, nodes) of each node; beyond the grid those of its nearest point."""
        inside = np.clip(self.space.coordinates(poses)[:, :AXES], self.low, self.high)
        knots = []
        for low, high in zip(self.low, self.high, strict=True):
            nodes = np.linspace(low, max(high, low + 1e-9), self.count)
            knots.append(np.concatenate([nodes[:1], nodes, nodes[-1:]]))
        found = NdBSpline.design_matrix(inside, tuple(knots), 1)
        return csr_array((found.data, found.indices, found.indptr), shape=(len(inside), self.count**AXES))


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid with errors at its nodes (nodes, 3)."""

    nodes: Nodes
    errors: Floats
    settings: Mapping[str, Any]

    def predict(self, poses: Poses) -> Floats:
        """The correction in the base frame (n, 3), m."""
        return np.asarray(self.nodes.shares(poses) @ self.errors)

    def spread(self, _: Poses) -> None:
        """It gives no intervals."""


def fit_grid(poses: Poses, residuals: Floats, effort: Effort) -> Correction:
    """The space, number of nodes and ridge that predict best; errors at the nodes by least squares."""
    grids = {(kind, count): _nodes(kind, count, poses) for kind, count in product(SPACES, NODES)}
    shares = {key: grid.shares(poses) for key, grid in grids.items()}

    def errors(setting: tuple[tuple[Kind, int], float], rows: Rows) -> Floats:
        key, ridge = setting
        return _least_squares(shares[key][rows], residuals[rows], ridge)

    def predict(setting: tuple[tuple[Kind, int], float], fit: Rows, judge: Rows) -> Floats:
        return np.asarray(shares[setting[0]][judge] @ errors(setting, fit))

    settings = effort.some(list(product(grids, RIDGES)))
    best = best_setting(settings, predict, poses, residuals, effort.seed)
    (kind, count), ridge = best
    told = {"space": kind, "nodes": count, "ridge": ridge}
    return Grid(grids[kind, count], errors(best, np.arange(len(poses))), told)


def _nodes(kind: Kind, count: int, poses: Poses) -> Nodes:
    space = Space.of(kind, poses)
    coordinates = space.coordinates(poses)[:, :AXES]
    return Nodes(space, coordinates.min(axis=0), coordinates.max(axis=0), count)


def _least_squares(shares: csr_array, residuals: Floats, ridge: float) -> Floats:
    normal = (shares.T @ shares + ridge * eye_array(shares.shape[1])).tocsc()
    return np.asarray(spsolve(normal, np.asarray(shares.T @ residuals)))
