"""Cells of other people's tables that say, by a word or a number, that nothing was measured."""

from collections.abc import Sequence

import numpy as np

from truearm.tables.reading import Cells, Table, as_number
from truearm.types import Floats


def without_missing(table: Table, missing: Sequence[str], decimal: str) -> tuple[Table, tuple[str, ...]]:
    """The table with empty cells where text says that nothing was measured, and what no cell says.

    A number may be one in another column: cells that say one stay, until it is known what columns mean.

    Args:
        table: The table.
        missing: What such cells say: the same number however it is written, or the same text in any case.
        decimal: The decimal mark.
    """
    if not missing:
        return table, ()
    stated = {word: _meant(word, decimal) for word in missing}
    words = {one for one in stated.values() if isinstance(one, str)}
    columns, found = dict[str, Cells](), set[float | str]()
    for name in table.names:
        cells = table.cells(name)
        meant = [_meant(cell, decimal) for cell in cells]
        found |= set(meant).intersection(stated.values())
        kept = ["" if one in words else cell for one, cell in zip(meant, cells, strict=True)]
        columns[name] = np.array(kept, dtype=np.object_)
    left = tuple(word for word, one in stated.items() if one not in found)
    return Table(table.where, columns, table.row_count, table.remarks), left


def said_numbers(table: Table, name: str, missing: Sequence[str], decimal: str) -> Floats:
    """Of each cell of a column (n,) the number by which it says that nothing was measured; NaN of others."""
    stated = {one for word in missing if isinstance(one := _meant(word, decimal), float)}
    if not stated:
        return np.full(table.row_count, np.nan)
    meant = (_meant(cell, decimal) for cell in table.cells(name))
    return np.array([one if one in stated else np.nan for one in meant], dtype=np.float64)


def _meant(cell: str, decimal: str) -> float | str:
    """The number that a cell holds, else its text in small letters."""
    number = as_number(cell.replace(decimal, "."))
    return cell.casefold() if number is None or not np.isfinite(number) else number
