"""Other people's tables come in as they are said to be, and only then."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.import_support import COLUMNS, PLAIN, plan, write
from truearm.cli import main
from truearm.errors import InputError, UsageError
from truearm.importing import ImportPlan, import_table
from truearm.measurements import Measurements
from truearm.tables.raw_tables import Marks, read_raw
from truearm.tables.rotation_columns import RotationColumns

IPA_OPTIONS = [
    *("--delimiter", ";", "--decimal", ",", "--joint-unit", "rad", "--length-unit", "mm"),
    *("--map", "q1=shoulder_pan_joint", "--map", "q2=shoulder_lift_joint", "--map", "q3=elbow_joint"),
    *("--map", "q4=wrist_1_joint", "--map", "q5=wrist_2_joint", "--map", "q6=wrist_3_joint"),
    *("--map", "x=measurement_x", "--map", "y=measurement_y", "--map", "z=measurement_z"),
    *("--rotation", "euler:XYZ:deg=measurement_rx,measurement_ry,measurement_rz"),
    *("--keep", "temperature_C=measurement_temperature"),
    *("--keep", "goal_x=Goal x", "--keep", "goal_y=Goal y", "--keep", "goal_z=Goal z"),
    *("--keep", "std_x_m=measurement_std_x:mm", "--keep", "std_y_m=measurement_std_y:mm"),
    *("--keep", "std_z_m=measurement_std_z:mm"),
]


def test_the_public_series_equals_its_conversion(shared_data: Path, tmp_path: Path) -> None:
    raw = shared_data / "raw" / "ipa_series_B_measurements_joint_configurations.csv"
    output = tmp_path / "measurements.csv"
    assert main(["import", str(raw), "-o", str(output), *IPA_OPTIONS]) == 0
    ours, theirs = pd.read_csv(output), pd.read_csv(shared_data / "ur10_ipa_B.csv")
    assert list(ours.columns) == list(theirs.columns)
    for column in theirs:
        digits = 1e-10 if str(column).startswith("q") and not str(column)[1].isdigit() else 1e-12
        np.testing.assert_allclose(ours[column], theirs[column], rtol=0.0, atol=digits)


def test_units_and_columns(tmp_path: Path) -> None:
    table = import_table(write(tmp_path, PLAIN), plan()).frame
    assert list(table.columns) == ["q1", "q2", "x", "y", "z"]
    np.testing.assert_allclose(table["q1"], [np.pi / 2, -np.pi / 2])
    np.testing.assert_array_equal(table["y"], [2.0, 2.5])


def test_units_behind_columns_come_first(tmp_path: Path) -> None:
    path = write(tmp_path, PLAIN)
    table = import_table(path, plan(columns={**COLUMNS, "q2": "J2:mm"})).frame
    assert list(table.columns) == ["q1", "q2_m", "x", "y", "z"]
    np.testing.assert_array_equal(table["q2_m"], [0.045, 0.0])


def test_columns_with_our_names_need_no_mapping(tmp_path: Path) -> None:
    path = write(tmp_path, "q1_deg,x_mm,y_mm,z_mm,group,qw,qx,qy,qz\n90,1,2,3,a,1,0,0,0\n")
    table = import_table(path, ImportPlan()).frame
    assert list(table.columns) == ["q1", "x", "y", "z", "qw", "qx", "qy", "qz", "group"]
    np.testing.assert_allclose(table.loc[0, ["q1", "x"]].to_numpy(dtype=float), [np.pi / 2, 0.001])


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        (PLAIN.replace(",", ";"), {"delimiter": ";"}),
        (PLAIN.replace(",", "\t"), {"delimiter": "\t"}),
        (PLAIN.replace(",", ";").replace("1000", "1000,0"), {"delimiter": ";", "decimal": ","}),
        ("Station 1\nsome words, and more\n" + PLAIN, {"skip_lines": 2}),
        (PLAIN.replace("\n", "\r\n"), {}),
        ("\ufeff" + PLAIN, {}),
        (PLAIN.replace("1000", '"1000,0"').replace("2500", '"2500,5"'), {"decimal": ","}),
        ("// AT960; mm; deg\n" + PLAIN, {"comments": ("//",)}),
        (PLAIN.replace("\n", "\n# a remark, of two fields\n"), {"comments": ("#", "//")}),
        (PLAIN.replace(",", "   ").replace("\n", " \n  "), {"delimiter": " "}),
        (
            PLAIN.replace("1000", "39.37007874015748").replace("1500", "59.05511811023622"),
            {"columns": {**COLUMNS, "x": "px:in"}},
        ),
    ],
)
def test_marks_and_preambles(tmp_path: Path, text: str, changes: Any) -> None:
    table = import_table(write(tmp_path, text), plan(**changes)).frame
    np.testing.assert_array_equal(table["x"], [1.0, 1.5])


def test_other_encodings(tmp_path: Path) -> None:
    path = write(tmp_path, PLAIN.replace("J1", "J1 [°]"), "latin-1")
    columns = {**COLUMNS, "q1": "J1 [°]"}
    assert len(import_table(path, plan(columns=columns, encoding="latin-1")).frame) == 2
    with pytest.raises(InputError, match="line 1 holds bytes that are not UTF-8. .*--encoding cp1252"):
        import_table(path, plan(columns=columns))
    with pytest.raises(UsageError, match='"klingon" is no known encoding'):
        import_table(path, plan(columns=columns, encoding="klingon"))


def test_a_byte_order_mark_is_no_part_of_a_name(tmp_path: Path) -> None:
    for encoding in ("utf-16", "utf-16-le", "utf-16-be"):
        with pytest.raises(InputError, match=f"UTF-16 text.*State that: --encoding {encoding}.$"):
            read_raw(write(tmp_path, PLAIN, encoding), Marks())
    path = write(tmp_path, "\ufeff" + PLAIN, "utf-16-le")
    assert read_raw(path, Marks(encoding="utf-16-le")).names == ["J1", "J2", "px", "py", "pz"]


@pytest.mark.parametrize("first", [0, 1])
def test_a_column_without_a_name_that_counts_the_rows_is_left_out(first: int, tmp_path: Path) -> None:
    header, *rows = PLAIN.split()
    text = "\n".join([f",{header}", *(f"{first + k},{row}" for k, row in enumerate(rows))])
    path = write(tmp_path, text)
    imported = import_table(path, plan())
    assert imported.frame.equals(import_table(write(tmp_path, PLAIN), plan()).frame)
    assert imported.unused == []
    assert imported.remarks == [f"the first column of {path}, which has no name and counts the rows"]


def test_the_option_that_leaves_a_column_without_a_name_out_is_named_and_does(tmp_path: Path) -> None:
    header, *rows = PLAIN.split()
    path = write(tmp_path, "\n".join([f",{header}", *(f"{7 + k},{row}" for k, row in enumerate(rows))]))
    with pytest.raises(
        InputError, match='column 1 has no name.*--skip-lines 1 --columns "-,J1,J2,px,...[.]?"'
    ):
        import_table(path, plan())
    assert len(import_table(path, plan(skip_lines=1, names=("-", *header.split(",")))).frame) == 2


angles = st.floats(-3.0, 3.0)
rotations = st.tuples(angles, st.floats(-1.5, 1.5), angles)


@given(
    triple=rotations,
    sequence=st.sampled_from(["XYZ", "ZYX", "ZYZ", "xyz", "zyx"]),
    unit=st.sampled_from(["deg", "rad"]),
)
def test_euler_angles_are_turns_one_after_the_other(
    triple: tuple[float, float, float], sequence: str, unit: str
) -> None:
    """Capitals: each turn about the axes as turned so far. Small letters: about the fixed axes."""
    turns = [
        Rotation.from_rotvec(a * np.eye(3)["xyz".index(c)])
        for a, c in zip(triple, sequence.lower(), strict=True)
    ]
    expected = turns[0] * turns[1] * turns[2] if sequence.isupper() else turns[2] * turns[1] * turns[0]
    given_angles = np.degrees(triple) if unit == "deg" else np.array(triple)
    columns = RotationColumns.parse(f"euler:{sequence}:{unit}=a,b,c")
    ((w, x, y, z),) = columns.quaternions(given_angles[None])
    difference = Rotation.from_quat([x, y, z, w]).inv() * expected
    assert difference.magnitude() < 1e-12
    assert w >= 0.0


@given(triple=rotations)
def test_rotation_vectors_and_quaternions(triple: tuple[float, float, float]) -> None:
    expected = Rotation.from_rotvec(triple)
    ((w, x, y, z),) = RotationColumns.parse("vector:deg=a,b,c").quaternions(np.degrees(triple)[None])
    assert (Rotation.from_quat([x, y, z, w]).inv() * expected).magnitude() < 1e-12
    last = RotationColumns.parse("quaternion:xyzw=a,b,c,d").quaternions(np.array([[x, y, z, w]]))
    np.testing.assert_array_equal(last, [[w, x, y, z]])


def test_rotation_matrices_row_by_row(tmp_path: Path) -> None:
    turn = Rotation.from_euler("ZYX", [30.0, -20.0, 70.0], degrees=True)
    numbers = ",".join(f"{number:.4f}" for number in turn.as_matrix().reshape(-1))
    names = [f"r{i}{j}" for i in "123" for j in "123"]
    rotation = RotationColumns.parse(f"matrix={','.join(names)}")
    text = f"q1,x,y,z,{','.join(names)}\n0,1,2,3,{numbers}\n1,1,2,3{9 * ','}\n"
    given = ImportPlan(rotation=rotation, joint_unit="rad", length_unit="m")
    table = import_table(write(tmp_path, text), given).frame
    x, y, z, w = table.loc[0, ["qx", "qy", "qz", "qw"]]
    assert (Rotation.from_quat([x, y, z, w]).inv() * turn).magnitude() < 1e-4
    assert table["qw"].isna().tolist() == [False, True]
    mirrored = text.replace(numbers, numbers.replace("-", "", 1))
    with pytest.raises(InputError, match="the nine numbers of row 1 are no rotation matrix.*row by row"):
        import_table(write(tmp_path, mirrored), given)


def test_missing_orientations_stay_missing(tmp_path: Path) -> None:
    text = "q1,x,y,z,rx,ry,rz\n0,1,2,3,10,20,30\n1,1,2,3,,,\n"
    rotation = RotationColumns.parse("euler:ZYX:deg=rx,ry,rz")
    table = import_table(
        write(tmp_path, text), ImportPlan(rotation=rotation, joint_unit="rad", length_unit="m")
    ).frame
    assert table["qw"].isna().tolist() == [False, True]
    assert len(Measurements.from_dataframe(table)) == 2
    incomplete = write(tmp_path, text.replace("1,1,2,3,,,", "1,1,2,3,10,,30"))
    with pytest.raises(InputError, match='only some of "rx", "ry" and "rz" are given in row 2'):
        import_table(incomplete, ImportPlan(rotation=rotation, joint_unit="rad", length_unit="m"))


def test_what_is_left_out_is_told(tmp_path: Path) -> None:
    path = write(
        tmp_path, PLAIN.replace("J1", "note,J1").replace("\n90", "\na,90").replace("\n-90", "\nb,-90")
    )
    assert import_table(path, plan()).unused == ["note"]
    kept = import_table(path, plan(keep={"remark": "note"}))
    assert kept.frame["remark"].tolist() == ["a", "b"]
    assert kept.unused == []


NUMBERS = "90,45,0,1000,2000,3000\n-90,0,7,1500,2500,3500\n"
NAMES = ("J1", "J2", "-", "px", "py", "pz")


@pytest.mark.parametrize("delimiter", [None, ";", " "])
def test_a_table_without_a_header_is_given_names(tmp_path: Path, delimiter: str | None) -> None:
    text = NUMBERS.replace(",", delimiter or ",")
    found = import_table(write(tmp_path, text), plan(delimiter=delimiter, names=NAMES))
    named = import_table(write(tmp_path, PLAIN), plan())
    pd.testing.assert_frame_equal(found.frame, named.frame)
    assert found.unused == []


def test_rows_of_one_target_each(tmp_path: Path) -> None:
    text = "J1,J2,px,py,pz,nest\n90,45,1,2,3,3\n-90,0,4,5,6,1\n0,10,7,8,9,3\n"
    columns = {**COLUMNS, "target": "nest"}
    found = import_table(write(tmp_path, text), plan(columns=columns, length_unit="m"))
    assert list(found.frame) == ["q1", "q2", "x", "y", "z", "x2", "y2", "z2", "x3", "y3", "z3"]
    assert found.unused == []
    points = Measurements.from_dataframe(found.frame).targets
    assert np.argwhere(np.isfinite(points).all(axis=2)).tolist() == [[0, 2], [1, 0], [2, 2]]
    np.testing.assert_array_equal(points[[0, 1, 2], [2, 0, 2]], [[1, 2, 3], [4, 5, 6], [7, 8, 9]])


BAD: dict[str, tuple[str, dict[str, Any], str]] = {
    "semicolons": (PLAIN.replace(",", ";"), {}, 'separated by semicolons. If so, give --delimiter ";"'),
    "tabs": (PLAIN.replace(",", "\t"), {}, "separated by tabs. If so, give --delimiter tab"),
    "remark with semicolons": ("// AT960; mm; deg\n" + PLAIN, {}, 'is a remark: .* FILE --comment "//"'),
    "remark without marks": ("# of day 2\n" + PLAIN, {}, 'is a remark: "# of day 2".* FILE --comment "#"'),
    "words above semicolons": (
        "Hall 4, cell 2\n" + PLAIN.replace(",", ";"),
        {},
        "seem to be separated by semicolons",
    ),
    "one field": (PLAIN.replace(",", " "), {}, 'the first line is one field: "J1 J2 px py pz".*--delimiter'),
    "decimal comma": (
        PLAIN.replace(",", ";").replace("90;", "90,5;"),
        {"delimiter": ";"},
        '"90,5".*give --decimal ","',
    ),
    "both marks, uneven": (
        PLAIN.replace("1000", "1000,5"),
        {"decimal": ","},
        'row 1 has another number of fields.*Numbers that hold "," need quotes',
    ),
    "both marks": (PLAIN, {"delimiter": ",", "decimal": ","}, '"," is both delimiter and decimal mark'),
    "thousands": (
        PLAIN.replace(",", ";").replace("1000", "1.000"),
        {"delimiter": ";", "decimal": ","},
        '"px" holds "1.000" in row 1',
    ),
    "text": (
        PLAIN.replace("1500", "n/a"),
        {"decimal": "."},
        'column "px" holds "n/a" in row 2. It must hold numbers.*--missing TEXT',
    ),
    "another unit in brackets": (
        PLAIN.replace("J1", "J1 [deg]"),
        {"columns": COLUMNS | {"q1": "J1 [deg]"}, "joint_unit": "rad"},
        'column "J1 \\[deg\\]" says deg, --joint-unit says rad.*must agree.*'
        "--map 'q1=J1 \\[deg\\]:rad' if its name is wrong, 'q1=J1 \\[deg\\]:deg' if its name is right",
    ),
    "another unit in parentheses": (
        PLAIN.replace("px", "X (mm)"),
        {"columns": COLUMNS | {"x": "X (mm)"}, "length_unit": "m"},
        'column "X \\(mm\\)" says mm, --length-unit says m',
    ),
    "another unit at the end of a name": (
        PLAIN.replace("px", "px_m"),
        {"columns": COLUMNS | {"x": "px_m"}},
        'column "px_m" says m, --length-unit says mm',
    ),
    "a unit that cannot be stated": (
        PLAIN.replace("pz", "pz (ft)"),
        {"columns": COLUMNS | {"z": "pz (ft)"}},
        'column "pz \\(ft\\)" says ft, --length-unit says mm.*wrong, convert this column in the file if',
    ),
    "another unit of a rotation": (
        PLAIN.replace("px", "A (deg)"),
        {
            "columns": {"q1": "J1", "q2": "J2"},
            "rotation": RotationColumns.parse("euler:ZYX:rad=A (deg),py,pz"),
        },
        'column "A \\(deg\\)" says deg, --rotation says rad.*must agree',
    ),
    "no joint unit": (
        PLAIN,
        {"joint_unit": None},
        'unit of column "q1" is not stated. Give --joint-unit rad or deg',
    ),
    "no length unit": (
        PLAIN,
        {"length_unit": None},
        'unit of column "x" is not stated. Give --length-unit in or m or mm',
    ),
    "misspelt column": (
        PLAIN,
        {"columns": {**COLUMNS, "q1": "j1"}},
        'no column "j1". Did you mean "J1".*columns are J1, J2',
    ),
    "unknown column of ours": (
        PLAIN,
        {"columns": {**COLUMNS, "temperature": "J1"}},
        '"temperature" is no measurement column.*--keep',
    ),
    "unit in our name": (
        PLAIN,
        {"columns": {"q1_deg": "J1"}},
        '"q1_deg" is no measurement column. Units stand behind .* --map q1=COLUMN:deg',
    ),
    "keeping a joint": (PLAIN, {"keep": {"q3": "J1"}}, '"q3" is a measurement column. Give it with --map'),
    "skipping all": (PLAIN, {"skip_lines": 3}, "3 lines to skip, the file has 3"),
    "numbers only": (NUMBERS, {}, "first line holds numbers only.*truearm import FILE --columns q1,q2"),
    "too few names": (NUMBERS, {"names": ("J1", "J2")}, "--columns: 2 names, the first line .* has 6 fields"),
    "names and a header": (
        PLAIN,
        {"names": ("a", "b", "c", "d", "e")},
        'first line .* holds no number: "J1,J2,px,py,pz".*--skip-lines 1',
    ),
    "half a target": (
        PLAIN.replace("J1", "n,J1").replace("\n9", "\n1,9").replace("\n-", "\n1.5,-"),
        {"columns": {**COLUMNS, "target": "n"}},
        "the target of row 2 is 1.5. Targets are counted from 1.*leave the point of this row empty",
    ),
    "targets twice": (
        PLAIN.replace("J1", "n,x2,J1").replace("\n9", "\n1,0,9").replace("\n-", "\n1,0,-"),
        {"columns": {**COLUMNS, "target": "n"}},
        "columns of several points.*says of which target",
    ),
    "no names": (NUMBERS, {"names": ("-",) * 6}, "all columns are left out. Name those to bring in"),
    "a name too little": (NUMBERS, {"names": ("J1", "")}, 'a name is missing. "-" leaves a column out'),
    "page": ("<html></html>", {}, "an HTML page"),
    "empty": ("", {}, "the file is empty"),
    "NaN": (PLAIN.replace("1500", "nan"), {}, '"px" holds NaN or infinite values in row 2'),
    "angle as a length": (
        PLAIN,
        {"columns": {**COLUMNS, "x": "px:deg"}},
        'column "x" is said to be in deg: "px:deg". "x" has one of the units cm, um, in, m, mm. Write --map',
    ),
    "no unit": (
        PLAIN,
        {"columns": {**COLUMNS, "x": "px:ft"}},
        '"ft" behind "px" is no unit. Units are cm, um, in, m, mm, mrad',
    ),
    "several columns at once": (
        PLAIN,
        {"columns": {**COLUMNS, "x": "px:mm,y=py:mm"}},
        '"px:mm,y=py:mm" names several columns. One --map names one column. Repeat --map',
    ),
    "angle in a header": ("q1_deg,x_deg,y_mm,z_mm\n1,2,3,4\n", {"columns": {}}, '"x" is said to be in deg'),
    "unit of a word": (PLAIN, {"keep": {}, "columns": {**COLUMNS, "group": "J1:mm"}}, '"group" has no unit'),
    "points and commas": (
        PLAIN.replace(",", ";").replace("1000", "1,234.5"),
        {"delimiter": ";"},
        'holds "1,234.5". A number has one mark.*without marks between thousands',
    ),
    "a list in a cell": (
        PLAIN.replace(",", ";").replace("1000", "[1.2, -0.4]"),
        {"delimiter": ";"},
        r'"px" holds "\[1.2, -0.4\]". A cell holds one number, not a list. .* a column for each number.$',
    ),
    "a list of decimal commas": (
        PLAIN.replace(",", ";").replace("1000", "[1,2 -0,4]"),
        {"delimiter": ";", "decimal": ","},
        "A cell holds one number, not a list",
    ),
    "points with decimal commas": (
        PLAIN.replace(",", ";").replace("1000", "1,234.5"),
        {"delimiter": ";", "decimal": ","},
        "no points. Write the numbers without marks between thousands.$",
    ),
    "joint unit": (
        PLAIN,
        {"joint_unit": "grad"},
        '--joint-unit: "grad" is not known. Known are "rad" and "deg"',
    ),
    "decimal mark": (PLAIN, {"decimal": ";"}, '--decimal: ";" is not known'),
    "lines above the header": (
        "Hall 4; cell 2\n" + PLAIN.replace(",", ";"),
        {"delimiter": ";"},
        "another number of fields.*--skip-lines leaves out lines above the header",
    ),
    "no name of ours": (
        PLAIN.upper(),
        {"columns": {}},
        "none of its columns has a name of ours. They are J1, J2, PX, PY, PZ. .*--map q1=COLUMN:deg",
    ),
    "no position": (
        PLAIN,
        {"columns": {"q1": "J1"}},
        "No position x, y, z.*Its columns are J1, J2, px, py, pz. Say which is which: --map q1=COLUMN",
    ),
    "an incomplete point behind rows of none": (
        PLAIN + "1,2,,,\n3,4,,,\n5,6,7,,8\n",
        {},
        'only some of "x", "y" and "z" are given in row 5',
    ),
    "no joint behind a row of no point": (
        PLAIN + "1,2,,,\n3,,6,7,8\n",
        {},
        'column "q2" is empty in row 4',
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_wrong_plans_are_explained(tmp_path: Path, case: str) -> None:
    text, changes, message = BAD[case]
    path = write(tmp_path, text)
    with pytest.raises((InputError, UsageError), match=message):
        import_table(path, plan(**changes))


def test_cells_that_say_that_nothing_was_measured(tmp_path: Path) -> None:
    text = PLAIN.replace("J2", "J2,p2x,p2y,p2z").replace(",45", ",45,N/A,-,n/a").replace(",0,", ",0,1,2,3,")
    columns = {**COLUMNS, "x2": "p2x", "y2": "p2y", "z2": "p2z"}
    table = import_table(write(tmp_path, text), plan(columns=columns, missing=("n/a", "-"))).frame
    assert table["y2"].isna().tolist() == [True, False]
    assert table["z2"][1] == 0.003


def test_rows_in_which_nothing_was_measured_are_left_out(tmp_path: Path) -> None:
    text = PLAIN + "10,20,n/a,n/a,n/a\n"
    found = import_table(write(tmp_path, text), plan(missing=("n/a",)))
    assert len(found.frame) == 2
    assert [words.split(" of ")[0] for words in found.left_out] == ["row 3"]
    assert "nothing was measured" in found.left_out[0]


def test_blanks_within_quotes_stay(tmp_path: Path) -> None:
    text = 'J1 J2  px py pz "a  note"\n90 45   1000 2000 3000 "as  is"\n'
    kept = import_table(write(tmp_path, text), plan(delimiter=" ", keep={"note": "a  note"}))
    assert kept.frame["note"].tolist() == ["as  is"]


def test_a_mark_of_utf_8_is_believed(tmp_path: Path) -> None:
    path = write(tmp_path, "\ufeff" + PLAIN)
    with pytest.raises(UsageError, match="its first bytes say that it is UTF-8, not cp1252"):
        import_table(path, plan(encoding="cp1252"))


@pytest.mark.parametrize(
    "text",
    [
        "euler:XYZ=a,b,c",
        "euler:XYZ:grad=a,b,c",
        "euler:XYZ:deg=a,b",
        "vector=a,b,c",
        "quaternion:abcd=a,b,c,d",
        "",
    ],
)
def test_rotation_options_are_explained(text: str) -> None:
    with pytest.raises(UsageError, match="is no rotation. Write euler:XYZ:deg=RX,RY,RZ"):
        RotationColumns.parse(text)


@pytest.mark.parametrize("sequence", ["XyZ", "XXY", "XY", "ABC", "XYZX"])
def test_orders_of_euler_angles_are_explained(sequence: str) -> None:
    with pytest.raises(UsageError, match=f'"{sequence}" is no order of Euler angles. Three axes'):
        RotationColumns.parse(f"euler:{sequence}:deg=a,b,c")


@pytest.mark.parametrize(
    "rows", ["J1;J2;px;py;pz;\n90;45;1000;2000;3000;\n", "J1;J2;;px;py;pz\n90;45; ;1;2;3\n"]
)
def test_columns_with_neither_name_nor_content_are_left_out(rows: str, tmp_path: Path) -> None:
    imported = import_table(write(tmp_path, rows), plan(delimiter=";"))
    assert list(imported.frame.columns) == ["q1", "q2", "x", "y", "z"]
    assert imported.unused == []


@pytest.mark.parametrize("kind", ["euler:ZYX", "vector"])
def test_angles_longer_than_a_turn_are_refused(kind: str, tmp_path: Path) -> None:
    path = write(tmp_path, "J1,J2,px,py,pz,A,B,C\n1,2,3,4,5,10,20,170\n1,2,3,4,6,11,21,160\n")
    stated = {unit: RotationColumns.parse(f"{kind}:{unit}=A,B,C") for unit in ("deg", "rad")}
    assert len(import_table(path, plan(rotation=stated["deg"])).frame) == 2
    with pytest.raises(InputError, match="angles of 170 rad.*If these are degrees, say deg"):
        import_table(path, plan(rotation=stated["rad"]))


def test_lines_that_end_with_a_mark_that_the_header_has_not_are_told(tmp_path: Path) -> None:
    header, *rows = PLAIN.split()
    path = write(tmp_path, "\n".join(["made by a tracker", header, *(f"{row}," for row in rows)]))
    told = r'rows 1 and 2 have another number.*: --skip-lines 2 --columns "J1,J2,px,py,...,-"'
    with pytest.raises(InputError, match=told):
        import_table(path, plan(skip_lines=1))
    named = plan(skip_lines=2, names=(*header.split(","), "-"))
    assert len(import_table(path, named).frame) == 2


def test_a_name_may_have_a_line_break_within_quotes(tmp_path: Path) -> None:
    path = write(tmp_path, PLAIN.replace("J1", '"J1\nbase"'))
    found = import_table(path, plan(columns=COLUMNS | {"q1": "J1\nbase"})).frame
    assert found["x"].tolist() == [1.0, 1.5]
