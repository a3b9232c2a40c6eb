"""Tables as other programs write them: marks, remarks and gaps as they are stated."""

import codecs
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from truearm.errors import InputError, UsageError, count_of, did_you_mean
from truearm.files import decode_text, read_bytes, utf_16_of
from truearm.tables.missing_cells import without_missing
from truearm.tables.reading import (
    DELIMITERS,
    Table,
    WaysOut,
    check_is_table,
    comment_of,
    delimiter_of,
    first_record,
    quoted_delimiter,
    split_table,
)
from truearm.tables.unit_row import without_unit_row
from truearm.tables.workbooks import DELIMITER, is_workbook, sheet_text
from truearm.types import Floats, Integers, Texts
from truearm.units import unit_in_header

DECIMAL_MARKS: Final = (".", ",")
UTF_8: Final = ("utf-8", "utf8", "utf-8-sig")
BLANK: Final = " "
UNNAMED: Final = "-"
BLANKS: Final = re.compile(r"[ \t]+")
NUMBER: Final = re.compile(r"[+-]?[\d.,]*\d[\d.,]*([eE][+-]?\d+)?")
ONE_MARK: Final = "A number has one mark, the decimal one"
NO_THOUSANDS: Final = "Write the numbers without marks between thousands"
BRACKETS: Final = ("[", "(", "{")
BYTE_ORDER_MARK: Final = "\ufeff"
SHOWN: Final = 60
"""Characters of a line that are shown in a message."""


@dataclass(frozen=True)
class Marks:
    """How a table is written.

    Attributes:
        delimiter: Mark between fields, a blank for any number of blanks; None takes commas where the file is
            plainly made of them.
        decimal: Decimal mark, "." or ","; None takes points.
        skip_lines: Lines before the header.
        comments: What lines begin with that are remarks.
        missing: What cells say, besides nothing, where nothing was measured: a number, however these write
            it, where it can mean that (missing_numbers), or a text, of which case does not count.
        encoding: Encoding of the text.
        names: Names of the columns of a table without a header, "-" for those to leave out; () with one.
        sheet: Name of the sheet of a workbook; None takes the only one. Workbooks have no delimiter, and no
            encoding, and their lines are rows.
        options: What the options begin with that state these, for messages.
    """

    delimiter: str | None = None
    decimal: str | None = None
    skip_lines: int = 0
    comments: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    encoding: str = "utf-8"
    names: tuple[str, ...] = ()
    sheet: str | None = None
    options: str = "--"

    def __post_init__(self) -> None:
        if self.decimal is not None and self.decimal not in DECIMAL_MARKS:
            raise UsageError(
                f'"{self.decimal}" is not known',
                where=f"{self.options}decimal",
                rule=f"Either {DECIMAL_MARKS[0]} or {DECIMAL_MARKS[1]}",
            )
        if "" in self.names:
            raise UsageError(
                "a name is missing", where=f"{self.options}columns", rule='"-" leaves a column out'
            )
        if "" in self.comments:
            raise UsageError("every line begins with nothing", where="--comment", rule="Name a mark")

    @property
    def unnamed(self) -> dict[str, None]:
        """What columns are called that are left out, in their order."""
        return {f"{UNNAMED} {k}": None for k, name in enumerate(self.names, 1) if name == UNNAMED}


class Part(NamedTuple):
    """A column of one file, some of its rows.

    Attributes:
        table: The file's table.
        name: The column's name in it.
        rows: Which of its rows (n,), from 0.
        marks: How the file is written.
        unit: Its unit in a row of units below the names, as in units.HEADER_UNITS; "" without.
    """

    table: Table
    name: str
    rows: Integers
    marks: Marks
    unit: str = ""

    @property
    def said_unit(self) -> str:
        """The unit that the file says of it, below its name or in it; "" where it says none."""
        return self.unit or unit_in_header(self.name)

    def texts(self) -> Texts:
        """Its cells (n,)."""
        return self.table.texts(self.name)[self.rows]

    def numbers(self) -> Floats:
        """Its numbers (n,), NaN where a cell is empty.

        Raises:
            InputError: If a cell of the file is no number; names the file and its row.
        """
        try:
            if self.marks.decimal == ",":
                pointed = _with_points(self.table, self.name, self.marks.options)
                return pointed.numbers(self.name)[self.rows]
            return self.table.numbers(self.name)[self.rows]
        except InputError as error:
            hint = None if self.marks.decimal else _hint(self.table, self.name, self.marks.options)
            raise (_of_list(self.table, self.name) or hint or error) from None


