"""Excel workbooks come in as text does: a sheet is a table, and nothing in it is guessed."""

import datetime as dt
import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from openpyxl import Workbook

from tests.import_support import PLAIN, plan, write
from truearm.cli import main
from truearm.errors import InputError, UsageError
from truearm.importing import import_table
from truearm.tables.raw_tables import Marks, read_raw
from truearm.tables.workbooks import sheet_text

ROWS = [[each if k == 0 else float(each) for each in line.split(",")] for k, line in enumerate(PLAIN.split())]


def workbook(folder: Path, name: str = "book.xlsx", *, stale: bool = False, **sheets: Any) -> Path:
    """A workbook with these sheets; `stale`: what opens it is to work it out."""
    book = Workbook()
    book.calculation.fullCalcOnLoad = stale
    for title, rows in (sheets or {"Sheet1": ROWS}).items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    path = folder / name
    book.save(path)
    return path


# What other programs write where a formula gives a text of no length, and where nothing was worked out yet.
EMPTY_TEXT = {'r="B3"><f>': 'r="B3" t="str"><f>'}
ZERO = {"</f><v></v>": "</f><v>0</v>", "</f><v />": "</f><v>0</v>", "</f><v/>": "</f><v>0</v>"}


def rewritten(path: Path, changes: dict[str, str]) -> Path:
    """The same workbook with other text in its sheets, at least one of it."""
    with zipfile.ZipFile(path) as file:
        contents = {name: file.read(name) for name in file.namelist()}
    changed = 0
    with zipfile.ZipFile(path, "w") as file:
        for name, content in contents.items():
            text = content.decode()
            for old, new in changes.items() if "worksheets/sheet" in name else ():
                changed += text.count(old)
                text = text.replace(old, new)
            file.writestr(name, text)
    assert changed
    return path


def test_a_sheet_is_the_table_that_its_text_would_be(tmp_path: Path) -> None:
    ours = import_table(workbook(tmp_path), plan()).frame
    theirs = import_table(write(tmp_path, PLAIN), plan()).frame
    assert list(ours.columns) == list(theirs.columns)
    np.testing.assert_array_equal(ours, theirs)


# The program that writes the workbook here keeps 15 digits.
NUMBERS = st.floats(-1e300, 1e300).map(lambda value: float(f"{value:.15g}"))


@given(st.lists(NUMBERS, min_size=1, max_size=5))
def test_numbers_keep_all_their_digits(values: list[float]) -> None:
    book = Workbook()
    sheet = book.create_sheet("day")
    for value in values:
        sheet.append([value])
    content = io.BytesIO()
    book.save(content)
    for decimal in ".,":
        text = sheet_text(content.getvalue(), None, where="book", decimal=decimal, option="--sheet")
        assert [float(line.replace(",", ".")) for line in text.split()] == values


def test_lines_above_the_header_and_remarks_are_rows(tmp_path: Path) -> None:
    rows = [["Station 1", "warm"], [], ROWS[0], ["# second day"], *ROWS[1:], [None, None]]
    table = read_raw(workbook(tmp_path, day=rows), Marks(skip_lines=2, comments=("#",)))
    assert table.names == ["J1", "J2", "px", "py", "pz"]
    np.testing.assert_array_equal(table.numbers("J1"), [90.0, -90.0])
    assert table.remarks == [f"1 line of {tmp_path / 'book.xlsx'}, as remarks"]


def test_cells_say_what_they_show(tmp_path: Path) -> None:
    when = dt.datetime(2026, 3, 4, 5, 6, 7)
    rows = [["q1", "X\n [mm]", "when", "ok"], [1, 2.5, when, True], [None, "n/a", "2\t3", False]]
    table = read_raw(workbook(tmp_path, day=rows), Marks(missing=("n/a",)))
    assert table.names == ["q1", "X [mm]", "when", "ok"]
    assert table.texts("when").tolist() == ["2026-03-04 05:06:07", "2 3"]
    assert table.texts("ok").tolist() == ["True", "False"]
    np.testing.assert_array_equal(table.numbers("X [mm]"), [2.5, np.nan])


