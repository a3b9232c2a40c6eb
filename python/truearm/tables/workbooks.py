"""Sheets of Excel workbooks as text with tabs between fields."""

import csv
import io
import warnings
import zlib
from typing import Any, Final, NamedTuple
from zipfile import BadZipFile

from truearm.errors import InputError, UsageError, did_you_mean, list_names
from truearm.files import ZIP

DELIMITER: Final = "\t"
# What the library raises of files that hold something else than it expects: XML errors are SyntaxErrors.
DAMAGED: Final = (
    BadZipFile, zlib.error, AttributeError, KeyError, OSError, SyntaxError, TypeError, ValueError
)  # fmt: skip


class Cell(NamedTuple):
    """What a cell holds, and its formula where that has no result that can be relied on."""

    value: Any
    formula: str | None = None


NOTHING: Final = Cell(None)
Sheet = list[list[Cell]]
Sheets = dict[str, Sheet]


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
    sheets = _sheets(content, where)
    name = _only(sheets, where, option) if sheet is None else _named(sheets, sheet, where, option)
    _check_results(sheets[name], f"{where}, sheet {name}")
    rows = [[_text(cell.value, decimal) for cell in row] for row in sheets[name]]
    while rows and not any(rows[-1]):
        rows.pop()
    width = max((k + 1 for row in rows for k, cell in enumerate(row) if cell), default=0)
    out = io.StringIO()
    csv.writer(out, delimiter=DELIMITER, lineterminator="\n").writerows(
        (row + [""] * width)[:width] if any(row) else [] for row in rows
    )
    return out.getvalue()


def _sheets(content: bytes, where: str) -> Sheets:
    """All cells of a workbook by sheet."""
    from openpyxl import load_workbook  # noqa: PLC0415 - seldom needed, and slow to import

    with warnings.catch_warnings():
        # It remarks on styles and rules of cells that it does not know; values are not touched by them.
        warnings.filterwarnings("ignore", module="openpyxl")
        try:
            results, formulas = (
                load_workbook(io.BytesIO(content), read_only=True, data_only=shown) for shown in (True, False)
            )
            stale = bool(results.calculation.fullCalcOnLoad)
            return {
                sheet.title: _cells(sheet, formulas[sheet.title], stale=stale) for sheet in results.worksheets
            }
        except DAMAGED as error:
            raise InputError(
                f"this is a ZIP archive that cannot be read as an Excel workbook: {error}",
                where=where,
                way_out="Save it as .xlsx once more, or export it as text",
            ) from None


def _cells(results: Any, formulas: Any, *, stale: bool) -> Sheet:  # noqa: ANN401 - its types fit no reading
    """Cells of a sheet from its results and its formulas; `stale`: the results are still to be worked out."""
    for sheet in (results, formulas):
        # Some programs write a wrong size of the sheet into the file.
        sheet.reset_dimensions()
    return [
        [_cell(result, formula.value, stale=stale) for result, formula in zip(shown, written, strict=True)]
        for shown, written in zip(results.iter_rows(), formulas.iter_rows(), strict=True)
    ]


def _cell(result: Any, formula: Any, *, stale: bool) -> Cell:  # noqa: ANN401 - of a library with several kinds
    """A cell; one whose result is a text of no length has a result."""
    missing = result.value is None and formula is not None and result.data_type != "str"
    if missing or (stale and result.value != formula):
        return Cell(result.value, str(getattr(formula, "text", formula)))
    return Cell(result.value)


def _named(sheets: Sheets, sheet: str, where: str, option: str) -> str:
    names = list(sheets)
    if sheet not in names:
        raise UsageError(
            f'there is no sheet "{sheet}"',
            where=f"{where}, {option}",
            rule=did_you_mean(sheet, names),
            way_out=f"Its sheets are {list_names(names)}",
        )
    return sheet


def _only(sheets: Sheets, where: str, option: str) -> str:
    """The only sheet that is not empty."""
    filled = [name for name, rows in sheets.items() if any(cell != NOTHING for row in rows for cell in row)]
    if not filled:
        raise InputError("its sheets are empty", where=where, rule="A header and data rows are needed")
    if len(filled) > 1:
        raise UsageError(
            f"it has the sheets {list_names(filled)}", where=where, way_out=f"Name one: {option} NAME"
        )
    return filled[0]


def _check_results(rows: Sheet, where: str) -> None:
    """Raise InputError where a formula was never worked out: its cell would pass for empty or zero."""
    for number, row in enumerate(rows, start=1):
        for cell in row:
            if cell.formula is not None:
                raise InputError(
                    f"row {number} holds a formula without a result: {cell.formula}",
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
