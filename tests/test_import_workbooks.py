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
from truearm.raw_tables import Marks, read_raw
from truearm.workbooks import sheet_text

ROWS = [[each if k == 0 else float(each) for each in line.split(",")] for k, line in enumerate(PLAIN.split())]


def workbook(folder: Path, name: str = "book.xlsx", **sheets: Any) -> Path:
    book = Workbook()
    for title, rows in (sheets or {"Sheet1": ROWS}).items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    path = folder / name
    book.save(path)
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
    assert table.remarks == [f"1 line of {tmp_path / 'book.xlsx'}"]


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
    archive = tmp_path / "archive.xlsx"
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("a.txt", "nothing")
    with pytest.raises(InputError, match="a ZIP archive but no Excel workbook"):
        read_raw(archive, Marks())
    archive.write_bytes(workbook(tmp_path).read_bytes()[:900])
    with pytest.raises(InputError, match="a ZIP archive but no Excel workbook"):
        read_raw(archive, Marks())
    with pytest.raises(UsageError, match="is no workbook"):
        read_raw(write(tmp_path, PLAIN), Marks(sheet="day"))
