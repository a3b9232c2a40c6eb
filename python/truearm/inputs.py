"""Inputs of a field: joint values, and features given by name."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from truearm.arrays import as_numbers, check_finite
from truearm.errors import InputError, UsageError, list_names, typed
from truearm.types import Floats

Features = Mapping[str, ArrayLike] | pd.DataFrame


PAYLOAD: Final = "payload"
"""Features whose names begin so are weights that the arm carries."""
PAYLOAD_KG: Final = "payload_kg"
"""The one of them whose unit is known."""


def is_payload(feature: str) -> bool:
    """Whether a feature is a weight that the arm carries: its name is payload_kg, or begins with payload."""
    return feature.lower().startswith(PAYLOAD)


def feature_columns(given: Features | None, names: Sequence[str], count: int) -> Floats:
    """Values (count, F) of the named features.

    Args:
        given: A number, or (count,) numbers, by name; a table has a column for each.
        names: Names of the F features that are needed.
        count: Number of poses.

    Raises:
        UsageError: If a feature is missing, or one is given that is not needed.
        InputError: If a value is no number, is not finite, or there are too many or too few.
    """
    known: Mapping[str, ArrayLike] = {}
    if isinstance(given, Mapping | pd.DataFrame):
        known = {str(name): values for name, values in given.items()}
    elif given is not None:
        raise UsageError(
            f"the features are of type {type(given).__name__}",
            rule="Values by name are needed",
            way_out='Such as features={"temperature_C": 21.5}',
        )
    if set(known) != set(names):
        what = list_names(sorted(known)) or "no features"
        needed = list_names(names) or "none"
        raise UsageError(
            f"{what} given",
            where="features",
            rule=f"The calibration needs {needed}",
            way_out=f"Give --feature {names[0]}=NUMBER, or in Python features={{...}}" if names else "",
        )
    columns = np.empty((count, len(names)))
    for k, name in enumerate(names):
        values = as_numbers(known[name], what=f'values of the feature "{name}"')
        if values.shape not in {(1,), (count,)}:
            raise InputError(
                f'the feature "{name}" has shape {np.shape(known[name])}',
                rule=f"One number, or {count}: one for each pose",
            )
        _check_known(name, values)
        columns[:, k] = values
    return columns


def _check_known(name: str, values: Floats) -> None:
    """Raise InputError where one of a feature's values (n,) is not finite."""
    if values.size == 1 and not np.isfinite(values[0]):
        raise InputError(
            f'the feature "{name}" is {values[0]:g}',
            rule="All values must be finite",
            way_out=f"Give a number: --feature {typed(name)}=NUMBER, or in Python features={{...}}",
        )
    check_finite(values, what=f'values of the feature "{name}"')
