"""The fields of measurements that have a value for each row, and what they are made of."""

from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truearm.arrays import as_numbers
from truearm.errors import InputError

LATER: Final = ("sigma_axes_m", "sigma_rad")
"""Content that earlier versions did not know: where there is none, hashes are theirs."""
CONTENT: Final = (
    "readings",
    "targets",
    "orientations",
    "sigma_m",
    "group",
    "distance_m",
    "anchor",
    "pair",
    *LATER,
)
PER_ROW: Final = (*CONTENT, "purpose", "sources", "rows", "default_group", "tables")
NUMBERS: Final = {
    "readings": ("N",),
    "targets": ("T", 3),
    "orientations": (4,),
    "sigma_m": (),
    "distance_m": (),
    "sigma_axes_m": (3,),
    "sigma_rad": (),
}
"""What each row of the fields of numbers is made of; a letter stands for any number."""
WHOLE: Final = ("rows", "tables")
OPTIONAL: Final = (
    "orientations",
    "sigma_m",
    "distance_m",
    "anchor",
    "pair",
    "purpose",
    "default_group",
    "tables",
    *LATER,
)


def as_field(name: str, value: ArrayLike) -> NDArray[Any]:
    """The array of a field with a row for each pose: numbers, whole numbers or names.

    Raises:
        InputError: If it is no such array, or rows have another shape.
    """
    array: NDArray[Any] = as_numbers(value, what=name) if name in NUMBERS else np.asarray(value)
    row = NUMBERS.get(name, ())
    pairs = zip(array.shape[1:], row, strict=False)
    if np.ndim(value) != 1 + len(row) or any(want not in (have, "N", "T") for have, want in pairs):
        raise InputError(
            f"shape {np.shape(value)}",
            where=name,
            rule=f"It must be ({', '.join(str(size) for size in ('n', *row))}{'' if row else ','})",
        )
    if name in NUMBERS:
        return array
    if name not in WHOLE:
        return array.astype(np.str_, copy=False)
    if array.dtype.kind not in "iu":
        raise InputError(f"values of type {array.dtype}", where=name, rule="They must be whole numbers")
    return array.astype(np.int64, copy=False)
