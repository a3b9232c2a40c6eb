"""Gradient-boosted trees of the residual, by LightGBM: one model each for x, y and z."""

from itertools import product
from typing import Any, Final

import numpy as np

from truearm.studies.accuracy.fitted import Correction
from truearm.studies.accuracy.methods.regressor import Setting, fit_regressor
from truearm.studies.accuracy.methods.searching import Effort
from truearm.studies.accuracy.poses import Poses
from truearm.types import Floats

LEAVES: Final = (4, 8, 16)
ROUNDS: Final = (100, 400)
LEAST_ROWS: Final = 5


def fit_trees(poses: Poses, residuals: Floats, effort: Effort) -> Correction:
    """Leaves and rounds that predict best, of the joints."""
    settings: list[Setting] = [
        ("joints", {"leaves": leaves, "rounds": rounds}) for leaves, rounds in product(LEAVES, ROUNDS)
    ]
    return fit_regressor(Trees, effort.some(settings), poses, residuals, effort)


class Trees:
    """Three boosted models as one regressor."""

    def __init__(self, settings: dict[str, Any], seed: int) -> None:
        from lightgbm import LGBMRegressor  # noqa: PLC0415

        self._models = [
            LGBMRegressor(
                n_estimators=settings["rounds"],
                num_leaves=settings["leaves"],
                learning_rate=0.06,
                min_child_samples=LEAST_ROWS,
                reg_lambda=1.0,
                n_jobs=1,
                random_state=seed,
                deterministic=True,
                verbose=-1,
            )
            for _ in range(3)
        ]

    def fit(self, inputs: Floats, outputs: Floats) -> "Trees":
        """Fit to inputs (n, D) and outputs (n, 3)."""
        for axis, model in enumerate(self._models):
            model.fit(inputs, outputs[:, axis])
        return self

    def predict(self, inputs: Floats) -> Floats:
        """Outputs (n, 3) of inputs (n, D)."""
        return np.column_stack([np.asarray(model.predict(inputs)) for model in self._models])
