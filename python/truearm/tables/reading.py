"""Tables of text: strict CSV in, one column at a time out as numbers or as text."""

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from truearm.errors import InputError, list_rows, typed
from truearm.files import LOOKED_AT, ZIP, decode_text, name_in_text, read_bytes, utf_16_of
from truearm.types import Floats, Integers, Mask, Texts, Whole
from truearm.units import HEADER_UNITS, bare_unit

Cells = NDArray[np.object_] | Floats | Whole | Mask
"""Texts as objects, as in an array of texts each takes what the longest takes; or numbers, or booleans."""

DELIMITERS: Final = {";": "semicolons", "\t": "tabs", "|": "vertical bars", ",": "commas"}
WHOLE: Final = re.compile(r"\d+(\.0+)?")
SHOWN_NAMES: Final = 4


class WaysOut(NamedTuple):
    """What is said of tables that are not even, where "{}" becomes names of columns, "-" for none.

    Attributes:
        uneven: Where lines have another number of fields than the header.
        ended: Where each has one more, which is empty.
        nameless: Where columns have no name.
    """

    uneven: str = "Correct or remove them; if the decimal mark is a comma, use truearm import"
    ended: str = (
        "Lines end with a mark that the header has not: bring the file in with: truearm import FILE "
        '--skip-lines 1 --columns "{}" ...'
    )
    nameless: str = (
        "Name them; if the header is lower, bring the file in with: truearm import FILE --skip-lines 1 ...; "
        'to leave columns out, with: truearm import FILE --skip-lines 1 --columns "{}" ...'
    )


USUAL: Final = WaysOut()
UNIT_WORDS: Final = frozenset(("", "-", "1", "c", "°c", "degc", "k", "kg", "s", "ms", *HEADER_UNITS))
"""What stands below the names of columns where a row says their units."""
SAID: Final = "q1_deg and x_mm"
COMMENTS: Final = ("#", "//")
REMARKS: Final = (*COMMENTS, "sep=", "SEP=")
"""What lines begin with that are not of the table; those of COMMENTS may be anywhere in a file."""
LINES_ASKED: Final = 100
"""Lines at the most that tell what is between the fields of all."""


