"""Sheets as instruments write them: units below the names, and numbers that say that nothing was measured."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.import_support import COLUMNS, PLAIN, plan, write
from truearm.cli import main
from truearm.errors import InputError, UsageError
from truearm.importing import Imported, ImportPlan, import_table
from truearm.tables.raw_tables import Marks
from truearm.tables.rotation_columns import RotationColumns

HEAD, FIRST, *REST = PLAIN.splitlines(keepends=True)
MAPS = [word for ours, theirs in COLUMNS.items() for word in ("--map", f"{ours}={theirs}")]
UNITS = ["--joint-unit", "deg", "--length-unit", "mm"]


def below(row: str, rest: str = "".join([FIRST, *REST])) -> str:
    return f"{HEAD}{row}\n{rest}"


@pytest.mark.parametrize("row", ["deg,deg,mm,mm,mm", "[deg],[deg],[mm],[mm],", "°,°,mm,-,(mm)"])
def test_a_row_of_units_below_the_names_is_left_out_and_told(row: str, tmp_path: Path) -> None:
    plain = import_table(write(tmp_path, PLAIN), plan()).frame
    found = import_table(write(tmp_path, below(row)), plan())
    assert found.frame.equals(plain)
    assert [words.split(" of ")[:2] for words in found.remarks] == [["the row", "units below the header"]]


def test_units_below_the_names_have_to_agree_with_those_stated(tmp_path: Path) -> None:
    path = write(tmp_path, below("deg,deg,m,m,m"))
    with pytest.raises(UsageError, match='column "px" says m, --length-unit says mm.*a unit below it'):
        import_table(path, plan())
    assert import_table(path, plan(length_unit="m")).frame["x"].tolist() == [1000.0, 1500.0]


@pytest.mark.parametrize("row", ["deg,deg,mm,mm,7", "1,-,1,-,1", "turn,turn,mm,mm,mm"])
def test_a_row_that_holds_anything_else_stays(row: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="in row 1. It must hold numbers"):
        import_table(write(tmp_path, below(row)), plan())


def test_such_a_row_is_left_out_by_what_it_begins_with(tmp_path: Path) -> None:
    found = import_table(write(tmp_path, below("Grad,Grad,mm,mm,mm")), plan(comments=("Grad,",)))
    assert len(found.frame) == 2


@pytest.mark.parametrize("cell", ["-9999", "-9999.0", "-9.999e3", "-9999.000"])
def test_a_number_says_that_nothing_was_measured_however_it_is_written(cell: str, tmp_path: Path) -> None:
    found = import_table(write(tmp_path, f"{PLAIN}1,2,{cell},{cell},{cell}\n"), plan(missing=("-9999",)))
    assert len(found.frame) == 2
    assert not found.notices


def test_a_number_with_a_decimal_comma_does_too(tmp_path: Path) -> None:
    text = PLAIN.replace(",", ";") + "1;2;-9999,0;-9999,0;-9999,0\n"
    found = import_table(write(tmp_path, text), plan(missing=("-9999",), delimiter=";", decimal=","))
    assert len(found.frame) == 2


def test_what_no_cell_says_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path, PLAIN + "1,2,n/a,n/a,n/a\n")
    words = ["import", str(path), "-o", str(tmp_path / "m.csv"), *MAPS, *UNITS, "--json"]
    assert main([*words, "--missing", "N/A", "--missing", "-999"]) == 0
    out, err = capsys.readouterr()
    (notice,) = json.loads(out)["notices"]
    assert notice["message"].endswith("says what --missing -999 says")
    assert "--missing -999" in err


@pytest.mark.parametrize(
    ("cells", "why"),
    [
        (("20.5", "n/a"), 'holds "n/a" in row 2.*--missing TEXT'),
        (("20.5", "inf"), "holds NaN or infinite values in row 2"),
        (('"20,5"', '"21,5"'), 'holds "20,5".*--decimal ","'),
        (("warm", "cold"), ""),
        (("20.5", "21.5"), ""),
    ],
)
def test_kept_numbers_that_become_text_are_told(cells: tuple[str, str], why: str, tmp_path: Path) -> None:
    lines = PLAIN.splitlines()
    lines = [f"{line},{cell}" for line, cell in zip(lines, ("T", *cells), strict=True)]
    notices = import_table(write(tmp_path, "\n".join(lines)), plan(keep={"temperature": "T"})).notices
    assert [notice.kind for notice in notices] == ["kept_as_text"] * bool(why)
    for notice in notices:
        assert re.search(f'"temperature" is kept as text.*"T" {why}', notice.message)


def test_numbers_are_shown_as_they_are_written(tmp_path: Path) -> None:
    text = "J1;J2;px;py;pz\n1,5;2;1,234,5;2;3\n"
    with pytest.raises(InputError, match='"px" holds "1,234,5" in row 1. A number has one mark'):
        import_table(write(tmp_path, text), plan(delimiter=";", decimal=","))


def test_words_that_are_stated_for_one_of_two_tables_are_told_if_no_cell_says_them(tmp_path: Path) -> None:
    points = tmp_path / "second.txt"
    points.write_text("px,py,pz,note\n1,2,3,no\n4,5,6,\n")
    first = write(tmp_path, "J1,J2\n90,45\n-90,0\n")
    for ours, theirs, unsaid in (
        (("n/a",), ("n/a", "-9"), "n/a -9"),
        ((), ("-9",), "-9"),
        (("-9",), (), "-9"),
        (("no",), ("no",), ""),
    ):
        both = plan(second=points, second_marks=Marks(missing=theirs), missing=ours)
        found = [notice.message for notice in import_table(first, both).notices]
        assert " ".join(message.split()[-2] for message in found) == unsaid


def read_with(tmp_path: Path, text: str, *missing: str, **changes: Any) -> Imported:
    """What `import` makes of a table in our columns, deg and mm, where numbers say that nothing was seen."""
    marks = Marks(missing=missing)
    return import_table(
        write(tmp_path, text), ImportPlan(joint_unit="deg", length_unit="mm", marks=marks, **changes)
    )


OURS = "q1,q2,x,y,z"


def test_a_zero_that_says_nothing_was_measured_is_a_whole_point_and_no_joint(tmp_path: Path) -> None:
    text = f"{OURS},group,load\n10,20,400,5,6,0,0\n0,21,0,0,0,0,5\n0,22,0,15,16,0,5\n"
    found = read_with(tmp_path, text, "0", keep={"load": "load"})
    np.testing.assert_allclose(found.frame[["q1", "q2"]], np.radians([[10, 20], [0, 22]]))
    np.testing.assert_allclose(found.frame[["x", "y", "z"]], [[0.4, 0.005, 0.006], [0.0, 0.015, 0.016]])
    assert found.frame["group"].tolist() == ["0", "0"]
    assert found.frame["load"].tolist() == [0.0, 5.0]
    assert [words.split(" of ")[0] for words in found.left_out] == ["row 2"]
    (notice,) = found.notices
    assert notice.kind == "missing_stays"
    assert notice.message.startswith('column "load" says 0 in row 1, which stays a number')


def test_one_of_two_points_may_be_missing_by_zeros(tmp_path: Path) -> None:
    text = f"{OURS},x2,y2,z2\n10,20,1,2,3,0,0,0\n11,21,0,0,0,4,5,6\n"
    frame = read_with(tmp_path, text, "0").frame
    assert frame[["x", "x2"]].isna().to_numpy().tolist() == [[False, True], [True, False]]


def test_other_numbers_of_kept_columns_are_gaps_and_told_and_of_joints_and_parts_stay(tmp_path: Path) -> None:
    text = f"{OURS},temp\n10,-99,1,2,3,20\n11,21,-99,-99,-99,-99\n12,22,-99,5,6,-99.0\n"
    found = read_with(tmp_path, text, "-99", keep={"temp": "temp"})
    np.testing.assert_array_equal(found.frame["temp"], [20.0, np.nan])
    np.testing.assert_allclose(found.frame["q2"], np.radians([-99.0, 22.0]))
    assert found.frame["x"].tolist() == [0.001, -0.099]
    assert [(notice.kind, notice.message.split(",")[0]) for notice in found.notices] == [
        ("missing_stays", 'column "q2" says -99 in row 1'),
        ("missing_stays", 'column "x" says -99 in row 3'),
        ("missing_kept", 'column "temp" says -99 in row 3'),
    ]


@pytest.mark.parametrize(
    ("rotation", "gap", "stays"),
    [
        ("vector:rad=a,b,c", "-9,-9,-9,", False),
        ("euler:XYZ:deg=a,b,c", "0,0,0,", True),
        ("quaternion:wxyz=a,b,c,d", "0,0,0,0", False),
    ],
)
def test_orientations_are_missing_as_a_whole(rotation: str, gap: str, stays: bool, tmp_path: Path) -> None:
    text = f"{OURS},a,b,c,d\n10,20,1,2,3,{gap}\n11,21,4,5,6,1,0,0,0\n"
    found = read_with(tmp_path, text, "0", "-9", rotation=RotationColumns.parse(rotation))
    assert found.frame["qw"].isna().tolist() == [not stays, False]
    assert [notice.kind for notice in found.notices if "--missing" not in notice.message] == [
        "missing_stays"
    ] * stays