@dataclass(frozen=True)
class RawTable:
    """Columns of one file or two.

    Attributes:
        where: The file or files, for messages.
        parts: Each column.
        row_count: Number of rows.
        left_out: In words, rows that are empty or, of two files, in one of them only.
        remarks: In words, how many lines were left out as remarks, a row of units, and a column that counts
            the rows.
        unsaid: What cells say where nothing was measured, as it was stated, and none says.
    """

    where: str
    parts: Mapping[str, Part]
    row_count: int
    left_out: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    unsaid: tuple[str, ...] = ()

    @property
    def names(self) -> list[str]:
        """Names of the columns in their order."""
        return list(self.parts)

    def texts(self, name: str) -> Texts:
        """A column as text."""
        return self.parts[name].texts()

    def numbers(self, name: str) -> Floats:
        """A column as numbers, as in Part.numbers."""
        return self.parts[name].numbers()

    def existing(self, name: str) -> str:
        """The name itself.

        Raises:
            UsageError: If there is no such column.
        """
        if name not in self.parts:
            raise UsageError(
                f'there is no column "{name}"',
                where=self.where,
                rule=did_you_mean(name, self.names),
                way_out=f"Its columns are {', '.join(self.names)}",
            )
        return name


def read_raw(path: Path, marks: Marks) -> RawTable:
    """The table in a file.

    Raises:
        InputError: If the file is not what the marks say.
        UsageError: If marks contradict one another or the file, or are missing.
    """
    where = str(path)
    content, stated = _text(path, marks)
    lines = content.splitlines(keepends=True)
    if marks.skip_lines >= len(lines) > 0:
        raise UsageError(f"{marks.skip_lines} lines to skip, the file has {len(lines)}", where=where)
    below = lines[marks.skip_lines :]
    kept = [line for line in below if not (marks.comments and line.lstrip().startswith(marks.comments))]
    text = "".join(kept)
    check_is_table(text, where=where)
    delimiter = stated or _plain_delimiter(text, where, marks.options)
    if delimiter == BLANK:
        text = "\n".join(map(_with_single_blanks, kept))
    if marks.names:
        text = _header(marks, text, delimiter, where) + text
    whole = split_table(text, delimiter, where=where, ways_out=_ways_out(marks, delimiter))
    if delimiter == marks.decimal:
        _check_quoted(whole, delimiter)
    measured, units = (whole, {}) if marks.names else without_unit_row(whole)
    table, unsaid = without_missing(measured, marks.missing, marks.decimal or DECIMAL_MARKS[0])
    rows = np.arange(table.row_count)
    parts = {
        name: Part(table, name, rows, marks, units.get(name, ""))
        for name in table.names
        if name not in marks.unnamed
    }
    left_out = len(below) - len(kept)
    remarks = [f"{count_of(left_out, 'line')} of {where}, as remarks"] if left_out else []
    remarks += [f"the row of units below the header of {where}"] if units else []
    return RawTable(where, parts, table.row_count, remarks=[*remarks, *whole.remarks], unsaid=unsaid)


def _ways_out(marks: Marks, delimiter: str) -> WaysOut:
    """What is said of a table that is not even."""
    above = f"{marks.options}skip-lines leaves out lines above the header"
    quotes = f'. Numbers that hold "{delimiter}" need quotes' if delimiter == marks.decimal else ""
    named = f'{marks.options}skip-lines {marks.skip_lines + 1} {marks.options}columns "{{}}"'
    return WaysOut(
        f"Correct or remove them; {above}, --comment those of remarks{quotes}",
        f"Lines end with a mark that the header has not: {named}",
        f"Name them; {above}. To leave columns out: {named}",
    )


def _check_quoted(table: Table, mark: str) -> None:
    """Raise UsageError if no field holds the mark that is between fields, which is the decimal one, too."""
    if not any(mark in cell for name in table.names for cell in table.cells(name)):
        raise UsageError(
            f'"{mark}" is both delimiter and decimal mark',
            where=table.where,
            rule="Numbers that hold what is between fields are written in quotes, here none is",
        )


def _header(marks: Marks, text: str, delimiter: str, where: str) -> str:
    """The line of names above the rows of a text that has none.

    Raises:
        UsageError: If it has another number of columns, or plainly a header.
    """
    first = first_record(text, delimiter, where=where)
    option = f"{marks.options}columns"
    if len(first) != len(marks.names):
        raise UsageError(
            f"{count_of(len(marks.names), 'name')}, the first line of {where} has "
            f"{count_of(len(first), 'field')}",
            where=option,
            way_out=f"Name them all, {UNNAMED} for those to leave out",
        )
    if not any(NUMBER.fullmatch(cell.strip()) for cell in first):
        raise UsageError(
            f'the first line of {where} holds no number: "{delimiter.join(first)[:SHOWN]}"',
            where=option,
            rule="It names the columns of a table without a header",
            way_out=f"Leave it out, or skip the header: {marks.options}skip-lines 1",
        )
    if not set(marks.names) - {UNNAMED}:
        raise UsageError("all columns are left out", where=option, rule="Name those to bring in")
    unnamed = iter(marks.unnamed)
    names = [next(unnamed) if name == UNNAMED else name.replace('"', '""') for name in marks.names]
    return delimiter.join(f'"{name}"' for name in names) + "\n"