@dataclass(frozen=True)
class Table:
    """Named columns of equal length, as read.

    Attributes:
        where: File or other place it came from, for messages.
        columns: Text as in the file, or numbers as in a DataFrame, by column name.
        row_count: Number of data rows.
        remarks: In words, columns of the file that are not among them.
        numbers_of_rows: What the rows are called in messages (n,), where they are not counted from 1: those
            of a file of which some were left out.
    """

    where: str
    columns: dict[str, Cells]
    row_count: int
    remarks: tuple[str, ...] = ()
    numbers_of_rows: Integers | None = None
    _numbers: dict[str, Floats] = field(default_factory=dict, repr=False)

    @property
    def names(self) -> list[str]:
        """Names of the columns in their order."""
        return list(self.columns)

    @property
    def row_numbers(self) -> Integers:
        """What the rows are called in messages (n,)."""
        return np.arange(1, self.row_count + 1) if self.numbers_of_rows is None else self.numbers_of_rows

    def texts(self, name: str) -> Texts:
        """A column as text, without blanks around it."""
        return np.array(self.cells(name), dtype=np.str_)

    def cells(self, name: str) -> list[str]:
        """What `texts` gives as a list, which takes no more than the texts do."""
        column = self.columns[name]
        if column.dtype.kind == "f":
            return [_in_words(value) for value in column.tolist()]
        if column.dtype != np.object_:
            return list(map(str, column.tolist()))
        return [cell.strip() for cell in column.tolist()]

    def names_in(self, name: str) -> Texts:
        """A column of names; whole numbers alone go without the point that programs write behind a gap."""
        found = self.texts(name)
        whole = [WHOLE.fullmatch(cell) for cell in found.tolist() if cell]
        if not all(whole):
            return found
        return np.array([cell.partition(".")[0] for cell in found.tolist()], dtype=np.str_)

    def numbers(self, name: str) -> Floats:
        """A column as numbers (n,), NaN where the cell is empty.

        Raises:
            InputError: If a cell holds text, NaN or an infinite value; names the rows.
        """
        column = self.columns[name]
        if column.dtype != np.object_:
            numbers = column.astype(np.float64)
            return self._checked(name, numbers, np.isinf(numbers))
        if name not in self._numbers:
            self._numbers[name] = self._parsed(name)
        return self._numbers[name]

    def is_numeric(self, name: str) -> bool:
        """Whether every cell of a column that is not empty is a number, at least one is, and all finite."""
        try:
            return bool(np.isfinite(self.numbers(name)).any())
        except InputError:
            return False

    def _parsed(self, name: str) -> Floats:
        values = np.full(self.row_count, np.nan)
        bad = np.zeros(self.row_count, dtype=np.bool_)
        for row, cell in enumerate(self.cells(name)):
            if not cell:
                continue
            number = as_number(cell)
            if number is None:
                raise self._no_number(name, row, cell)
            values[row], bad[row] = number, not math.isfinite(number)
        return self._checked(name, values, bad)

    def _checked(self, name: str, values: Floats, bad: NDArray[np.bool_]) -> Floats:
        if bad.any():
            rows = list_rows(self.row_numbers[bad].tolist())
            raise InputError(
                f'column "{name}" holds NaN or infinite values in {rows}',
                where=self.where,
                rule="All values must be finite; an empty cell says that nothing was measured",
                way_out="Correct or remove the rows",
            )
        return values

    def _no_number(self, name: str, row: int, cell: str) -> InputError:
        row_out = self._way_out_of_row(name, cell, row)
        way_out = row_out or (
            "Correct the cell; an empty one says that nothing was measured, and "
            "truearm import --missing TEXT empties those that say so"
        )
        if not row_out and "," in cell and "." not in cell:
            way_out = 'If this is a decimal comma, bring it in by truearm import with --decimal ","'
        return InputError(
            f'column "{name}" holds "{cell}" in row {self.row_numbers[row]}',
            where=self.where,
            rule="It must hold numbers",
            way_out=way_out,
        )

    def _way_out_of_row(self, name: str, cell: str, row: int) -> str:
        """What is said where a row repeats the header or holds the units of the columns; else empty."""
        if cell.casefold() == name.strip().casefold():
            return "The row repeats the header: remove it"
        if holds_units(self.cells(each)[row] for each in self.names):
            return (
                "The row holds the units of the columns: remove it, and state them in their names, as "
                f"{SAID}, or bring the file in by truearm import, which leaves it out"
            )
        return ""


def holds_units(cells: Iterable[str]) -> bool:
    """Whether all cells of a row are units or empty, and at least one is a unit of lengths or angles."""
    said = {bare_unit(cell) for cell in cells}
    return said <= UNIT_WORDS and not said.isdisjoint(HEADER_UNITS)


def table_from_frame(frame: pd.DataFrame, *, where: str, row_numbers: Integers | None = None) -> Table:
    """The columns of a DataFrame: numbers where pandas has numbers, else text; `row_numbers` as in Table."""
    columns: dict[str, Cells] = {}
    for name in frame.columns:
        columns[str(name)] = _cells_of(frame[name])
    if len(columns) != len(frame.columns):
        raise InputError("two columns have the same name", where=where)
    return Table(where, columns, len(frame), numbers_of_rows=row_numbers)


def read_csv_table(path: Path) -> Table:
    """A plain CSV file: UTF-8, a header line, commas between fields, points as decimal marks.

    Raises:
        InputError: If the file is missing, empty, no CSV, or has lines of other lengths; says what it
            looks like and how to bring it in.
    """
    where = name_in_text(str(path))
    content = read_bytes(path)
    if content.startswith(ZIP):
        raise InputError(
            "this is a ZIP archive, such as an Excel workbook",
            where=where,
            rule="Measurement files are CSV",
            way_out=f"Convert a workbook with: truearm import {typed(path)} -o measurements.csv",
        )
    text = decode_text(content, where=where, way_out=_way_out_of_encoding(path, content))
    check_is_table(text, where=where)
    mark = delimiter_of(text) or ","
    if mark != ",":
        raise InputError(
            f"its fields are separated by {DELIMITERS[mark]}",
            where=where,
            rule="Measurement files have commas between fields and points as decimal marks",
            way_out=f"Convert it with: {_import_command(path, text)}",
        )
    return split_table(text, ",", where=where)


def delimiter_of(text: str) -> str | None:
    """The mark between the fields of most lines, remarks apart; None where no line holds one.

    A line with decimal commas may hold one more of them than of what is between its fields.
    """
    lines = (line for line in text.splitlines() if line.strip() and not line.lstrip().startswith(REMARKS))
    said = Counter(mark for line in islice(lines, LINES_ASKED) if (mark := _mark_of(line)))
    return max(said, key=lambda mark: said[mark], default=None)


