"""Names that tables in memory give to numbers that are taken by their place, as readings and D-H rows are."""

import re
from collections.abc import Sequence
from typing import Final

import numpy as np

from truearm.errors import UsageError, list_names

JOINT: Final = re.compile(r"q([1-9]\d*)(?:_(rad|deg|m|mm))?")
SI_ENDING: Final = re.compile(r"_(rad|m)$")


def check_readings(values: object, *, what: str) -> None:
    """Check that names of joints, where `values` (n, N) or (N,) has some, are in order and in rad and m.

    Raises:
        UsageError: If they are not: numbers taken by place would be of other joints, or other angles.
    """
    names = _names(values)
    if any(JOINT.fullmatch(name.casefold()) for name in names):
        order = [f"q{number}" for number in range(1, len(names) + 1)]
        way_out = "truearm.Measurements.from_dataframe(table).readings knows names and units"
        _check(names, order, what, f"q1 to q{len(names)}", way_out)


def check_row(values: object, keys: Sequence[str], *, what: str) -> None:
    """Check that columns of `values` (n, c) are in order and in rad and m where their names are `keys`.

    Raises:
        UsageError: If they are not.
    """
    names, order = _names(values), list(keys)
    if any(name.casefold().partition("_")[0] in order for name in names):
        order = order[: len(names)]
        _check(names, order, what, ", ".join(order), f"Convert units, and sort them: table[{order}]")


def _names(values: object) -> list[str]:
    """Names of the columns of a table, such as one of pandas or Polars, or in the index of a series."""
    if isinstance(values, np.ndarray):
        return []
    given = getattr(values, "columns", None)
    given = getattr(values, "index", None) if given is None else given
    names = [] if given is None or callable(given) else list(given)
    return [name.strip() for name in names] if all(isinstance(name, str) for name in names) else []


def _check(names: list[str], order: list[str], what: str, in_words: str, way_out: str) -> None:
    if [SI_ENDING.sub("", name.casefold()) for name in names] != order:
        raise UsageError(
            f"columns of {what} are {list_names(names)}",
            rule=f"They are taken by place, as {in_words} in rad and m",
            way_out=f"{way_out}; table.to_numpy() is taken as it stands",
        )
