"""What the arrays of a calibration file have to be: of what numbers, whether finite, of which shape."""

from collections.abc import Callable, Mapping, Sequence
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


def _whole(values: NDArray[Any]) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(values).all(axis=-1) | np.isnan(values).all(axis=-1))


def _no_less_than_zero(values: NDArray[Any]) -> NDArray[np.bool_]:
    return np.asarray(np.isnan(values) | (np.isfinite(values) & (values >= 0.0)))


Good = Callable[[NDArray[Any]], NDArray[np.bool_]]
WHOLE: Final = "All numbers of one are finite, or all NaN where it was not measured"
POSITIVE: Final = "Each is zero or more, or NaN where there is none"
OF_EACH_ROW: Final[Mapping[str, tuple[Good, str]]] = {
    "rows.readings": (np.isfinite, "All are finite"),
    "rows.targets": (_whole, WHOLE),
    "rows.orientations": (_whole, WHOLE),
    "rows.sigma_m": (_no_less_than_zero, POSITIVE),
    "rows.sigma_axes_m": (_no_less_than_zero, POSITIVE),
    "rows.sigma_rad": (_no_less_than_zero, POSITIVE),
    "rows.distance_m": (_no_less_than_zero, POSITIVE),
    "outcome.weight": (lambda values: (values >= 0.0) & (values <= 1.0), "Weights are between 0 and 1"),
}
"""Which values of arrays of rows are good, and the rule: what a fit takes, and deviations are found from."""


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
        _check_rows(arrays)
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


def _check_rows(arrays: Arrays) -> None:
    for name, (are_good, rule) in OF_EACH_ROW.items():
        values = arrays.get(name, np.empty((0, 1)))
        bad = np.argwhere(~are_good(values))
        if len(bad):
            value = values[tuple(bad[0])].tolist()
            raise InputError(f"'{name}' holds {value} in row {bad[0][0] + 1}", rule=rule)
