"""Rows of one table stay one set-up, and tables of one name do not become one."""

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from tests.calibration_file_support import read_calibration_file
from truearm.doubts.plausibility import check_against
from truearm.simulation import VirtualArm
from truearm.tables.same_tables import called_as_files

ROWS = 40


@pytest.fixture(scope="module")
def arm() -> VirtualArm:
    return VirtualArm(ta.Robot.load("ur10"), seed=4)


@pytest.fixture(scope="module")
def table(arm: VirtualArm) -> pd.DataFrame:
    return arm.measure_table(arm.poses(ROWS))


def read(table: pd.DataFrame, name: str = "data") -> ta.Measurements:
    return ta.Measurements.from_dataframe(table, name=name)


def shifted(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(x=table["x"] + 1.0)


def test_other_rows_of_another_table_are_a_set_up_of_their_own(table: pd.DataFrame) -> None:
    one, other = read(table), read(shifted(table))
    halves = [one.select(np.arange(ROWS // 2)), other.select(np.arange(ROWS // 2, ROWS))]
    both = ta.Measurements.of(halves)
    assert both.groups == ["data", "data 2"]
    again = [other.select(np.arange(5)), both]
    assert ta.Measurements.of(again).group.tolist() == ["data"] * 5 + ["data 2"] * 20 + ["data"] * 20


def test_columns_that_were_added_on_the_way_do_not_tell_tables_apart(table: pd.DataFrame) -> None:
    pairs = shifted(table).drop(columns=["x", "y", "z"]).assign(distance=1.0, pair=np.arange(ROWS) // 2)
    for plain in (shifted(table), pairs.astype({"pair": str})):
        warm, other = read(table.assign(temperature=20.0), "a"), read(plain, "b")
        both = ta.Measurements.concatenate([warm, other])
        for more in (other, other.select(np.arange(10))):
            later = both.select(np.arange(ROWS, 2 * ROWS))
            assert ta.Measurements.concatenate([later, more]).groups == ["b"]


def test_a_table_that_has_grown_is_the_same_one(table: pd.DataFrame) -> None:
    parts = [read(table.iloc[:10]), read(table)]
    assert ta.Measurements.of(parts).groups == ["data"]


def test_rows_of_a_loaded_calibration_are_told_from_another_table(arm, table, tmp_path) -> None:
    data = read(table.assign(temperature=np.arange(float(ROWS))))
    found = ta.calibrate(arm.robot, data, model="constant")
    found.save(tmp_path / "arm.calib")
    loaded = ta.Calibration.load(tmp_path / "arm.calib")
    assert loaded.rows is not None
    assert ta.Measurements.of([loaded.rows.data, read(shifted(table))]).groups == ["data", "data 2"]
    assert ta.Measurements.of([loaded.rows.data, data]).groups == ["data"]


def test_what_names_do_not_tell_is_kept_with_the_rows(arm, table, tmp_path) -> None:
    path = tmp_path / "arm.calib"
    for data, kept in ((read(table), False), (read(table.assign(group="data")), True)):
        found = ta.calibrate(arm.robot, data, model="constant")
        found.save(path)
        rows = ta.Calibration.load(path).rows
        assert rows is not None
        others = ta.Measurements.of([rows.data, read(shifted(table))])
        assert others.groups == (["data"] if kept else ["data", "data 2"])
        assert ("default_group" in read_calibration_file(path)[1]["rows"]["words"]) == kept


def test_set_ups_with_the_name_of_their_file() -> None:
    groups = np.array(["one", "two.csv", "x/two.csv", "lab"])
    sources = np.array(["x/one.csv", "x/two.csv", "x/two.csv", "data"])
    assert called_as_files(groups, sources).tolist() == ["one", "", "x/two.csv", ""]


def test_tables_of_one_name_are_told_apart_where_a_column_names_the_set_ups(table: pd.DataFrame) -> None:
    one, other = table.assign(group="a", sigma=3e-5), shifted(table).assign(group="b", sigma=3e-4)
    both = ta.Measurements.of([read(one), read(other)])
    assert both.groups == ["a", "b"]
    assert both.files == ["data", "data 2"]
    assert both.default_group is None
    named = read(one)
    halves = [named.select(np.arange(20, ROWS)), named.select(np.arange(30))]
    assert ta.Measurements.of(halves).files == ["data"]
    assert ta.Measurements.of([named[:20], named[20:], read(other, "b")]).files == ["data", "b"]
    assert ta.Measurements.of([read(shifted(table)), named]).files == ["data", "data 2"]


def test_a_file_is_not_read_under_two_of_its_paths(table: pd.DataFrame, tmp_path) -> None:
    path = tmp_path / "m.csv"
    table.to_csv(path, index=False)
    (tmp_path / "there").mkdir()
    with pytest.raises(ta.UsageError, match="the file is named twice"):
        ta.Measurements.read_files([path, tmp_path / "there" / ".." / "m.csv"])


def test_rows_that_are_there_under_two_names_are_told(arm: VirtualArm, table: pd.DataFrame) -> None:
    extra = read(table.iloc[:30], "m copy")
    copied = ta.Measurements.of([read(table, "m"), extra])
    notice = next(each for each in check_against(copied, arm.robot) if each.kind == "copied_rows")
    assert notice.rows == tuple(range(1, 31))
    assert '"m copy"' in notice.message
    named = [read(table.assign(group=name), name) for name in ("m", "n")]
    for parts in (named, [read(table, "m"), read(shifted(table), "n")]):
        notices = check_against(ta.Measurements.of(parts), arm.robot)
        assert "copied_rows" not in {each.kind for each in notices}