def _mark_of(line: str) -> str | None:
    """The mark that a line seems to have between its fields."""
    other = max((mark for mark in DELIMITERS if mark != ","), key=line.count)
    commas = line.count(",")
    if line.count(other) and line.count(other) + 1 >= commas:
        return other
    return "," if commas else None


def comment_of(text: str) -> str | None:
    """What the first line of a text begins with if it is a comment."""
    start = text.lstrip()
    return next((mark for mark in COMMENTS if start.startswith(mark)), None)


def _import_command(path: Path, text: str, encoding: str = "") -> str:
    """The command that brings in a file with such a text, of an encoding other than UTF-8 if one is named."""
    mark, comment = delimiter_of(text) or ",", comment_of(text)
    decimal = '","' if re.search(r"\d,\d", text) else '"."'
    marks = "" if mark == "," else f" --delimiter {quoted_delimiter(mark)} --decimal {decimal}"
    coded = f" --encoding {encoding}" if encoding else ""
    said = f' --comment "{comment}"' if comment else ""
    return f"truearm import {typed(path)} -o measurements.csv{coded}{marks}{said}"


def _way_out_of_encoding(path: Path, content: bytes) -> str:
    """What is said where `content` is not UTF-8: how to bring it in if it begins as a table does."""
    utf_16 = utf_16_of(content)
    encoding = utf_16 or "cp1252"
    text = content[:LOOKED_AT].decode(encoding, errors="replace")
    save = "Save it as UTF-8"
    if not any(mark in "".join(text.lstrip().splitlines()[:1]) for mark in DELIMITERS):
        return save
    command = _import_command(path, text, encoding)
    if utf_16:
        return f"{save}, or convert it with: {command}"
    return f"{save}, or convert it, if it comes from Windows in western Europe, with: {command}"


def check_is_table(text: str, *, where: str) -> None:
    """Raise InputError if a text is empty or plainly something other than a table."""
    start = text.lstrip()[:200].casefold()
    if not start:
        raise InputError("the file is empty", where=where, rule="A header line and data rows are needed")
    kinds = {"<!doctype html": "an HTML page", "<html": "an HTML page", "<": "XML", "{": "JSON", "[": "JSON"}
    for beginning, kind in kinds.items():
        if start.startswith(beginning):
            raise InputError(
                f"this is {kind}, not CSV", where=where, way_out="Export the measurements as CSV"
            )


def split_table(text: str, delimiter: str, *, where: str, ways_out: WaysOut = USUAL) -> Table:
    """The fields of a text with a header line; every line must have as many as the header.

    A column with neither name nor content is left out: some programs end lines with a delimiter. So is a
    first one without a name that counts the rows, as pandas writes it.

    Raises:
        InputError: If a name is missing or repeated, a line has another number of fields, or there
            are no data rows.
    """
    source = io.StringIO(_with_plain_ends(text))
    try:
        lines = [line for line in csv.reader(source, delimiter=delimiter, strict=True) if line]
    except csv.Error as error:
        raise InputError(f"not CSV: {error}", where=where) from None
    header = [name.strip() for name in lines[0]]
    _check_header(header, where)
    rows = lines[1:]
    _check_even(header, rows, where, ways_out)
    if not rows:
        raise InputError("there are no data rows below the header", where=where)
    named = [k for k, name in enumerate(header) if name or any(row[k].strip() for row in rows)]
    counts = named[:1] == [0] and not header[0] and _counts([row[0].strip() for row in rows])
    remarks = (f"the first column of {where}, which has no name and counts the rows",) if counts else ()
    named = named[counts:]
    if not named:
        raise InputError("no column has a name", where=where, way_out="Name the columns in the first line")
    _check_names({k + 1: header[k] for k in named}, where, ways_out.nameless)
    columns: dict[str, Cells] = {
        header[k]: np.array([row[k] for row in rows], dtype=np.object_) for k in named
    }
    return Table(where, columns, len(rows), remarks)


