"""Measurement files that are wrong: the message says what, where, the rule and the way out."""

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from truearm.errors import InputError, UsageError
from truearm.measurements import Measurements

TABLES = {
    "no joint columns": (
        "J1,J2,x,y,z",
        ["0,0,1,2,3"],
        r"no joint columns q1, q2, .*columns are J1, J2, x, y, z.*--map",
    ),
    "joint left out": ("q1,q3,x,y,z", ["0,0,1,2,3"], 'Joint column "q2" is missing before "q3"'),
    "misspelt axis": ("q1,x,y,Z", ["0,1,2,3"], 'Column "z" is missing. Did you mean "Z"'),
    "misspelt positions": ("q1,X,Y,Z", ["0,1,2,3"], 'No position x, y, z and no distance. Did you mean "X"'),
    "half a second target": ("q1,x,y,z,x2,y2", ["0,1,2,3,4,5"], 'Column "z2" is missing'),
    "third target, no second": ("q1,x,y,z,x3,y3,z3", ["0,1,2,3,4,5,6"], "Target 3 is there without"),
    "half a quaternion": ("q1,x,y,z,qw,qx,qy", ["0,1,2,3,1,0,0"], 'Column "qz" of the quaternion is missing'),
    "one name twice": ("q1,x,x,y,z", ["0,1,1,2,3"], 'column "x" occurs more than once'),
    "one meaning twice": ("q1,x,x_mm,y,z", ["0,1,1,2,3"], 'columns "x" and "x_mm" mean the same'),
    "column without name behind an empty one": ("q1,,x,,y", ["0,,1,2,3"], "column 4 has no name"),
    "no header, delimiters behind": ("0,0,1,2,3,", ["0,0,1,2,3,"], "first line holds numbers only"),
    "an index with gaps": (
        ",q1,x,y,z",
        ["0,0,1,2,3", "2,1,1,2,3"],
        'column 1 has no name.*truearm import FILE --skip-lines 1 --columns "-,q1,x,y,...',
    ),
    "delimiters alone": (",,", [",,"], "no column has a name"),
    "column without name": ("q1,x,,y,z", ["0,1,1,2,3"], "column 3 has no name"),
    "columns without names": (
        "q1,x,y,z,,",
        ["0,1,2,3,,", "0,1,2,3,4,5"],
        "columns 5 and 6 have no name.*--skip-lines",
    ),
    "remark first": ("# made by a tool", ["q1,x,y,z", "0,1,2,3"], 'is a remark.*--comment "#"'),
    "remark with semicolons": ("// AT; mm; deg", ["q1,x,y,z", "0,1,2,3"], 'is a remark.*--comment "//"'),
    "separator first": ("sep=,", ["q1,x,y,z", "0,1,2,3"], "is a remark.*--skip-lines 1"),
    "no header": ("0,0,1,2,3", ["0,0,1,2,3"], "first line holds numbers only.*q1,q2"),
    "mixed angles": ("q1_deg,q2,x,y,z", ["0,0,1,2,3"], 'mixed units: column "q1_deg" is in deg, "q2" in SI'),
    "an angle, or a stroke in m": (
        "q1_deg,q2,x,y,z",
        ["0,0,1,2,3"],
        r'"q2" in SI.*prismatic joint, end its name in _m or _mm, or say which joints .*joints=robot.joints',
    ),
    "mixed lengths": ("q1,x_mm,y,z_mm", ["0,1,2,3"], 'mixed units: column "x_mm" is in mm, "y" in SI'),
    "mixed lengths of targets": ("q1,x,y,z,x2_mm,y2_mm,z2_mm", ["0,1,2,3,4,5,6"], "mixed units"),
    "NaN with a sign": (
        "q1,x,y,z",
        ["0,-nan,2,3", "0,1,+NaN,3"],
        r'column "x" holds NaN or infinite values in row 1',
    ),
    "NaN": (
        "q1,x,y,z",
        ["0,1,2,3", "0,nan,2,3", "1,2,3,NaN"],
        r'column "x" holds NaN or infinite values in row 2',
    ),
    "infinite": (
        "q1,x,y,z",
        ["0,1,2,3", "-inf,1,2,3", "1e999,1,2,3"],
        r'"q1" holds NaN or infinite.* in rows 2 and 3',
    ),
    "text": ("q1,x,y,z", ["0,1,2,3", "0,1,n/a,3"], 'column "y" holds "n/a" in row 2. It must hold numbers'),
    "number for programmers": ("q1,x,y,z", ["0,1,2,3", "0,1_000,2,3"], 'column "x" holds "1_000" in row 2'),
    "empty joint": (
        "q1,x,y,z",
        ["0,1,2,3", ",1,2,3"],
        'column "q1" is empty in row 2. Every row needs all joints',
    ),
    "half a point": ("q1,x,y,z", ["0,1,2,3", "0,1,,3"], 'only some of "x", "y" and "z" are given in row 2'),
    "nothing measured": ("q1,x,y,z", ["0,1,2,3", "0,,,"], "nothing was measured in row 2"),
    "half an orientation": ("q1,x,y,z,qw,qx,qy,qz", ["0,1,2,3,1,,0,0"], 'only some of "qw" to "qz" .* row 1'),
    "long quaternion": (
        "q1,x,y,z,qw,qx,qy,qz",
        ["0,1,2,3,1,0,0,0", "0,1,2,3,1,0,0,0.1", "0,1,2,3,2,0,0,0"],
        r"not length 1 \(up to 2\) in rows 2 and 3. Orientations are unit quaternions, w first",
    ),
    "sigma zero": (
        "q1,x,y,z,sigma_mm",
        ["0,1,2,3,0.1", "0,1,2,3,0"],
        '"sigma_mm" is empty, zero or negative in row 2',
    ),
    "sigma of no instrument": (
        "q1,x,y,z,sigma",
        ["0,1,2,3,0.0001", "0,1,2,3,1e300"],
        '"sigma" is larger than 10 m in row 2.*sigma is in m, sigma_mm in mm',
    ),
    "sigma empty": ("q1,x,y,z,sigma_mm", ["0,1,2,3,"], "empty, zero or negative in row 1"),
    "sigma of one axis": ("q1,x,y,z,sigma_x_mm,sigma_y_mm", ["0,1,2,3,1,1"], 'Column "sigma_z" is missing'),
    "sigma of one axis empty": (
        "q1,x,y,z,sigma_x,sigma_y,sigma_z",
        ["0,1,2,3,1,1,"],
        '"sigma_z" is empty, zero or negative in row 1',
    ),
    "sigmas of axes and of all": (
        "q1,x,y,z,sigma_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm",
        ["0,1,2,3,1,1,1,1"],
        'columns "sigma_mm" and "sigma_x_mm" mean the same. Keep one of them',
    ),
    "sigmas of axes in mixed units": (
        "q1,x,y,z,sigma_x_mm,sigma_y_m,sigma_z_mm",
        ["0,1,2,3,1,1,1"],
        'mixed units: column "sigma_x_mm" is in mm, "sigma_y_m" in m',
    ),
    "sigma that means nothing": (
        "q1,x,y,z,sigma2_mm",
        ["0,1,2,3,1"],
        '"sigma2_mm" begins with "sigma" and is none that is known. Known are sigma_mm .*; sigma_x_mm, .*'
        "sigma_mrad .*Rename it",
    ),
    "sigma in capitals": ("q1,x,y,z,Sigma_X", ["0,1,2,3,1"], '"Sigma_X" begins with "sigma" and is none'),
    "sigma of orientations that are not there": (
        "q1,x,y,z,sigma_mrad",
        ["0,1,2,3,1"],
        '"sigma_mrad" is of nothing that was measured. There are no orientations qw, qx, qy, qz. Remove it',
    ),
    "sigmas of axes of distances": (
        "q1,distance,anchor,sigma_x,sigma_y,sigma_z",
        ["0,1,a,1,1,1"],
        '"sigma_x" is of nothing that was measured. There are no coordinates x, y, z. .*sigma_mm',
    ),
    "sigma of no orientation": (
        "q1,x,y,z,qw,qx,qy,qz,sigma_rad",
        ["0,1,2,3,1,0,0,0,20"],
        '"sigma_rad" is larger than 1 rad in row 1',
    ),
    "group empty": ("q1,x,y,z,group", ["0,1,2,3,a", "0,1,2,3,"], '"group" is empty in row 2'),
    "distance to nowhere": (
        "q1,distance,anchor",
        ["0,1,"],
        "the distance leads nowhere in row 1.*anchor.*pair",
    ),
    "distance to both": ("q1,distance,anchor,pair", ["0,1,a,p"], "leads to an anchor and a pair in row 1"),
    "distance negative": ("q1,distance,anchor", ["0,-1,a"], '"distance" is not positive in row 1'),
    "pair of one": ("q1,distance,pair", ["0,1,p"], 'not exactly two rows share the name in "pair" in row 1'),
    "pair of three": ("q1,distance,pair", ["0,1,p"] * 3, "rows 1, 2 and 3"),
    "two distances of a pair": (
        "q1,distance,pair",
        ["0,1,p", "1,2,p"],
        'pair "p" has two distances, 1 m and 2 m',
    ),
    "two sigmas of a pair": (
        "q1,distance,pair,sigma_mm",
        ["0,1,p,0.02", "1,1,p,1"],
        'pair "p" has two sigmas, 2e-05 m and 0.001 m, in rows 1 and 2. Both rows .* the same sigma',
    ),
    "pair without distance": (
        "q1,x,y,z,distance,pair",
        ["0,1,2,3,,p", "1,1,2,3,1,p"],
        "distance of a pair is empty in row 1",
    ),
    "header again": ("q1,x,y,z", ["0,1,2,3", "q1,x,y,z"], '"q1" in row 2.*repeats the header: remove it'),
    "units below": ("q1,x,y,z", ["rad,m,m,m", "0,1,2,3"], '"rad" in row 1.*holds the units .*: remove it'),
    "no units": ("q1,x,y,z", ["rad,1,2,3"], '"rad" in row 1.*--missing TEXT'),
    "no rows": ("q1,x,y,z", [], "no data rows below the header"),
    "short line": (
        "q1,x,y,z",
        ["0,1,2,3", "0,1,2"],
        "row 2 has another number of fields than the header's 4; row 2 has 3",
    ),
    "long lines": ("q1,x,y,z", ["0,1,2,3,4", "0,1,2,3,4"], "rows 1 and 2 have another number"),
}
CONTENTS = {
    "empty": (b"", "the file is empty"),
    "blank": (b"\n \n", "the file is empty"),
    "workbook": (b"PK\x03\x04....", "this is a ZIP archive, such as an Excel workbook"),
    "calibration": (
        b"\x10\x00\x00\x00\x00\x00\x00\x00{}",
        "binary data, not text. Export it as text, a table as CSV",
    ),
    "web page": (b"<!DOCTYPE html><html>", "an HTML page, not CSV"),
    "URDF": (b"<?xml version='1.0'?><robot/>", "XML, not CSV"),
    "JSON": (b'{"q1": 0}', "JSON, not CSV"),
    "UTF-16 without its mark": (
        "q1,x\n1,2\n".encode("utf-16-le"),
        "UTF-16 text, without a byte order mark. Save it as UTF-8, or .*csv --encoding utf-16-le.$",
    ),
    "UTF-16": (
        "q1,x".encode("utf-16"),
        "UTF-16 text. Save it as UTF-8, or .*import .*csv --encoding utf-16.$",
    ),
    "Latin-1": (
        b"q1,x,y,z,\xb0C\n1,2,3,4,5",
        "line 1 holds bytes that are not UTF-8. Save .* truearm import .*data.csv -o .* --encoding cp1252.$",
    ),
    "Latin-1 with semicolons": (
        b"q1 [\xb0];x;y;z\n0;1,5;2;3\n",
        'import .*data.csv -o measurements.csv --encoding cp1252 --delimiter ";" --decimal ",".$',
    ),
    "other bytes": (b"\xb0\xb1\xb2\n\xb3", "line 1 holds bytes that are not UTF-8. Save it as UTF-8.$"),
    "semicolons": (
        b"q1;x;y;z\n0;1,5;2;3\n",
        'by semicolons.*truearm import .* --delimiter ";"',
    ),
    "semicolons under a remark": (
        b"// AT960, 20 C, mm\nq1;x;y;z\n0;1,5;2;3\n",
        'by semicolons.*truearm import .* --delimiter ";" --decimal "," --comment "//".$',
    ),
    "tabs": (b"q1\tx\ty\tz\n0\t1\t2\t3\n", "separated by tabs.*--delimiter tab"),
    "open quote": (b'q1,x,y,z\n0,1,2,"3\n', "not CSV"),
}


