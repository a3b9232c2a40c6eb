"""Tables as other programs write them: marks, remarks and gaps as they are stated, one file or two."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truearm.errors import InputError, UsageError, count_of, did_you_mean, list_names
from truearm.files import decode_text, read_bytes
from truearm.reading import DELIMITERS, Table, check_is_table, quoted_delimiter, split_table

Integers = NDArray[np.int64]

DECIMAL_MARKS: Final = (".", ",")
BLANK: Final = " "
BLANKS: Final = re.compile(r"[ \t]+")
STATE_ENCODING: Final = (
    "State what it is: --encoding cp1252 for most files of Windows in western Europe, --encoding utf-16 for "
    '"Unicode text" of a spreadsheet'
)
UNEVEN: Final = (
    "Correct or remove them; --skip-lines leaves out lines above the header, --comment those of remarks"
)
NAMED: Final = 5


@dataclass(frozen=True)
class Marks:
    """How a table is written.

    Attributes:
        delimiter: Mark between fields, a blank for any number of blanks; None takes commas where the file is
            plainly made of them.
        decimal: Decimal mark, "." or ","; None takes points.
        skip_lines: Lines before the header.
        comment: What lines begin with that are remarks; "" where there are none.
        missing: What cells say, besides nothing, where nothing was measured; case does not count.
        encoding: Encoding of the text.
    """

    delimiter: str | None = None
    decimal: str | None = None
    skip_lines: int = 0
    comment: str = ""
    missing: tuple[str, ...] = ()
    encoding: str = "utf-8"

    def __post_init__(self) -> None:
        if self.decimal is not None and self.decimal not in DECIMAL_MARKS:
            raise UsageError(
                f'"{self.decimal}" is not known',
                where="--decimal",
                rule=f"Either {DECIMAL_MARKS[0]} or {DECIMAL_MARKS[1]}",
            )


class Joined(NamedTuple):
    """Two tables as one.

    Attributes:
        table: Rows that are in both, in the order of the first.
        alone: In words, which rows are in one of them only.
    """

    table: Table
    alone: list[str]


def read_raw(path: Path, marks: Marks) -> Table:
    """The table in a file.

    Raises:
        InputError: If the file is not what the marks say.
        UsageError: If marks contradict one another, or are missing.
    """
    where = str(path)
    content = read_bytes(path)
    if marks.encoding.casefold() in ("utf-8", "utf8"):
        text = decode_text(content, where=where, way_out=STATE_ENCODING)
    else:
        text = _decode(content, marks.encoding, where)
    lines = text.splitlines(keepends=True)
    if marks.skip_lines >= len(lines) > 0:
        raise UsageError(f"{marks.skip_lines} lines to skip, the file has {len(lines)}", where=where)
    lines = lines[marks.skip_lines :]
    if marks.comment:
        lines = [line for line in lines if not line.lstrip().startswith(marks.comment)]
    text = "".join(lines)
    check_is_table(text, where=where)
    delimiter = marks.delimiter or _plain_delimiter(text, where)
    if delimiter == marks.decimal:
        raise UsageError(f'"{delimiter}" is both delimiter and decimal mark', where=where)
    if delimiter == BLANK:
        text = "\n".join(BLANKS.sub(BLANK, line.strip()) for line in text.splitlines())
    return _without(split_table(text, delimiter, where=where, uneven=UNEVEN), marks.missing)


def join_tables(first: Table, second: Table, on: str | None) -> Joined:
    """Rows of two tables that belong together.

    Args:
        first: One table.
        second: The other. A column of a name that the first has too is called "NAME of FILE".
        on: The column that says what belongs together, "NAME" or "NAME=ITS NAME IN THE SECOND"; None takes
            the rows one by one.

    Raises:
        InputError: If a value of `on` is missing or there twice, or no row belongs to another; without `on`,
            if one has more rows.
        UsageError: If a table has no such column.
    """
    if on is None:
        if first.row_count != second.row_count:
            raise InputError(
                f"{count_of(first.row_count, 'row')}, and {second.row_count} in {second.where}",
                where=first.where,
                rule="Row by row, both must have as many",
                way_out="Name the column that says which belong together: --on COLUMN",
            )
        rows = np.arange(first.row_count)
        return Joined(_side_by_side(first, second, rows, rows, ""), [])
    name, mark, other = on.partition("=")
    theirs = other if mark else name
    sides = ((first, existing_column(first, name)), (second, existing_column(second, theirs)))
    numeric = all(table.is_numeric(column) for table, column in sides)
    keys, others = (_keys(table, column, numeric=numeric) for table, column in sides)
    places = {key: row for row, key in enumerate(others)}
    both = [row for row, key in enumerate(keys) if key in places]
    if not both:
        raise InputError(
            f'no value of "{name}" is in "{theirs}" of {second.where}',
            where=first.where,
            rule=f'It begins with "{first.texts(name)[0]}", the other with "{second.texts(theirs)[0]}"',
            way_out="Name columns that say which rows belong together: --on COLUMN=ITS_OTHER_NAME",
        )
    table = _side_by_side(
        first, second, np.array(both), np.array([places[keys[row]] for row in both]), theirs
    )
    known = set(keys)
    alone = [
        *_alone(first, name, [row for row, key in enumerate(keys) if key not in places]),
        *_alone(second, theirs, [row for row, key in enumerate(others) if key not in known]),
    ]
    return Joined(table, alone)


def existing_column(table: Table, name: str) -> str:
    """The name itself.

    Raises:
        UsageError: If the table has no such column.
    """
    if name not in table.columns:
        raise UsageError(
            f'there is no column "{name}"',
            where=table.where,
            rule=did_you_mean(name, table.names),
            way_out=f"Its columns are {', '.join(table.names)}",
        )
    return name


def _without(table: Table, missing: Sequence[str]) -> Table:
    """The table with empty cells where they say that nothing was measured."""
    if not missing:
        return table
    words = {word.casefold() for word in missing}
    columns = {}
    for name in table.names:
        cells = table.texts(name)
        columns[name] = np.where([cell.casefold() in words for cell in cells.tolist()], "", cells)
    return Table(table.where, columns, table.row_count)


def _keys(table: Table, name: str, *, numeric: bool) -> list[str]:
    """What tells the rows apart; of numbers the value counts, not how they are written."""
    said: list[str] = table.texts(name).tolist()
    keys = [repr(float(key)) if numeric and key else key for key in said]
    rows: dict[str, int] = {}
    for row, key in enumerate(keys, start=1):
        if not key or key in rows:
            what = (
                f'says "{said[row - 1]}" in rows {rows[key]} and {row}' if key else f"is empty in row {row}"
            )
            raise InputError(
                f'column "{name}" {what}',
                where=table.where,
                rule="Rows are told apart by it",
                way_out="Correct it, or leave out --on where the rows of both files are in the same order",
            )
        rows[key] = row
    return keys


def _side_by_side(first: Table, second: Table, rows: Integers, others: Integers, key: str) -> Table:
    columns = {name: column[rows] for name, column in first.columns.items()}
    for name, column in second.columns.items():
        if name == key:
            continue
        here = name if name not in first.columns else f"{name} of {Path(second.where).name}"
        columns[here] = column[others]
    return Table(f"{first.where} with {second.where}", columns, len(rows))


def _alone(table: Table, name: str, rows: Sequence[int]) -> list[str]:
    """In words, rows of a table that the other has not."""
    if not rows:
        return []
    keys = table.texts(name)
    named = list_names([str(keys[row]) for row in rows[:NAMED]])
    more = f" and {len(rows) - NAMED} more" if len(rows) > NAMED else ""
    return [f"{count_of(len(rows), 'row')} of {table.where} ({name} {named}{more})"]


def _decode(content: bytes, encoding: str, where: str) -> str:
    try:
        return content.decode(encoding)
    except LookupError:
        raise UsageError(f'"{encoding}" is no known encoding', where="--encoding") from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"the text is not {encoding}: {error.reason}", where=where, way_out=STATE_ENCODING
        ) from None


def _plain_delimiter(text: str, where: str) -> str:
    header = text.lstrip().splitlines()[0]
    counts = {mark: header.count(mark) for mark in DELIMITERS}
    best = max(counts, key=lambda mark: counts[mark])
    if counts[best] == 0:
        raise UsageError(
            f'the header is one field: "{header[:60]}"',
            where=where,
            way_out="Say what is between fields with --delimiter, and --skip-lines if the header is lower",
        )
    if best != ",":
        raise UsageError(
            f"its fields seem to be separated by {DELIMITERS[best]}",
            where=where,
            way_out=f"If so, give --delimiter {quoted_delimiter(best)}",
        )
    return best
