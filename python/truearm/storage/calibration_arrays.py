"""What the arrays of a calibration file have to be: of what numbers, whether finite, of which shape."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import InputError

Arrays = Mapping[str, NDArray[Any]]
Shape = Sequence[int | str]

OF_ROWS: Final = ("rows", "outcome")
OF_DISTANCES: Final = ("outcome.residual", "outcome.distance_m")
"""Where distances were fitted these may have a row for each: in files of earlier versions both have."""
HELD: Final = "held"
MEASURED: Final = (*OF_ROWS, HELD)
"""Beginnings of the names of arrays in which NaN stands where nothing was measured."""
INDICES: Final = frozenset(
    {
        *(
            f"rows.{name}"
            for name in ("rows", "group", "sources", "anchor", "pair", "purpose", "default_group")
        ),
        "outcome.side",
        "held.rows",
        "held.sources",
    }
)
OF_REGIONS: Final = (".regions.axis", ".regions.child")
FILE_BEFORE: Final = "update.before"


def check_arrays(arrays: Arrays, content: Mapping[str, Any], table: tuple[int, int], joints: int) -> None:
    """Raise InputError where an array holds what none of a calibration does.

    Args:
        arrays: All of them by name.
        content: The plain values that they belong to.
        table: Shape (L, 5) of the arm's parameters.
        joints: Joints of the arm.
    """
    for name, values in arrays.items():
        _check_numbers(name, values)
    for name in content["models"]:
        _check_shape(arrays, f"{name}.constants", table)
        _check_shape(arrays, f"{name}.frames", ("any", 4, 4))
        groups, targets = len(arrays[f"{name}.frames"]), arrays[f"{name}.targets"].shape[1:2]
        _check_shape(arrays, f"{name}.targets", (groups, *targets, 3))
        _check_shape(arrays, f"{name}.rotations", (groups, 3, 3))
        _check_shape(arrays, f"{name}.anchors", ("any", 3))
    fitted = len(content["constant"]["names"])
    unknowns = max(fitted, len(arrays["constant.covariance"]))
    _check_shape(arrays, "constant.covariance", (unknowns, unknowns))
    if "constant.standard_errors" in arrays:
        _check_shape(arrays, "constant.standard_errors", (fitted,))
    if content["rows"] is not None:
        _check_shape(arrays, "rows.readings", ("any", joints))
        _check_shape(arrays, "rows.targets", ("any", "any", 3))
        exempt = OF_DISTANCES if content["selection"]["distances"] else ()
        _check_lengths(arrays, OF_ROWS, len(arrays["rows.readings"]), exempt)
    if content.get(HELD) is not None:
        _check_shape(arrays, "held.readings", ("any", joints))


def as_stored(arrays: Arrays) -> dict[str, NDArray[Any]]:
    """The arrays as numbers of the kinds that a file holds."""
    return {name: values.astype(_kind(name), copy=False) for name, values in arrays.items()}


def _kind(name: str) -> str:
    if name in INDICES or name.endswith(OF_REGIONS):
        return "int64"
    return "uint8" if name == FILE_BEFORE else "float64"


def _check_numbers(name: str, values: NDArray[Any]) -> None:
    kind = _kind(name)
    if values.dtype != kind:
        raise InputError(f"'{name}' holds {values.dtype} numbers", rule=f"It holds {kind} ones")
    if name.partition(".")[0] not in MEASURED and not np.isfinite(values).all():
        raise InputError(f"'{name}' holds NaN or infinite numbers", rule="All of its numbers are finite")


def _check_shape(arrays: Arrays, name: str, shape: Shape) -> None:
    found = arrays[name].shape
    fits = len(found) == len(shape) and all(
        wanted in ("any", size) for size, wanted in zip(found, shape, strict=True)
    )
    if not fits:
        wanted = ", ".join(map(str, shape))
        raise InputError(f"'{name}' has shape {found}", rule=f"It must be ({wanted})")


def _check_lengths(arrays: Arrays, beginnings: Sequence[str], rows: int, exempt: Sequence[str]) -> None:
    for name, values in arrays.items():
        is_of_rows = name.partition(".")[0] in beginnings and name not in exempt
        if is_of_rows and values.shape[:1] != (rows,):
            raise InputError(f"'{name}' has shape {values.shape}", rule=f"There are {rows} rows")
