"""Two tables as one: rows that belong together, by what both say or one by one."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import InputError, UsageError, count_of, list_names, list_rows
from truearm.tables.raw_tables import RawTable
from truearm.types import Integers

WHOLE: Final = re.compile(r"0*(\d+)(?:[.,]0*)?")
NAMED: Final = 5


def join_tables(first: RawTable, second: RawTable, on: str | None) -> RawTable:
    """Rows of two tables that belong together, in the order of the first.

    Args:
        first: One table.
        second: The other. A column of a name that the first has too is called "NAME of FILE".
        on: The column that says what belongs together, "NAME" or "NAME=ITS NAME IN THE SECOND"; None takes
            the rows one by one. Its cells have to say the same, zeros before whole numbers and behind their
            point apart. Rows without any cell, as spreadsheets leave behind, take no part; one by one this
            holds for those at the end that the other table has none for.

    Raises:
        InputError: If a value of `on` is missing or there twice, or no row belongs to another; without `on`,
            if one has more rows, or a column of both shows that their order differs.
        UsageError: If a table has no such column.
    """
    if on is None:
        counts = first.row_count, second.row_count
        first, second = _without_empty(first, counts[1]), _without_empty(second, counts[0])
        _check_order(first, second)
        rows = np.arange(first.row_count)
        return _side_by_side(first, second, (rows, rows), "", [])
    name, mark, other = on.partition("=")
    theirs = other if mark else name
    first, second = _without_empty(first), _without_empty(second)
    keys, others = _keys(first, first.existing(name)), _keys(second, second.existing(theirs))
    places = {key: row for row, key in enumerate(others)}
    both = [row for row, key in enumerate(keys) if key in places]
    if not both:
        raise InputError(
            f'no value of "{name}" is in "{theirs}" of {second.where}',
            where=first.where,
            rule=f'It begins with "{first.texts(name)[0]}", the other with "{second.texts(theirs)[0]}"',
            way_out="Name columns that say which rows belong together: --on COLUMN=ITS_OTHER_NAME",
        )
    known = set(keys)
    alone = [
        *_alone(first, name, [row for row, key in enumerate(keys) if key not in places]),
        *_alone(second, theirs, [row for row, key in enumerate(others) if key not in known]),
    ]
    rows = np.array(both)
    return _side_by_side(first, second, (rows, np.array([places[keys[row]] for row in both])), theirs, alone)


def _without_empty(table: RawTable, kept: int | None = None) -> RawTable:
    """The table without rows of which all cells are empty, or without those at its end, beyond the `kept`."""
    cells = np.array([table.texts(name) != "" for name in table.names])
    held: NDArray[np.bool_] = np.asarray(cells.any(axis=0))
    if kept is not None:
        held[: max(kept, int(np.flatnonzero(held).max(initial=-1)) + 1)] = True
    if held.all() or not held.any():
        return table
    rows = next(iter(table.parts.values())).rows
    empty = list_rows((rows[~held] + 1).tolist())
    parts = {name: part._replace(rows=part.rows[held]) for name, part in table.parts.items()}
    words = f"{empty} of {table.where}, as nothing is in {'it' if held.sum() + 1 == len(held) else 'them'}"
    return replace(table, parts=parts, row_count=int(held.sum()), left_out=[*table.left_out, words])


def _check_order(first: RawTable, second: RawTable) -> None:
    """Raise InputError if rows cannot belong together one by one."""
    if first.row_count != second.row_count:
        raise InputError(
            f"{count_of(first.row_count, 'row')}, and {second.row_count} in {second.where}",
            where=first.where,
            rule="Row by row, both must have as many",
            way_out="Name the column that says which belong together: --on COLUMN",
        )
    for name in first.names:
        if name not in second.parts:
            continue
        ours, theirs = ([_key(cell) for cell in table.texts(name).tolist()] for table in (first, second))
        if ours != theirs and _tell_rows_apart(ours, theirs):
            row = next(k for k, (one, other) in enumerate(zip(ours, theirs, strict=True)) if one != other)
            raise InputError(
                f'"{name}" says "{ours[row]}" in row {row + 1}, and "{theirs[row]}" in {second.where}',
                where=first.where,
                rule="Row by row, both must be in the same order",
                way_out=f"Join them by it, where neither says a thing twice: --on {name}. If it does not "
                "tell rows apart, rename it in one of them",
            )


def _tell_rows_apart(ours: Sequence[str], theirs: Sequence[str]) -> bool:
    """Whether a column of as many rows in both tables says which rows are meant, and mostly the same ones.

    One table where it says nothing twice is enough: in the other, a row may be named wrongly.
    """
    apart = max(len(set(ours)), len(set(theirs))) == len(ours)
    return apart and 2 * len(set(ours) & set(theirs)) > len(ours)


def _key(cell: str) -> str:
    """What a cell says, without zeros before a whole number and behind its point."""
    whole = WHOLE.fullmatch(cell)
    return whole[1] if whole else cell


def _keys(table: RawTable, name: str) -> list[str]:
    """What tells the rows apart."""
    said: list[str] = table.texts(name).tolist()
    keys = [_key(cell) for cell in said]
    rows: dict[str, int] = {}
    numbers: list[int] = (table.parts[name].rows + 1).tolist()
    for row, key in enumerate(keys):
        if not key or key in rows:
            before, here = rows.get(key, row), numbers[row]
            twice = f'says "{said[before]}" in row {numbers[before]} and "{said[row]}" in row {here}'
            raise InputError(
                f'column "{name}" {twice if key else f"is empty in row {here}"}',
                where=table.where,
                rule="Rows are told apart by it",
                way_out="Correct it, or leave out --on where the rows of both files are in the same order",
            )
        rows[key] = row
    return keys


def _side_by_side(
    first: RawTable, second: RawTable, rows: tuple[Integers, Integers], key: str, alone: list[str]
) -> RawTable:
    """The rows of both that belong together; in words, those that are `alone`."""
    parts = {name: part._replace(rows=part.rows[rows[0]]) for name, part in first.parts.items()}
    for name, part in second.parts.items():
        if name == key:
            continue
        here = name if name not in first.parts else f"{name} of {Path(second.where).name}"
        if here in parts:
            raise UsageError(f'"{here}" is a column of both tables', where=first.where, way_out="Rename one")
        parts[here] = part._replace(rows=part.rows[rows[1]])
    where = f"{first.where} with {second.where}, rows as joined"
    unsaid = tuple(dict.fromkeys([*_unsaid(first, second), *_unsaid(second, first)]))
    left_out = [*first.left_out, *second.left_out, *alone]
    return RawTable(where, parts, len(rows[0]), left_out, [*first.remarks, *second.remarks], unsaid)


def _unsaid(table: RawTable, other: RawTable) -> list[str]:
    """What no cell of a table says of what was stated, nor of the other where it was stated for that, too."""
    stated = {word for part in other.parts.values() for word in part.marks.missing}
    return [word for word in table.unsaid if word in other.unsaid or word not in stated]


def _alone(table: RawTable, name: str, rows: Sequence[int]) -> list[str]:
    """In words, rows of a table that the other has not."""
    if not rows:
        return []
    keys = table.texts(name)
    named = list_names([str(keys[row]) for row in rows[:NAMED]])
    more = f" and {len(rows) - NAMED} more" if len(rows) > NAMED else ""
    which = f"{count_of(len(rows), 'row')} of {table.where} ({name} {named}{more})"
    return [f"{which}, as they are not in the other table"]
