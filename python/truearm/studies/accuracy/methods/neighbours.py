"""The mean residual of the nearest training poses, weighted by distance, by scikit-learn."""

from itertools import product
from typing import Any, Final

import numpy as np

from truearm.studies.accuracy.fitted import Correction
from truearm.studies.accuracy.methods.regressor import fit_regressor
from truearm.studies.accuracy.methods.searching import Effort
from truearm.studies.accuracy.methods.spaces import Kind
from truearm.studies.accuracy.poses import Poses
from truearm.types import Floats

SPACES: Final[tuple[Kind, ...]] = ("joints", "circles", "cartesian")
COUNTS: Final = (3, 5, 8, 12, 20)
POWERS: Final = (1.0, 2.0)
CLOSEST: Final = 1e-9


def fit_neighbours(poses: Poses, residuals: Floats, effort: Effort) -> Correction:
    """The space, number of neighbours and power of the distance that predict best."""
    most = max(len(poses) // 2, 1)
    counts = [count for count in COUNTS if count <= most] or [most]
    settings = [
        (kind, {"neighbours": count, "power": power})
        for kind, count, power in product(SPACES, counts, POWERS)
    ]
    return fit_regressor(_make, effort.some(settings), poses, residuals, effort)


def _make(settings: dict[str, Any], _: int) -> Any:  # noqa: ANN401
    from sklearn.neighbors import KNeighborsRegressor  # noqa: PLC0415

    power = settings["power"]

    def weights(distance: Floats) -> Floats:
        return np.asarray(np.maximum(distance, CLOSEST) ** -power)

    return KNeighborsRegressor(n_neighbors=settings["neighbours"], weights=weights)
