"""The rows of a calibration as arrays and JSON values, and back, bit for bit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from truearm.errors import InputError
from truearm.fits.core_set import Selection, distance_count
from truearm.fits.fitted_rows import FittedRows
from truearm.measurements import Measurements
from truearm.tables.columns import APPROACH
from truearm.tables.same_tables import called_as_files

Arrays = dict[str, NDArray[Any]]

NUMBERS: Final = (
    *("readings", "targets", "orientations", "sigma_m", "distance_m", "rows"),
    *("sigma_axes_m", "sigma_rad"),
)
CALLED: Final = "default_group"
WORDS: Final = ("group", "sources", "anchor", "pair", "purpose", CALLED)
OUTCOMES: Final = ("side", "weight", "residual", "score", "distance_m")
OF_SOME: Final = ("moved", "progress", "turned")
"""Outcomes of rows that drift was taken out of, and of those whose turns are not what their residuals say."""


def pack(rows: FittedRows, features: Sequence[str], arrays: Arrays) -> dict[str, Any]:
    """JSON values of rows; their arrays are added to `arrays`."""
    words: dict[str, list[str]] = {}
    for name in NUMBERS:
        value = getattr(rows.data, name)
        if value is not None:
            arrays[f"rows.{name}"] = value
    for name in WORDS:
        value = _called_otherwise(rows.data) if name == CALLED else getattr(rows.data, name)
        if value is not None:
            known, index = np.unique(value, return_inverse=True)
            words[name] = known.tolist()
            arrays[f"rows.{name}"] = index.astype(np.int64)
    kept = [*features, *_stated_sides(rows.data, features)]
    for name in kept:
        arrays[f"rows.feature.{name}"] = rows.data.features[name].to_numpy(np.float64)
    for name in OUTCOMES:
        arrays[f"outcome.{name}"] = getattr(rows, name)
    for name in OF_SOME:
        if getattr(rows, name) is not None:
            arrays[f"outcome.{name}"] = getattr(rows, name)
    return {"words": words, "features": kept, "joint_units": list(rows.data.joint_units)}


def unpack(content: Mapping[str, Any], arrays: Arrays, *, selection: Selection) -> FittedRows:
    """The rows that `pack` described, of which what `selection` names was fitted.

    Raises:
        KeyError: If an array is missing.
        InputError: If there are not as many residuals as distances.
    """
    index = pd.RangeIndex(len(arrays["rows.readings"]))
    words: dict[str, Any] = {
        name: np.array(known, dtype=np.str_)[arrays[f"rows.{name}"]]
        for name, known in content["words"].items()
    }
    words.setdefault(CALLED, called_as_files(words["group"], words["sources"]))
    fields: dict[str, Any] = dict.fromkeys(NUMBERS)
    fields |= {name: np.array(arrays[f"rows.{name}"]) for name in NUMBERS if f"rows.{name}" in arrays}
    columns = {name: arrays[f"rows.feature.{name}"] for name in content["features"]}
    data = Measurements(
        **fields,
        **words,
        features=pd.DataFrame(columns, index=index),
        joint_units=tuple(content["joint_units"]),
    )
    known = [*OUTCOMES, *(name for name in OF_SOME if f"outcome.{name}" in arrays)]
    outcomes: dict[str, Any] = {name: np.array(arrays[f"outcome.{name}"]) for name in known}
    found = FittedRows(data, **outcomes, orientation=selection.orientation)
    return _of_distances(found) if selection.distances else found


def _of_distances(rows: FittedRows) -> FittedRows:
    """Rows whose residuals are those of their distances, in files of earlier versions `distance_m` as well.

    Raises:
        InputError: If there are not as many residuals as distances.
    """
    count = distance_count(rows.data)
    if rows.residual.shape != (count, 1):
        raise InputError(f"the residuals have shape {rows.residual.shape}", rule=f"It must be ({count}, 1)")
    known = rows.distance_m.shape == (len(rows.data),)
    return rows if known else replace(rows, distance_m=np.zeros(len(rows.data)))


def _stated_sides(data: Measurements, features: Sequence[str]) -> list[str]:
    """The column of the sides that poses were approached from, where it says something of every row."""
    if APPROACH in features or APPROACH not in data.features.columns:
        return []
    return [APPROACH] if np.isfinite(data.features[APPROACH].to_numpy(np.float64)).all() else []


def _called_otherwise(data: Measurements) -> NDArray[np.str_] | None:
    """What set-ups are called after their files (n,), "" where a column names them; None where names tell."""
    called = np.full(len(data), "") if data.default_group is None else data.default_group
    return None if np.array_equal(called, called_as_files(data.group, data.sources)) else called
