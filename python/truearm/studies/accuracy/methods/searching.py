"""A fair search of a method's settings: cross-validation over a small grid, on some hundred poses."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from truearm.rows.visits import pose_numbers
from truearm.studies.accuracy.fitted import Correction
from truearm.studies.accuracy.poses import Poses
from truearm.types import Floats, Rows

Setting = TypeVar("Setting")
Setting_contra = TypeVar("Setting_contra", contravariant=True)

SEARCH_POSES: Final = 500
"""Settings are looked for on so many poses at the most; the method is then fitted to all of them."""
FOLDS: Final = 4
QUICK_SETTINGS: Final = 2


@dataclass(frozen=True)
class Effort:
    """How hard settings are looked for.

    Attributes:
        seed: Of folds and starts.
        quick: Whether two settings of each grid are enough.
    """

    seed: int = 0
    quick: bool = False

    def some(self, settings: Sequence[Setting]) -> list[Setting]:
        """The settings to try."""
        return list(settings[:QUICK_SETTINGS] if self.quick else settings)


Learn = Callable[[Poses, Floats, Effort], Correction]
"""From poses and residuals of the constant model there (n, 3), m: what is to be added to it."""


def folds(poses: Poses, seed: int) -> list[tuple[Rows, Rows]]:
    """Rows to fit to and rows to judge, for each fold; rows of one pose are in the same fold.

    A setting that follows what the arm does not repeat would predict further rows of a pose best.
    """
    first = pose_numbers(poses.joints, np.full(len(poses), ""))
    number = np.unique(first, return_inverse=True)[1].reshape(-1)
    count = len(np.unique(first))
    order = np.random.default_rng([seed, count]).permutation(count)
    judged = [np.isin(number, part) for part in np.array_split(order, min(FOLDS, count))]
    return [(np.flatnonzero(~rows), np.flatnonzero(rows)) for rows in judged]


def search_rows(count: int) -> Rows:
    """The rows that settings are looked for on; rows are in random order."""
    return np.arange(min(count, SEARCH_POSES))


def best_setting(
    settings: Sequence[Setting],
    predict: Callable[[Setting, Rows, Rows], Floats],
    poses: Poses,
    residuals: Floats,
    seed: int,
) -> Setting:
    """The setting with the lowest mean error over the folds.

    Args:
        settings: What to try.
        predict: From a setting, rows to fit to and rows to predict (k,): predictions (k, 3).
        poses: Training poses, n of them.
        residuals: What is to be predicted (n, 3).
        seed: Of the folds.
    """
    divided = folds(poses.select(search_rows(len(poses))), seed)

    def score(setting: Setting) -> float:
        return sum(
            float(np.linalg.norm(predict(setting, fit, judge) - residuals[judge], axis=1).sum())
            for fit, judge in divided
        )

    return min(settings, key=score)