@pytest.mark.parametrize("case", TABLES)
def test_bad_tables_are_explained(tmp_path: Path, case: str) -> None:
    header, rows, message = TABLES[case]
    path = tmp_path / "data.csv"
    path.write_text("\n".join([header, *rows]))
    with pytest.raises(InputError, match=message) as caught:
        Measurements.read_csv(path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize("case", CONTENTS)
def test_files_that_are_not_csv(tmp_path: Path, case: str) -> None:
    content, message = CONTENTS[case]
    path = tmp_path / "data.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        Measurements.read_csv(path)
    assert str(caught.value).startswith(str(path))


def test_missing_file_and_directory(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        Measurements.read_csv(tmp_path / "none.csv")
    with pytest.raises(InputError, match="a directory"):
        Measurements.read_csv(tmp_path)


def test_at_most_ten_rows_are_named(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("q1,x,y,z\n" + "0,nan,2,3\n" * 25)
    with pytest.raises(InputError, match=r"in rows 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 and 15 more\. "):
        Measurements.read_csv(path)


@pytest.mark.parametrize(
    ("header", "options", "message"),
    [
        ("q1,x_mm,y_mm,z_mm", {"length_unit": "m"}, 'column "x_mm" says mm, the options say m'),
        ("q1_deg,x,y,z", {"angle_unit": "rad"}, 'column "q1_deg" says deg, the options say rad'),
        ("q1,x,y,z", {"length_unit": "cm"}, '"cm" is no unit here. Known are "m" and "mm"'),
        ("q1,x,y,z", {"angle_unit": "grad"}, '"grad" is no unit here'),
        ("q1,x,y,z", {"joint_count": 6}, "there are 1 joint columns. The robot has 6 joints"),
        ("q1,x,y,z", {"joints": ("revolute",) * 6}, "The robot has 6 joints"),
    ],
)
def test_options_that_contradict_the_file(tmp_path: Path, header: str, options: Any, message: str) -> None:
    path = tmp_path / "data.csv"
    path.write_text(f"{header}\n0,1,2,3\n")
    with pytest.raises((InputError, UsageError), match=message):
        Measurements.read_csv(path, **options)


def test_a_long_note_takes_no_more_room_than_it_has(tmp_path: Path) -> None:
    path = tmp_path / "noted.csv"
    rows = [f"0,{k},2,3,{'x' * 5_000 if k == 7 else ''}" for k in range(2_000)]
    path.write_text("\n".join(["q1,x,y,z,note", *rows]))
    tracemalloc.start()
    try:
        data = Measurements.read_csv(path)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(data) == 2_000
    assert most < 10e6


def test_bad_data_frames() -> None:
    good = pd.DataFrame({"q1": [0.0, 1.0], "x": [1.0, 2.0], "y": [1.0, 2.0], "z": [1.0, 2.0]})
    with pytest.raises(InputError, match="there are no data rows"):
        Measurements.from_dataframe(good.iloc[:0])
    with pytest.raises(InputError, match='"x" holds NaN or infinite values in row 2'):
        Measurements.from_dataframe(good.assign(x=[1.0, np.inf]))
    with pytest.raises(InputError, match='"q1" is empty in row 1'):
        Measurements.from_dataframe(good.assign(q1=[np.nan, 1.0]))
    with pytest.raises(InputError, match="two columns have the same name"):
        Measurements.from_dataframe(pd.concat([good, good[["x"]]], axis=1))


@pytest.mark.parametrize(
    "gaps",
    [
        pd.to_datetime(pd.Series(["2026-01-01", None])),
        pd.to_timedelta(pd.Series([1.0, None]), unit="s"),
        pd.Series(pd.PeriodIndex(["2026-01", None], freq="M")),
        pd.Series(pd.Categorical(["a", None])),
    ],
    ids=lambda gaps: str(gaps.dtype),
)
def test_gaps_of_any_type_of_column_are_empty_cells(gaps: pd.Series) -> None:
    good = pd.DataFrame({"q1": [0.0, 1.0], "x": [1.0, 2.0], "y": [1.0, 2.0], "z": [1.0, 2.0]})
    data = Measurements.from_dataframe(good.assign(note=gaps))
    assert [notice.message for notice in data.notices] == ['data: left out, as not numeric: "note".']
    with pytest.raises(InputError, match='column "group" is empty in row 2'):
        Measurements.from_dataframe(good.assign(group=gaps))


def test_infinite_numbers_of_other_columns_do_not_hide_what_is_wrong() -> None:
    table = pd.DataFrame({"q1": ["n/a", "0"], "x": [1.0, 2.0], "y": 1.0, "z": 2.0, "load": [np.inf, 1.0]})
    with pytest.raises(InputError, match='column "q1" holds "n/a" in row 1'):
        Measurements.from_dataframe(table)
    named = table.assign(q1=0.0, group=table["load"], load=0.0)
    assert Measurements.from_dataframe(named).groups == ["inf", "1"]
