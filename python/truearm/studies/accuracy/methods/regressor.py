"""Any regressor with `fit` and `predict` as a correction, its space and settings by cross-validation."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truearm.studies.accuracy.libraries import quiet
from truearm.studies.accuracy.methods.searching import Effort, best_setting
from truearm.studies.accuracy.methods.spaces import Kind, Space
from truearm.studies.accuracy.poses import Poses
from truearm.types import Floats, Rows

Make = Callable[[dict[str, Any], int], Any]
Setting = tuple[Kind, dict[str, Any]]


@dataclass(frozen=True, eq=False)
class Regressor:
    """A fitted regressor; it sees residuals in their standard deviation."""

    space: Space
    regressor: Any
    scale: float
    settings: Mapping[str, Any]

    def predict(self, poses: Poses) -> Floats:
        """The correction in the base frame (n, 3), m."""
        found = self.regressor.predict(self.space.coordinates(poses))
        return np.asarray(found, dtype=np.float64).reshape(len(poses), 3) * self.scale

    def spread(self, _: Poses) -> None:
        """It gives no intervals."""


def fit_regressor(
    make: Make, settings: Sequence[Setting], poses: Poses, residuals: Floats, effort: Effort
) -> Regressor:
    """The regressor with the space and settings that predict best, fitted to all poses.

    Args:
        make: A new regressor from settings and a seed.
        settings: Spaces with settings to try.
        poses: Training poses, n of them.
        residuals: Of the constant model there (n, 3), m.
        effort: How hard to look.
    """
    scale = float(residuals.std()) or 1.0
    spaces = {kind: Space.of(kind, poses) for kind, _ in settings}
    inputs = {kind: space.coordinates(poses) for kind, space in spaces.items()}

    def fitted(setting: Setting, rows: Rows) -> Any:  # noqa: ANN401
        kind, chosen = setting
        with quiet():
            return make(chosen, effort.seed).fit(inputs[kind][rows], residuals[rows] / scale)

    def predict(setting: Setting, fit: Rows, judge: Rows) -> Floats:
        found = fitted(setting, fit).predict(inputs[setting[0]][judge])
        return np.asarray(found).reshape(len(judge), 3) * scale

    best = best_setting(settings, predict, poses, residuals, effort.seed)
    kind, chosen = best
    whole = fitted(best, np.arange(len(poses)))
    return Regressor(spaces[kind], whole, scale, {"space": kind, **chosen})