def _with_points(table: Table, name: str, options: str) -> Table:
    """A column with decimal commas as one with points."""
    cells = table.cells(name)
    pointed = [row for row, cell in enumerate(cells, start=1) if "." in cell]
    if pointed:
        cell = cells[pointed[0] - 1]
        raise InputError(
            f'column "{name}" holds "{cell}" in row {pointed[0]}',
            where=table.where,
            rule="With a decimal comma there must be no points",
            way_out=NO_THOUSANDS if "," in cell else f"{NO_THOUSANDS}, or leave out {options}decimal",
        )
    several = [row for row, cell in enumerate(cells, start=1) if cell.count(",") > 1]
    if several:
        raise InputError(
            f'column "{name}" holds "{cells[several[0] - 1]}" in row {several[0]}',
            where=table.where,
            rule=ONE_MARK,
            way_out=NO_THOUSANDS,
        )
    column = np.array([cell.replace(",", ".") for cell in cells], dtype=np.object_)
    return Table(table.where, {name: column}, table.row_count)


def _of_list(table: Table, name: str) -> InputError | None:
    """What is said of a column whose cells hold several numbers in brackets; None of others."""
    lists = [cell for cell in table.cells(name) if cell.lstrip().startswith(BRACKETS)]
    if not lists:
        return None
    return InputError(
        f'column "{name}" holds "{lists[0][:SHOWN]}"',
        where=table.where,
        rule="A cell holds one number, not a list",
        way_out="Export the table with a column for each number",
    )


def _hint(table: Table, name: str, options: str) -> UsageError | None:
    """What is said of a column with commas in its numbers; None of others."""
    commas = [cell for cell in table.cells(name) if "," in cell]
    if not commas:
        return None
    both = "." in commas[0] or commas[0].count(",") > 1
    return UsageError(
        f'column "{name}" holds "{commas[0]}"',
        where=table.where,
        rule=ONE_MARK if both else "",
        way_out=NO_THOUSANDS if both else f'If this is a decimal comma, give {options}decimal ","',
    )


def _with_single_blanks(line: str) -> str:
    """A line with one blank between fields; those within quotes stay."""
    parts = line.strip().split('"')
    return '"'.join(part if k % 2 else BLANKS.sub(BLANK, part) for k, part in enumerate(parts))


def _text(path: Path, marks: Marks) -> tuple[str, str | None]:
    """The text of a file, or of a workbook's sheet, and the delimiter, None where nobody states it."""
    where, content = str(path), read_bytes(path)
    option = f"{marks.options}sheet"
    if is_workbook(content):
        decimal = marks.decimal or DECIMAL_MARKS[0]
        return sheet_text(content, marks.sheet, where=where, decimal=decimal, option=option), DELIMITER
    if marks.sheet is not None:
        raise UsageError(f"{where} is no workbook", where=option, rule="Text has no sheets")
    return _decoded(content, marks, where), marks.delimiter


def _decoded(content: bytes, marks: Marks, where: str) -> str:
    encoding = marks.encoding
    state = (
        f"State what it is: {marks.options}encoding cp1252 for most files of Windows in western Europe, "
        f'{marks.options}encoding utf-16 for "Unicode text" of a spreadsheet'
    )
    if utf_16 := utf_16_of(content):
        state = f"State that: {marks.options}encoding {utf_16}"
    if encoding.casefold() in UTF_8:
        return decode_text(content, where=where, way_out=state)
    if content.startswith(codecs.BOM_UTF8):
        raise UsageError(
            f"its first bytes say that it is UTF-8, not {encoding}", where=where, way_out="State that: utf-8"
        )
    try:
        return content.decode(encoding).removeprefix(BYTE_ORDER_MARK)
    except LookupError:
        raise UsageError(f'"{encoding}" is no known encoding', where=f"{marks.options}encoding") from None
    except UnicodeDecodeError as error:
        raise InputError(f"the text is not {encoding}: {error.reason}", where=where, way_out=state) from None


def _plain_delimiter(text: str, where: str, options: str) -> str:
    """A comma, where the lines are plainly made of them or the first is a comment that names no columns."""
    header = text.lstrip().splitlines()[0]
    best = delimiter_of(text)
    one = best == "," and len(first_record(text.lstrip(), best, where=where)) == 1
    if best is None or (one and not comment_of(header)):
        raise UsageError(
            f'the first line is one field: "{header[:SHOWN]}"',
            where=where,
            way_out=f"Say what is between fields with {options}delimiter, and {options}skip-lines if the "
            "header is lower",
        )
    if best != ",":
        raise UsageError(
            f"its fields seem to be separated by {DELIMITERS[best]}",
            where=where,
            way_out=f"If so, give {options}delimiter {quoted_delimiter(best)}",
        )
    return best
