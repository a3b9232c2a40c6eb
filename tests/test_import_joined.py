"""Joints in one file and positions in another come in together."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from tests.import_support import COLUMNS, PLAIN, plan, write
from truearm.cli import main
from truearm.errors import InputError, UsageError
from truearm.importing import ImportPlan, import_table
from truearm.simulation import VirtualArm
from truearm.tables.raw_tables import Marks


def test_the_command_names_columns_of_both_tables(tmp_path: Path) -> None:
    joints, points, output = (tmp_path / name for name in ("joints.txt", "points.txt", "m.csv"))
    joints.write_text("a;90;45\nb;-90;0\n")
    points.write_text("b 1500 2500 3500\na 1000 2000 3000\n")
    ours = ["import", str(joints), "--columns", "id,q1,q2", "--delimiter", ";", "--on", "id"]
    theirs = ["--with", str(points), "--with-columns", "id, x, y, z", "--with-delimiter", "space"]
    units = ["--joint-unit", "deg", "--length-unit", "mm"]
    assert main([*ours, *theirs, *units, "-o", str(output)]) == 0
    np.testing.assert_allclose(pd.read_csv(output)[["x", "y", "z"]], [[1.0, 2.0, 3.0], [1.5, 2.5, 3.5]])


JOINTS = "nr,J1,J2,T\n1,90,45,20\n2,-90,0,21\n3,10,20,22\n"
POINTS = "point,px,py,pz,T\n2.0,1500,2500,3500,30\n1.0,1000,2000,3000,31\n7.0,0,0,0,32\n"


STAMPS = "t,J1,J2\n20251123001500001,90,45\n20251123001500011,-90,0\n"


def pair(folder: Path, joints: str = JOINTS, points: str = POINTS) -> tuple[Path, Path]:
    paths = folder / "joints.csv", folder / "points.csv"
    for path, text in zip(paths, (joints, points), strict=True):
        path.write_text(text)
    return paths


@pytest.mark.parametrize("on", ["nr=point", None])
def test_rows_without_any_cell_take_no_part(tmp_path: Path, on: str | None) -> None:
    """Spreadsheets leave empty rows behind, and one between blocks: they belong to nothing."""
    rows = ["nr,J1,J2", "1,90,45", "2,-90,0", ",,", ",,"]
    if on:
        rows.insert(2, ",,")
    joints, points = pair(tmp_path, "\n".join(rows), "point,px,py,pz\n1,0,0,1\n2,0,0,2\n")
    found = import_table(joints, plan(second=points, on=on))
    assert found.frame["z"].tolist() == [0.001, 0.002]
    named = "rows 2, 4 and 5" if on else "rows 3 and 4"
    assert found.left_out == [f"{named} of {joints}, as nothing is in them"]


def test_rows_are_called_as_in_their_file_beside_empty_ones(tmp_path: Path) -> None:
    joints, points = pair(tmp_path, "nr,J1,J2\n,,\n1,90,45\n1,0,0\n", POINTS)
    with pytest.raises(InputError, match='says "1" in row 2 and "1" in row 3'):
        import_table(joints, plan(second=points, on="nr=point"))


def test_an_empty_row_is_no_gap_where_rows_go_one_by_one(tmp_path: Path) -> None:
    """A point that was not measured stands in its place."""
    points = "point,px,py,pz\n2.0,1500,2500,3500\n,,,\n7.0,0,0,1\n"
    joints, points_file = pair(tmp_path, JOINTS, points)
    found = import_table(joints, plan(second=points_file))
    assert found.frame["z"].tolist() == [3.5, 0.001]


def test_two_tables_are_joined_by_what_both_say(tmp_path: Path) -> None:
    joints, points = pair(tmp_path)
    kept = {"before": "T", "after": "T of points.csv"}
    found = import_table(joints, plan(second=points, on="nr=point", keep=kept))
    pd.testing.assert_frame_equal(
        found.frame,
        pd.DataFrame(
            {
                "q1": [np.pi / 2, -np.pi / 2], "q2": [np.pi / 4, 0.0], "x": [1.0, 1.5], "y": [2.0, 2.5],
                "z": [3.0, 3.5], "before": [20.0, 21.0], "after": [31.0, 30.0],
            }
        ),
    )  # fmt: skip
    assert found.unused == []
    assert found.left_out == [
        f'1 row of {joints} (nr "3"), as they are not in the other table',
        f'1 row of {points} (point "7.0"), as they are not in the other table',
    ]


def test_keys_are_what_they_say_and_no_numbers(tmp_path: Path) -> None:
    """Point 10 of station 1 is not point 1, whatever 1.10 is as a number; 007 is 7."""
    joints = "id,J1,J2\n1.1,10,1\n1.2,20,2\n007,30,3\n"
    points = "id,px,py,pz\n1.10,0,0,0\n1.2,2,2,2\n7,3,3,3\n"
    found = import_table(pair(tmp_path, joints, points)[0], plan(second=tmp_path / "points.csv", on="id"))
    assert found.frame["x"].tolist() == [0.002, 0.003]


def test_each_table_has_its_own_marks(tmp_path: Path) -> None:
    points = "Station 1\n" + POINTS.replace(".0,", "|").replace(",", ";").replace("|", ";").replace(
        "1500;", "1500,5;"
    )
    joints, second = pair(tmp_path, points=points)
    marks = Marks(delimiter=";", decimal=",", skip_lines=1)
    found = import_table(joints, plan(second=second, second_marks=marks, on="nr=point"))
    assert found.frame["x"].tolist() == [1.0, 1.5005]


def test_columns_that_both_have_are_not_guessed(tmp_path: Path) -> None:
    joints, points = pair(tmp_path, "q1_deg,q2_deg,x_mm,y_mm,z_mm\n1,2,3,4,5\n", "x_mm,y_mm,z_mm\n6,7,8\n")
    both = ImportPlan(second=points)
    either = '--map "x=x_mm:mm" or --map "x=x_mm of points.csv:mm"'
    with pytest.raises(UsageError, match=f'are all "x". Say which is meant: {either}'):
        import_table(joints, both)
    mapped = {axis: f"{axis}_mm of points.csv:mm" for axis in "xyz"}
    assert import_table(joints, ImportPlan(columns=mapped, second=points)).frame["y"].tolist() == [0.007]
    with pytest.raises(UsageError, match='column "px" is taken for two of ours'):
        import_table(write(tmp_path, PLAIN), plan(columns={**COLUMNS, "y": "px"}))


def test_a_column_with_a_unit_and_one_without_are_not_guessed(tmp_path: Path) -> None:
    joints, points = pair(tmp_path, "q1_deg,q2_deg,x_mm,y_mm,z_mm\n1,2,3,4,5\n", "x,y,z\n6,7,8\n")
    with pytest.raises(UsageError, match='"x_mm:mm" and "x" are all "x"'):
        import_table(joints, ImportPlan(second=points, length_unit="mm"))


def test_what_is_kept_of_the_keys_is_text(tmp_path: Path) -> None:
    joints = JOINTS.replace("\n1,", "\n1.1,").replace("\n2,", "\n1.10,")
    points = POINTS.replace("1.0,", "1.1,").replace("2.0,", "1.10,")
    found = import_table(
        pair(tmp_path, joints, points)[0],
        plan(second=tmp_path / "points.csv", on="nr=point", keep={"nr": "nr"}),
    )
    assert found.frame["nr"].tolist() == ["1.1", "1.10"]


def test_columns_that_tell_no_rows_apart_may_differ(tmp_path: Path) -> None:
    joints = "side,J1,J2\nleft,90,45\nleft,-90,0\nright,10,20\n"
    points = "side,px,py,pz\nright,1,1,1\nleft,2,2,2\nleft,3,3,3\n"
    found = import_table(pair(tmp_path, joints, points)[0], plan(second=tmp_path / "points.csv"))
    assert found.frame["x"].tolist() == [0.001, 0.002, 0.003]


def test_a_user_says_how_each_table_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    joints = tmp_path / "joints.csv"
    joints.write_text("# made by hand\n" + JOINTS)
    points = tmp_path / "points.txt"
    points.write_bytes(
        "Prüfling\npoint;px;py;pz\n1;1000,5;2000;3000\n# lost\n2;1500;2500;3500\n".encode("cp1252")
    )
    mapped = [word for ours, theirs in COLUMNS.items() for word in ("--map", f"{ours}={theirs}")]
    options = [*mapped, "--joint-unit", "deg", "--length-unit", "mm", "--comment", "#", "--json"]
    command = ["import", str(joints), "-o", str(tmp_path / "m.csv"), "--on", "nr=point", *options]
    other = [
        "--with-delimiter",
        ";",
        "--with-decimal",
        ",",
        "--with-skip-lines",
        "1",
        "--with-encoding",
        "cp1252",
    ]
    assert main([*command, "--with", str(points), *other]) == 0
    told = json.loads(capsys.readouterr().out)
    assert pd.read_csv(tmp_path / "m.csv")["x"].tolist() == [1.0005, 1.5]
    assert told["rows_left_out"] == [f'1 row of {joints} (nr "3"), as they are not in the other table']
    assert told["remarks"] == [f"1 line of {path}, as remarks" for path in (joints, points)]
    for wrong, words in (
        ([*other], "--with-...: there is one table only"),
        (["--with", str(points), "--with", str(joints)], "--with: more than two tables"),
        (["--with", str(points), *other[2:]], "If so, give --with-delimiter"),
        (["--with", str(points), "--with-delimiter", "ab"], "--with-delimiter: "),
        (["--with", str(points), "--with-decimal", ";"], "--with-decimal: "),
        (["--with", str(points), "--comment", ""], "--comment: "),
    ):
        assert main([*command, *wrong]) == 2
        assert words in " ".join(capsys.readouterr().err.split())


def test_two_tables_are_joined_row_by_row(tmp_path: Path) -> None:
    joints, points = pair(tmp_path)
    found = import_table(joints, plan(second=points))
    assert found.frame["x"].tolist() == [1.5, 1.0, 0.0]
    assert found.unused == ["nr", "T", "point", "T of points.csv"]


@pytest.mark.parametrize(
    ("joints", "points", "on", "message"),
    [
        (JOINTS, POINTS + "8,1,1,1,1\n", None, "3 rows, and 4 in .*points.csv. .*--on COLUMN"),
        (JOINTS, POINTS, "nr", 'points.csv: there is no column "nr"'),
        (JOINTS, POINTS, "Nr=point", 'joints.csv: there is no column "Nr". Did you mean "nr"'),
        (
            JOINTS,
            POINTS.replace("7.0", "2"),
            "nr=point",
            'column "point" says "2.0" in row 1 and "2" in row 3',
        ),
        (JOINTS.replace("nr", "point"), POINTS, None, '"point" says "1" in row 1, and "2" in .*--on point'),
        (
            JOINTS.replace("nr", "point"),
            POINTS.replace("2.0", "1").replace("\n1.0", "\n2").replace("7.0", "2"),
            None,
            '"point" says "3" in row 3, and "2" in .*where neither says a thing twice: --on point',
        ),
        (
            STAMPS,
            STAMPS.replace("J", "p").replace("001,", "002,").replace("011,", "012,"),
            "t",
            'no value of "t" is in "t"',
        ),
        (JOINTS.replace("\n3", "\n"), POINTS, "nr=point", 'column "nr" is empty in row 3'),
        (JOINTS, POINTS, "T", 'no value of "T" is in "T" of .*begins with "20", the other with "30"'),
    ],
)
def test_tables_that_cannot_be_joined_are_explained(
    tmp_path: Path, joints: str, points: str, on: str | None, message: str
) -> None:
    first, second = pair(tmp_path, joints, points)
    with pytest.raises((InputError, UsageError), match=message):
        import_table(first, plan(second=second, on=on))


def test_a_column_to_join_by_asks_for_a_second_table(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--on: there is one table only. Name the other: --with FILE"):
        import_table(write(tmp_path, PLAIN), plan(on="nr"))


def test_a_target_that_was_never_measured_takes_no_part(tmp_path: Path) -> None:
    """Reflectors numbered 2 and 3, one a row."""
    arm = VirtualArm.paper(seed=2)
    data = arm.measure(arm.poses(60))
    frame = pd.DataFrame(data.readings, columns=[f"q{k + 1}" for k in range(5)])
    frame[["x", "y", "z"]] = data.targets[:, 0]
    frame["nest"] = 2 + np.arange(60) % 2
    frame.to_csv(tmp_path / "raw.csv", index=False)
    stated = ImportPlan(columns={"target": "nest"}, joint_unit="rad", length_unit="m")
    found = import_table(tmp_path / "raw.csv", stated)
    points = ta.Measurements.from_dataframe(found.frame, joints=arm.robot.joints)
    calibration = ta.calibrate(arm.robot, points, model="constant")
    assert calibration.validation.n_holdout == 18
    alone = ta.calibrate(arm.robot, data, model="constant")
    both = [each.validation.holdout["constant"].position.mean for each in (calibration, alone)]
    assert both[0] < 1.2 * both[1]


def test_a_user_joins_two_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    joints, points = pair(tmp_path)
    output = tmp_path / "m.csv"
    mapped = [word for ours, theirs in COLUMNS.items() for word in ("--map", f"{ours}={theirs}")]
    options = [*mapped, "--joint-unit", "deg", "--length-unit", "mm"]
    command = ["import", str(joints), "--with", str(points), "--on", "nr=point", *options, "-o"]
    assert main([*command, str(output)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert '(nr "3"), as they are not in the other table.' in said
    assert len(pd.read_csv(output)) == 2
    assert main([*command, str(points)]) == 2
    assert points.read_text() == POINTS


def test_errors_name_the_row_of_the_file(tmp_path: Path) -> None:
    joints, points = pair(tmp_path, points=POINTS.replace("2000", "two"))
    with pytest.raises(InputError, match=r'points.csv: column "py" holds "two" in row 2'):
        import_table(joints, plan(second=points, on="nr=point"))
