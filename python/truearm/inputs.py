"""Inputs of a field: joint values, and features given by name."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truearm.arrays import check_finite
from truearm.errors import InputError, UsageError, list_names

Floats = NDArray[np.float64]


PAYLOAD: Final = "payload"
"""Features whose names begin so are weights that the arm carries."""


def is_payload(feature: str) -> bool:
    """Whether a feature is a weight that the arm carries: its name is payload_kg, or begins with payload."""
    return feature.lower().startswith(PAYLOAD)


def feature_columns(given: Mapping[str, ArrayLike] | None, names: Sequence[str], count: int) -> Floats:
    """Values (count, F) of the named features.

    Args:
        given: A number, or (count,) numbers, by name.
        names: Names of the F features that are needed.
        count: Number of poses.

    Raises:
        UsageError: If a feature is missing, or one is given that is not needed.
        InputError: If a value is no number, is not finite, or there are too many or too few.
    """
    known = given or {}
    if set(known) != set(names):
        what = list_names(sorted(map(str, known))) or "no features"
        needed = list_names(names) or "none"
        raise UsageError(
            f"{what} given",
            where="features",
            rule=f"The calibration needs {needed}",
            way_out=f"Give --feature {names[0]}=NUMBER, or in Python features={{...}}" if names else "",
        )
    columns = np.empty((count, len(names)))
    for k, name in enumerate(names):
        try:
            columns[:, k] = np.asarray(known[name], dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(
                f'the feature "{name}" has shape {np.shape(known[name])}',
                rule=f"One number, or {count}: one for each pose",
            ) from None
    if columns.size:
        check_finite(columns, what="features")
    return columns
