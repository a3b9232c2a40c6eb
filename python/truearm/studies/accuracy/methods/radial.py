"""Radial basis functions of the residual, by scipy."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, Final, Literal

import numpy as np
from scipy.interpolate import RBFInterpolator

from truearm.studies.accuracy.fitted import Correction
from truearm.studies.accuracy.methods.searching import Effort, best_setting
from truearm.studies.accuracy.methods.spaces import Kind, Space
from truearm.studies.accuracy.poses import Poses
from truearm.types import Floats, Rows

SPACES: Final[tuple[Kind, ...]] = ("joints", "circles", "cartesian")
Shape = Literal["linear", "gaussian"]
Setting = tuple[Kind, tuple[Shape, float], float]

SHAPES: Final[tuple[tuple[Shape, float], ...]] = (
    ("linear", 1.0),
    ("gaussian", 0.3),
    ("gaussian", 0.7),
    ("gaussian", 1.5),
    ("gaussian", 3.0),
)
"""Kernels and what coordinates are multiplied by. Higher polyharmonic ones need polynomials of more terms
than there may be poses, and were no better where they could be tried."""
SMOOTHING: Final = (1e-2, 1e-1, 1.0, 10.0)


@dataclass(frozen=True, eq=False)
class Radial:
    """Fitted radial basis functions."""

    space: Space
    functions: RBFInterpolator
    settings: Mapping[str, Any]

    def predict(self, poses: Poses) -> Floats:
        """The correction in the base frame (n, 3), m."""
        return np.asarray(self.functions(self.space.coordinates(poses)))

    def spread(self, _: Poses) -> None:
        """They give no intervals."""


def fit_radial(poses: Poses, residuals: Floats, effort: Effort) -> Correction:
    """The space, shape and smoothing that predict best."""
    spaces = {kind: Space.of(kind, poses) for kind in SPACES}
    inputs = {kind: space.coordinates(poses) for kind, space in spaces.items()}

    def functions(setting: Setting, rows: Rows) -> RBFInterpolator:
        kind, (shape, width), smoothing = setting
        return RBFInterpolator(
            inputs[kind][rows], residuals[rows], kernel=shape, epsilon=width, smoothing=smoothing, degree=0
        )

    def predict(setting: Setting, fit: Rows, judge: Rows) -> Floats:
        return np.asarray(functions(setting, fit)(inputs[setting[0]][judge]))

    settings = effort.some(list(product(SPACES, SHAPES, SMOOTHING)))
    best = best_setting(settings, predict, poses, residuals, effort.seed)
    kind, (shape, width), smoothing = best
    told = {"space": kind, "kernel": shape, "epsilon": width, "smoothing": smoothing}
    return Radial(spaces[kind], functions(best, np.arange(len(poses))), told)
