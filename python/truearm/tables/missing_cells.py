"""Cells of other people's tables that say, by a word or a number, that nothing was measured."""

from collections.abc import Sequence

import numpy as np

from truearm.tables.reading import Cells, Table, as_number


def without_missing(table: Table, missing: Sequence[str], decimal: str) -> tuple[Table, tuple[str, ...]]:
    """The table with empty cells where they say that nothing was measured, and what no cell says.

    Args:
        table: The table.
        missing: What such cells say: the same number however it is written, or the same text in any case.
        decimal: The decimal mark.
    """
    if not missing:
        return table, ()
    stated = {word: _meant(word, decimal) for word in missing}
    columns, found = dict[str, Cells](), set()
    for name in table.names:
        cells = table.cells(name)
        meant = [_meant(cell, decimal) for cell in cells]
        found |= set(meant).intersection(stated.values())
        kept = ["" if one in stated.values() else cell for one, cell in zip(meant, cells, strict=True)]
        columns[name] = np.array(kept, dtype=np.object_)
    left = tuple(word for word, one in stated.items() if one not in found)
    return Table(table.where, columns, table.row_count, table.remarks), left


def _meant(cell: str, decimal: str) -> float | str:
    """The number that a cell holds, else its text in small letters."""
    number = as_number(cell.replace(decimal, "."))
    return cell.casefold() if number is None or not np.isfinite(number) else number