def _check_even(header: Sequence[str], rows: Sequence[Sequence[str]], where: str, ways_out: WaysOut) -> None:
    """Raise InputError unless all rows have as many fields as the header."""
    bad = [number for number, row in enumerate(rows, start=1) if len(row) != len(header)]
    if not bad:
        return
    ended = all(len(row) == len(header) + 1 and not row[-1].strip() for row in rows)
    named = dict(enumerate([*header, ""], start=1))
    raise InputError(
        f"{list_rows(bad)} {'has' if len(bad) == 1 else 'have'} another number of fields than the "
        f"header's {len(header)}; {list_rows(bad[:1])} has {len(rows[bad[0] - 1])}",
        where=where,
        way_out=ways_out.ended.format(_all_names(named)) if ended else ways_out.uneven,
    )


def first_record(text: str, delimiter: str, *, where: str) -> list[str]:
    """The fields of the first line of a text that has any; one in quotes may go on in the next.

    Raises:
        InputError: If it is no CSV.
    """
    lines = io.StringIO(_with_plain_ends(text))
    try:
        return next((fields for fields in csv.reader(lines, delimiter=delimiter) if fields), [])
    except csv.Error as error:
        raise InputError(f"not CSV: {error}", where=where) from None


def _with_plain_ends(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _counts(cells: Sequence[str]) -> bool:
    """Whether cells count themselves, from 0 or from 1."""
    return list(cells) in [[str(first + k) for k in range(len(cells))] for first in (0, 1)]


def quoted_delimiter(mark: str) -> str:
    """A delimiter as it is typed on a command line."""
    return "tab" if mark == "\t" else f'"{mark}"'


def _check_header(header: Sequence[str], where: str) -> None:
    if header[0].startswith(REMARKS):
        comment = comment_of(header[0])
        option = f'--comment "{comment}"' if comment else "--skip-lines 1"
        raise InputError(
            f'the first line is a remark: "{header[0]}"',
            where=where,
            rule="The first line must name the columns",
            way_out=f"Delete it, or bring the file in with: truearm import FILE {option} ...",
        )
    if any(header) and all(as_number(name) is not None for name in header if name):
        raise InputError(
            "the first line holds numbers only",
            where=where,
            rule="The first line must name the columns, such as q1,q2,q3,q4,q5,q6,x,y,z",
            way_out="Bring the file in with names: truearm import FILE --columns q1,q2,...,x,y,z ...",
        )


def _check_names(names: Mapping[int, str], where: str, nameless: str) -> None:
    """Raise InputError unless every column, by its position in the file, has a name of its own."""
    empty = [position for position, name in names.items() if not name]
    if empty:
        raise InputError(
            f"{list_rows(empty, 'column')} {'has' if len(empty) == 1 else 'have'} no name",
            where=where,
            way_out=nameless.format(_all_names(names)),
        )
    header = list(names.values())
    repeated = [name for name in dict.fromkeys(header) if header.count(name) > 1]
    if repeated:
        raise InputError(
            f'column "{repeated[0]}" occurs more than once',
            where=where,
            rule="Columns are told apart by their names",
            way_out="Give each a name of its own in the first line",
        )


def _all_names(names: Mapping[int, str]) -> str:
    """Names by their position as truearm import takes them, the first few; "-" leaves a column out."""
    each = [names.get(position) or "-" for position in range(1, max(names) + 1)]
    end = ["-"] if not names[max(names)] else []
    return ",".join(each if len(each) <= SHOWN_NAMES + 1 else [*each[:SHOWN_NAMES], "...", *end])


def _cells_of(column: pd.Series) -> Cells:
    """The cells of a column: whole numbers and booleans as such, which may be names of many digits."""
    types = pd.api.types
    is_whole = types.is_integer_dtype(column)
    if is_whole and not column.hasnans:
        return column.to_numpy(dtype=np.uint64 if types.is_unsigned_integer_dtype(column) else np.int64)
    if types.is_bool_dtype(column) and not column.hasnans:
        return column.to_numpy(dtype=np.bool_)
    if not is_whole and types.is_numeric_dtype(column) and not types.is_complex_dtype(column):
        return column.to_numpy(dtype=np.float64, na_value=np.nan)
    return column.astype(str).where(column.notna(), "").to_numpy(dtype=np.object_)


def _in_words(number: float) -> str:
    """A number as a name: whole ones without a point, NaN as nothing."""
    if np.isnan(number):
        return ""
    return str(int(number)) if number.is_integer() else repr(number)


def as_number(text: str) -> float | None:
    """The number that a cell holds; Python's 1_000 is none in a table."""
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None
