"""Arrays that come in from outside, checked once at the door: numbers, shape, finite."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truearm.errors import InputError, list_names, list_rows
from truearm.fixed_dict import FixedDict
from truearm.named_values import check_readings

if TYPE_CHECKING:
    import pandas as pd

RIGID_WITHIN: Final = 1e-8
"""How far R^T R of a rotation may be from the identity, as in the core; a last row may be as far off."""
NO_REAL_NUMBERS: Final = {
    "c": "complex numbers",
    "M": "dates",
    "m": "lengths of time",
    "S": "bytes",
    "U": "texts",
    "V": "records",
}
"""What NumPy would make real numbers of, or break at, by the kind of its type."""
_IDENTITY: Final = np.eye(3)
_LAST_ROW: Final = np.array([0.0, 0.0, 0.0, 1.0])


class Fault(NamedTuple):
    """What is wrong with some of n matrices.

    Attributes:
        rows: Which these are, counted from 0.
        why: What is wrong with them.
        rule: What they should be.
        way_out: What the user can do about it.
    """

    rows: list[int]
    why: str
    rule: str
    way_out: str


def as_numbers(values: ArrayLike, *, what: str) -> NDArray[np.float64]:
    """`values` as a C-contiguous, aligned array, NaN where a masked array hides them; `what` is for messages.

    Numbers that stand at any byte of a packet, or in a packed record, are copied.

    Raises:
        InputError: If these are no real numbers, or rows of different lengths.
    """
    try:
        given = np.asanyarray(values)
        if given.dtype.kind in NO_REAL_NUMBERS:
            raise TypeError(f"{NO_REAL_NUMBERS[given.dtype.kind]} were given")
        if isinstance(given, np.ma.MaskedArray):
            given = np.ma.filled(given.astype(np.float64), np.nan)
        numbers = np.ascontiguousarray(given, dtype=np.float64)
        return numbers if numbers.flags.aligned else numbers.copy()
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what} are not real numbers: {error}") from None


def as_rows(values: ArrayLike, columns: int, *, what: str) -> tuple[NDArray[np.float64], bool]:
    """`values` (n, columns) or (columns,) as a C-contiguous (n, columns) array.

    Args:
        values: Anything NumPy makes numbers of; columns called q1, q2, ... are to be in order.
        columns: Number of columns it must have.
        what: What the values are, for messages, such as "joint readings".

    Returns:
        The array, and whether it was given as one row.

    Raises:
        InputError: If these are no numbers, the shape is another, or a value is not finite.
        UsageError: If columns of a table have names of joints in another order or unit.
    """
    array = as_numbers(values, what=what)
    single = np.ndim(values) == 1
    rows = array.reshape(1, -1) if single else array
    if rows.ndim != 2 or rows.shape[1] != columns:
        raise InputError(
            f"{what} have shape {np.shape(values)}",
            rule=f"The shape must be (n, {columns}), or ({columns},) for one",
        )
    check_readings(values, what=what)
    check_finite(rows, what=what)
    return rows, single


def check_columns(table: "pd.DataFrame", *, where: str) -> None:
    """Raise InputError naming the columns of a table whose type is none of numbers."""
    wrong = {str(name): kind for name, kind in table.dtypes.items() if kind.kind not in "biuf"}
    if wrong:
        raise InputError(
            f"column {list_names(list(wrong))} of type {list_names([str(kind) for kind in wrong.values()])}",
            where=where,
            rule="Columns hold numbers",
        )


def check_finite(rows: NDArray[np.float64], *, what: str) -> None:
    """Raise InputError naming the rows of `rows` (n, ...) that hold NaN or infinite values."""
    with np.errstate(all="ignore"):
        if np.isfinite(rows.sum()):  # one pass and no mask: this is on the way of every evaluation
            return
    finite = np.isfinite(rows).reshape(len(rows), -1).all(axis=1)
    if not finite.all():
        bad = np.flatnonzero(~finite)
        raise InputError(
            f"{what} hold NaN or infinite values in {list_rows(bad.tolist())} (counted from 0)",
            rule="All values must be finite",
        )


def check_out(out: object, *shape: int, given: NDArray[np.float64]) -> None:
    """Raise InputError unless `out` is None, or takes results of `shape` while `given` is read."""
    if out is None:
        return
    if not isinstance(out, np.ndarray):
        found = f"is of type {type(out).__name__}"
    elif out.dtype != np.float64:
        found = f"is an array of {out.dtype}"
    elif out.shape != shape:
        found = f"has shape {out.shape}"
    elif not out.flags.carray:
        contiguous = "is not aligned" if out.flags.c_contiguous else "is not C-contiguous"
        found = contiguous if out.flags.writeable else "is read-only"
    elif np.may_share_memory(out, given):
        found = "shares memory with what it is worked out from"
    else:
        return
    raise InputError(
        f"out {found}",
        rule=f"It must be a writable array of float64 with shape {shape}, its rows one after another, in "
        "memory of its own",
        way_out=f"Make it with np.empty({shape})",
    )


def frozen(values: ArrayLike, *shape: int) -> NDArray[np.float64]:
    """A read-only copy of `values` in the given shape."""
    array = np.array(values, dtype=np.float64).reshape(shape)
    array.flags.writeable = False
    return array


def read_only(values: NDArray[Any]) -> NDArray[Any]:
    """An array that nothing changes: itself where it and what it is a view of are read-only, else a copy."""
    if _is_fixed(values):
        return values
    copied = values.copy()
    copied.flags.writeable = False
    return copied


def _is_fixed(values: NDArray[Any]) -> bool:
    """Whether an array, and the array whose memory it is a view of, are read-only."""
    seen: object = values
    while isinstance(seen, np.ndarray) and not seen.flags.writeable:
        if seen.flags.owndata:
            return True
        seen = seen.base
    return False


class HoldsReadOnly:
    """A frozen dataclass whose __post_init__ holds its arrays read-only.

    NumPy gives what was pickled or deeply copied back writeable: then they are held so again.
    """

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()

    def __post_init__(self) -> None:
        """Hold the arrays: each kind names its own."""


def hold_read_only(record: object, *names: str) -> None:
    """Make a frozen dataclass's arrays and dicts, those that are not None, its own and read-only.

    It is called in __post_init__.
    """
    for name in names:
        values = getattr(record, name)
        if values is not None:
            held = FixedDict(values) if isinstance(values, Mapping) else read_only(values)
            object.__setattr__(record, name, held)


def as_transforms(values: ArrayLike, *, what: str) -> tuple[NDArray[np.float64], bool]:
    """`values` (n, 4, 4) or (4, 4) as a C-contiguous (n, 4, 4) array of rigid transforms.

    Args:
        values: Anything NumPy makes numbers of.
        what: What the values are, for messages, such as "poses".

    Returns:
        The array, and whether it was given as one transform.

    Raises:
        InputError: If these are no numbers, the shape is another, a value is not finite, or one is not rigid
            to eight digits.
    """
    given = as_numbers(values, what=what)
    if given.ndim not in {2, 3} or given.shape[-2:] != (4, 4):
        raise InputError(f"{what} have shape {given.shape}", rule="The shape must be (4, 4) or (n, 4, 4)")
    rows = given.reshape(-1, 4, 4)
    check_finite(rows, what=what)
    rows, fault = rigid(rows)
    if fault is not None:
        raise InputError(
            f"{what} are not rigid in {list_rows(fault.rows)} (counted from 0): {fault.why}",
            rule=fault.rule,
            way_out=fault.way_out,
        )
    return rows, given.ndim == 2


def rigid(transforms: NDArray[np.float64]) -> tuple[NDArray[np.float64], Fault | None]:
    """Transforms (n, 4, 4) with exact last rows, and what keeps some from being rigid; None if nothing."""
    apart = np.abs(transforms[:, 3] - _LAST_ROW).max(axis=1, initial=0.0)
    if not apart.any():
        return transforms, rotation_fault(transforms[:, :3, :3])
    bad = np.flatnonzero(~(apart <= RIGID_WITHIN))
    if len(bad):
        numbers = " ".join(f"{value:.6g}" for value in transforms[bad[0], 3])
        way_out = "Where the translation stands there, give the transposed matrix"
        return transforms, Fault(bad.tolist(), f"the last row is {numbers}", "It must be 0 0 0 1", way_out)
    exact = transforms.copy()
    exact[:, 3] = _LAST_ROW
    return exact, rotation_fault(exact[:, :3, :3])


def rotation_fault(matrices: NDArray[np.float64], within: float = RIGID_WITHIN) -> Fault | None:
    """What keeps some of matrices (n, 3, 3) from being rotations; None if nothing does.

    Args:
        matrices: They.
        within: How far R^T R may be from the identity.
    """
    apart = np.abs(matrices.transpose(0, 2, 1) @ matrices - _IDENTITY).max(axis=(1, 2), initial=0.0)
    bad = np.flatnonzero(~(apart <= within))
    if len(bad):
        return Fault(
            bad.tolist(),
            f"R^T R differs from the identity by up to {apart[bad].max():.1e}",
            f"A rotation R is orthonormal within {within:g}",
            "Give it in double precision (float64), the nearest rotation if need be: u @ vt of "
            "u, s, vt = np.linalg.svd(R)",
        )
    bad = np.flatnonzero(np.linalg.det(matrices) < 0.0)
    if len(bad):
        why = "R mirrors, its determinant is -1"
        return Fault(bad.tolist(), why, "A rotation is right-handed", "Check order and signs of its axes")
    return None


def as_row_numbers(index: ArrayLike | slice, count: int) -> NDArray[np.int64]:
    """Row numbers from 0 of a boolean mask (count,), a slice or row numbers (m,), negative ones from the end.

    Raises:
        InputError: If it is none of these, or a number is beyond the rows.
    """
    if isinstance(index, slice):
        try:
            return np.arange(count)[index]
        except (TypeError, ValueError) as error:
            raise InputError(f"{index} says no rows: {error}") from None
    given = np.asarray(index)
    whole = given.dtype.kind in "iub" or given.size == 0
    if given.ndim != 1 or not whole or (given.dtype.kind == "b" and len(given) != count):
        raise InputError(
            f"{given.dtype} of shape {given.shape} says no rows",
            rule=f"Rows are said by a boolean mask of {count}, a slice, or row numbers from 0 to {count - 1}",
            way_out=f"One row is said by [{index}]; to go through them all, take the arrays, as data.readings"
            if whole and given.ndim == 0
            else "",
        )
    if given.dtype.kind == "b":
        return np.flatnonzero(given)
    rows = given.astype(np.int64)
    strange = rows[(rows < -count) | (rows >= count)]
    if strange.size:
        raise InputError(f"there is no row {strange[0]}", rule=f"Rows are counted from 0 to {count - 1}")
    return np.where(rows < 0, rows + count, rows)