def test_numbers_that_are_text_have_their_own_decimal_mark(tmp_path: Path) -> None:
    path = workbook(tmp_path, day=[["q1", "x"], ["1,5", 2.25], [0.5, "3,25"]])
    table = read_raw(path, Marks(decimal=","))
    np.testing.assert_array_equal(table.numbers("q1"), [1.5, 0.5])
    np.testing.assert_array_equal(table.numbers("x"), [2.25, 3.25])


def test_sheets_are_joined_as_files_are(tmp_path: Path) -> None:
    joints = [["point", "q1_deg", "q2_deg"], [1, 10, 20], [2, 30, 40]]
    points = [["Nr", "x_mm", "y_mm", "z_mm"], [2, 4, 5, 6], [1, 1, 2, 3]]
    book, output = workbook(tmp_path, joints=joints, points=points), tmp_path / "m.csv"
    command = ["import", str(book), "--sheet", "joints", "--with", str(book), "--with-sheet", "points"]
    assert main([*command, "--on", "point=Nr", "-o", str(output)]) == 0
    rows = np.loadtxt(output, delimiter=",", skiprows=1)
    np.testing.assert_allclose(rows[:, 2:], [[0.001, 0.002, 0.003], [0.004, 0.005, 0.006]])


def test_a_sheet_has_to_be_named_where_several_hold_something(tmp_path: Path) -> None:
    book = workbook(tmp_path, first=ROWS, second=ROWS, third=[])
    with pytest.raises(UsageError, match=r'the sheets "first" and "second".*--sheet NAME'):
        read_raw(book, Marks())
    with pytest.raises(
        UsageError, match=r'no sheet "secnd".*[Dd]id you mean "second".*"first", "second" and "third"'
    ):
        read_raw(book, Marks(sheet="secnd"))
    assert read_raw(book, Marks(sheet="second")).row_count == 2
    assert read_raw(workbook(tmp_path, notes=[], day=ROWS), Marks()).row_count == 2


def test_what_is_no_table_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="its sheets are empty"):
        read_raw(workbook(tmp_path, day=[]), Marks())
    with pytest.raises(InputError, match="the file is empty"):
        read_raw(workbook(tmp_path, day=[]), Marks(sheet="day"))
    with pytest.raises(InputError, match=r"row 2 holds a formula without a result: =A1\+1"):
        read_raw(workbook(tmp_path, day=[["q1"], ["=A1+1"]]), Marks())
    empty = [["q1", "x"], [1.0, 2.0], [3.0, '=IF(A3="","",A3)']]
    assert (
        read_raw(rewritten(workbook(tmp_path, day=empty), EMPTY_TEXT), Marks()).texts("x").tolist()[1] == ""
    )
    zero = rewritten(workbook(tmp_path, stale=True, day=[["q1"], ["=A1+1"]]), ZERO)
    with pytest.raises(InputError, match=r"row 2 holds a formula without a result: =A1\+1"):
        read_raw(zero, Marks())
    with pytest.raises(InputError, match=r"cannot be read as an Excel workbook.*Save it as .xlsx once more"):
        read_raw(rewritten(workbook(tmp_path), {"<sheetData>": "<sheetData><row"}), Marks())
    with pytest.raises(InputError, match="cannot be read as an Excel workbook: invalid literal"):
        read_raw(rewritten(workbook(tmp_path), {"<v>45</v>": "<v>abc</v>"}), Marks())
    archive = tmp_path / "archive.xlsx"
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("a.txt", "nothing")
    with pytest.raises(InputError, match="a ZIP archive that cannot be read as an Excel workbook"):
        read_raw(archive, Marks())
    archive.write_bytes(workbook(tmp_path).read_bytes()[:900])
    with pytest.raises(InputError, match="a ZIP archive that cannot be read as an Excel workbook"):
        read_raw(archive, Marks())
    with pytest.raises(UsageError, match="is no workbook"):
        read_raw(write(tmp_path, PLAIN), Marks(sheet="day"))
