"""Sheets of Excel workbooks as text with tabs between fields."""

import csv
import io
import warnings
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, Final
from zipfile import BadZipFile

from truearm.errors import InputError, UsageError, did_you_mean, list_names
from truearm.files import ZIP

if TYPE_CHECKING:
    from openpyxl import Workbook

DELIMITER: Final = "\t"
Cells = tuple[Any, ...]


def is_workbook(content: bytes) -> bool:
    """Whether a file's content is a ZIP archive, as workbooks are."""
    return content.startswith(ZIP)


def sheet_text(content: bytes, sheet: str | None, *, where: str, decimal: str, option: str) -> str:
    """A sheet's rows as lines: numbers with all their digits, every row as long as the longest.

    Args:
        content: The workbook.
        sheet: Name of the sheet; None takes the only one that is not empty.
        where: The file, for messages.
        decimal: Decimal mark to write numbers with.
        option: Option that names the sheet, for messages.

    Raises:
        InputError: If it is no workbook, all of it is empty, or a formula has no result.
        UsageError: If there is no such sheet, or several and none is named.
    """
    shown, written = _book(content, where, results=True), _book(content, where, results=False)
    name = _named(shown, sheet, where, option) if sheet is not None else _only(shown, where, option)
    rows = []
    for number, (cells, formulas) in enumerate(zip(_rows(shown, name), _rows(written, name), strict=True), 1):
        _check_results(cells, formulas, number, f"{where}, sheet {name}")
        rows.append([_text(cell, decimal) for cell in cells])
    while rows and not any(rows[-1]):
        rows.pop()
    width = max((k + 1 for row in rows for k, cell in enumerate(row) if cell), default=0)
    out = io.StringIO()
    csv.writer(out, delimiter=DELIMITER, lineterminator="\n").writerows(
        (row + [""] * width)[:width] if any(row) else [] for row in rows
    )
    return out.getvalue()


def _book(content: bytes, where: str, *, results: bool) -> "Workbook":
    from openpyxl import load_workbook  # noqa: PLC0415 - seldom needed, and slow to import

    with warnings.catch_warnings():
        # It remarks on styles and rules of cells that it does not know; values are not touched by them.
        warnings.filterwarnings("ignore", module="openpyxl")
        try:
            return load_workbook(io.BytesIO(content), read_only=True, data_only=results)
        except (BadZipFile, KeyError, ValueError) as error:
            raise InputError(
                f"this is a ZIP archive but no Excel workbook: {error}",
                where=where,
                way_out="Save it as .xlsx, or export it as text",
            ) from None


def _named(book: "Workbook", sheet: str, where: str, option: str) -> str:
    names = [each.title for each in book.worksheets]
    if sheet not in names:
        raise UsageError(
            f'there is no sheet "{sheet}"',
            where=f"{where}, {option}",
            rule=did_you_mean(sheet, names),
            way_out=f"Its sheets are {list_names(names)}",
        )
    return sheet


def _only(book: "Workbook", where: str, option: str) -> str:
    """The only sheet that is not empty."""
    filled = [each.title for each in book.worksheets if any(map(_is_filled, _rows(book, each.title)))]
    if not filled:
        raise InputError("its sheets are empty", where=where, rule="A header and data rows are needed")
    if len(filled) > 1:
        raise UsageError(
            f"it has the sheets {list_names(filled)}", where=where, way_out=f"Name one: {option} NAME"
        )
    return filled[0]


def _rows(book: "Workbook", name: str) -> Iterator[Cells]:
    sheet = book[name]
    # Some programs write a wrong size of the sheet into the file.
    sheet.reset_dimensions()
    return iter(sheet.iter_rows(values_only=True))


def _is_filled(cells: Iterable[Any]) -> bool:
    return any(cell is not None for cell in cells)


def _check_results(cells: Cells, formulas: Cells, row: int, where: str) -> None:
    """Raise InputError where a formula has never been worked out: its cell would pass for an empty one."""
    for cell, formula in zip(cells, formulas, strict=True):
        if cell is None and formula is not None:
            raise InputError(
                f"row {row} holds a formula without a result: {formula}",
                where=where,
                way_out="Open and save it in a spreadsheet program, which works it out",
            )


def _text(cell: Any, decimal: str) -> str:  # noqa: ANN401 - whatever a cell holds
    """What a cell says on one line."""
    if cell is None:
        return ""
    if isinstance(cell, float):
        return repr(cell).replace(".", decimal)
    return " ".join(str(cell).split())
