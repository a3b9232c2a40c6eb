"""Measurements: what is in the file is what is fitted, in SI."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from truearm.errors import InputError, UsageError
from truearm.files import write_whole
from truearm.measurements import Measurements

HEADER = "q1,q2,x,y,z"
ROWS = ["0.1,0.2,1,2,3", "0.3,-0.4,1.5,2.5,3.5", "0.5,0.6,2,3,4"]


def write(
    folder: Path, header: str = HEADER, rows: list[str] | None = None, name: str = "tracker.csv"
) -> Path:
    path = folder / name
    path.write_text("\n".join([header, *(ROWS if rows is None else rows)]) + "\n")
    return path


def read(folder: Path, header: str = HEADER, rows: list[str] | None = None, **options: Any) -> Measurements:
    return Measurements.read_csv(write(folder, header, rows), **options)


def frame(count: int = 6, joints: int = 3, seed: int = 0) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    names = [f"q{k + 1}" for k in range(joints)] + ["x", "y", "z"]
    return pd.DataFrame(rng.uniform(-1, 1, (count, len(names))), columns=names)


def test_plain_file(tmp_path: Path) -> None:
    data = read(tmp_path)
    np.testing.assert_array_equal(data.readings, [[0.1, 0.2], [0.3, -0.4], [0.5, 0.6]])
    np.testing.assert_array_equal(data.targets[:, 0], [[1, 2, 3], [1.5, 2.5, 3.5], [2, 3, 4]])
    assert data.orientations is None
    assert data.sigma_m is None
    assert data.group.tolist() == ["tracker"] * 3
    assert data.rows.tolist() == [1, 2, 3]
    assert data.files == [str(tmp_path / "tracker.csv")]
    assert (len(data), data.joint_count, data.target_count) == (3, 2, 1)


def test_units_in_column_names(tmp_path: Path) -> None:
    data = read(
        tmp_path, "q1_deg,q2_mm,x_mm,y_mm,z_mm,sigma_mm", ["90,200,1.1,2,3,0.01", "45,100,4,5,6,0.02"]
    )
    np.testing.assert_allclose(data.readings, [[np.pi / 2, 0.2], [np.pi / 4, 0.1]], rtol=1e-15)
    np.testing.assert_array_equal(data.targets[:, 0], [[0.0011, 0.002, 0.003], [0.004, 0.005, 0.006]])
    assert data.sigma_m is not None
    np.testing.assert_array_equal(data.sigma_m, [1e-5, 2e-5])
    assert data.joint_units == ("deg", "mm")


def test_sigmas_along_axes_and_of_orientations(tmp_path: Path) -> None:
    header = "q1,x_mm,y_mm,z_mm,qw,qx,qy,qz,sigma_x_mm,sigma_z_mm,sigma_y_mm,sigma_mrad"
    data = read(tmp_path, header, ["0,1,2,3,1,0,0,0,0.3,1.2,0.4,0.1", "1,1,2,3,1,0,0,0,0.1,0.1,0.1,0.2"])
    assert data.sigma_m is not None
    assert data.sigma_axes_m is not None
    assert data.sigma_rad is not None
    np.testing.assert_allclose(data.sigma_axes_m, [[3e-4, 4e-4, 12e-4], [1e-4] * 3], rtol=1e-15)
    np.testing.assert_allclose(data.sigma_m, [13e-4 / np.sqrt(3.0), 1e-4], rtol=1e-15)
    np.testing.assert_allclose(data.sigma_rad, [1e-4, 2e-4], rtol=1e-15)
    assert list(data.features) == []
    plain = Measurements.from_dataframe(frame(2, joints=1).assign(sigma_mm=0.1), name="plain")
    both = Measurements.concatenate([plain, data])
    assert both.sigma_axes_m is not None
    np.testing.assert_array_equal(both.sigma_axes_m[[0, 3]], [[np.nan] * 3, [1e-4] * 3])
    assert both.sigma_rad is not None
    np.testing.assert_array_equal(both.sigma_rad[[0, 3]], [np.nan, 2e-4])


def test_hashes_of_rows_that_state_neither_are_as_they_were() -> None:
    columns = {"q1": [0.1, 0.2], "x": [1.0, 2.0], "y": [1.5, 2.5], "z": [0.5, 0.25], "sigma_mm": [0.1, 0.2]}
    found = Measurements.from_dataframe(pd.DataFrame(columns), name="a").hash()
    assert found == "1970d11cc7d04bb9c7ceca6b810b47027be0ee827ae57ec7eec68b442efdaf10"


def test_units_by_option(tmp_path: Path) -> None:
    data = read(
        tmp_path,
        "q1,q2,x,y,z",
        ["90,200,1,2,3"],
        length_unit="mm",
        angle_unit="deg",
        joints=("revolute", "prismatic"),
    )
    np.testing.assert_allclose(data.readings, [[np.pi / 2, 0.2]])
    np.testing.assert_array_equal(data.targets[0, 0], [0.001, 0.002, 0.003])
    assert data.joint_units == ("deg", "mm")


@pytest.mark.parametrize(
    ("name", "value", "unit"), [("q2", 0.2, ""), ("q2_m", 0.2, "m"), ("q2_mm", 200.0, "mm")]
)
def test_a_prismatic_joint_has_a_unit_of_its_own(tmp_path: Path, name: str, value: float, unit: str) -> None:
    kinds, header = ("revolute", "prismatic", "revolute"), f"q1_deg,q3_deg,x,y,z,{name}"
    data = read(tmp_path, header, [f"90,45,1,2,3,{value}"], joints=kinds)
    frame = pd.DataFrame([[90.0, 45.0, 1.0, 2.0, 3.0, value]], columns=header.split(","))
    for found in (data, Measurements.from_dataframe(frame, joints=kinds)):
        np.testing.assert_allclose(found.readings, [[np.pi / 2, 0.2, np.pi / 4]])
        assert found.joint_units == ("deg", unit, "deg")
    with pytest.raises(InputError, match='column "q1_deg" is in deg, "q3" in SI'):
        read(tmp_path, f"q1_deg,q3,x,y,z,{name}", [f"90,0.7,1,2,3,{value}"], joints=kinds)
    with pytest.raises(InputError, match="The robot has 2 joints"):
        Measurements.from_dataframe(frame, joints=kinds[:2])


def test_options_say_the_units_of_the_columns_that_name_none(tmp_path: Path) -> None:
    kinds, rows = ("revolute", "revolute", "prismatic"), ["90,45,200,1,2,3"]
    units = {"angle_unit": "deg", "length_unit": "mm", "joints": kinds}
    data = read(tmp_path, "q1_deg,q2,q3,x_mm,y_mm,z_mm", rows, **units)
    np.testing.assert_allclose(data.readings, [[np.pi / 2, np.pi / 4, 0.2]])
    assert data.joint_units == ("deg", "deg", "mm")


def test_several_targets_and_missing_ones(tmp_path: Path) -> None:
    data = read(tmp_path, "q1,x,y,z,x2,y2,z2", ["0,1,2,3,4,5,6", "1,,,,7,8,9", "2,1,1,1,,,"])
    assert data.target_count == 2
    np.testing.assert_array_equal(np.isnan(data.targets).all(axis=2), [[0, 0], [1, 0], [0, 1]])


def test_quaternions_are_normalised_and_may_be_missing(tmp_path: Path) -> None:
    data = read(tmp_path, "q1,x,y,z,qw,qx,qy,qz", ["0,1,2,3,1.0004,0,0,0", "1,1,2,3,,,,"])
    assert data.orientations is not None
    np.testing.assert_array_equal(data.orientations[0], [1, 0, 0, 0])
    assert np.isnan(data.orientations[1]).all()


def test_groups_and_features(tmp_path: Path) -> None:
    header = "q1,x,y,z,group,temperature_C,q1_read,operator"
    data = read(tmp_path, header, ["0,1,2,3, a ,21.5,0.01,Ann", "1,1,2,3,b,,1.01,Bo"])
    assert data.group.tolist() == ["a", "b"]
    assert data.groups == ["a", "b"]
    assert list(data.features.columns) == ["temperature_C", "q1_read"]
    np.testing.assert_array_equal(data.features["temperature_C"], [21.5, np.nan])
    assert [notice.kind for notice in data.notices] == ["text_columns"]
    assert '"operator"' in data.notices[0].message


def test_names_in_other_letters_are_noticed(tmp_path: Path) -> None:
    data = read(tmp_path, "q1,x,y,z,Distance mm,QW", ["0,1,2,3,4,5", "1,1,2,3,4,5"])
    assert [notice.kind for notice in data.notices] == ["column_names"]
    assert '"Distance mm" and "QW"' in data.notices[0].message


def test_a_first_column_that_counts_the_rows_is_left_out_and_named(tmp_path: Path) -> None:
    data = read(tmp_path, ",q1,x,y,z", ["0,0,1,2,3", "1,1,1,2,3"])
    assert list(data.features.columns) == []
    assert [notice.kind for notice in data.notices] == ["row_numbers"]
    assert "which has no name and counts the rows" in data.notices[0].message


def test_a_target_that_repeats_another_is_told(tmp_path: Path) -> None:
    header, rows = "q1,x_mm,y_mm,z_mm,x2_mm,y2_mm,z2_mm", ["0,126.655,2,3,126.655,2,3"]
    data = read(tmp_path, header, [*rows, "1,4,5,6.1,4,5,6.1"])
    assert [notice.kind for notice in data.notices] == ["repeated_target"]
    assert '"x2_mm", "y2_mm" and "z2_mm" hold the same as' in data.notices[0].message
    assert not read(tmp_path, header, [*rows, "1,4,5,6.1,4,5,6.2"]).notices


def test_text_in_other_letters_is_not_said_to_be_kept(tmp_path: Path) -> None:
    data = read(tmp_path, "q1,x,y,z,Group,operator", ["0,1,2,3,A,Ann", "1,1,2,3,B,Bo"])
    (notice,) = data.notices
    assert notice.message.endswith(
        'as not numeric: "Group" and "operator"; what means something is written in small letters: "group".'
    )


def test_distances_to_anchors_and_within_pairs(tmp_path: Path) -> None:
    header = "q1,distance_mm,anchor,pair"
    data = read(tmp_path, header, ["0,500,bar,", "1,300,,p", "2,300,,p"])
    assert data.target_count == 0
    assert data.distance_m is not None
    np.testing.assert_array_equal(data.distance_m, [0.5, 0.3, 0.3])
    assert data.anchor is not None
    assert data.anchor.tolist() == ["bar", "", ""]
    assert data.pair is not None
    assert data.pair.tolist() == ["", "p", "p"]


def test_data_frames_read_like_files(tmp_path: Path) -> None:
    table = frame()
    table["group"] = [1, 1, 2, 2, 2, 2]
    table["note"] = "text"
    path = tmp_path / "data.csv"
    table.to_csv(path, index=False)
    from_frame, from_file = Measurements.from_dataframe(table), Measurements.read_csv(path)
    assert from_frame.group.tolist() == ["1", "1", "2", "2", "2", "2"]
    assert from_frame.hash() == from_file.hash()


def test_row_selection() -> None:
    table = frame(8)
    table["temperature_C"] = np.arange(8.0)
    data = Measurements.from_dataframe(table)
    by_mask, by_index = data.select(np.arange(8) % 2 == 0), data.select([0, 2, 4, 6])
    assert by_mask.hash() == by_index.hash()
    assert by_mask.rows.tolist() == [1, 3, 5, 7]
    assert by_mask.features.index.tolist() == [0, 1, 2, 3]
    assert by_mask.features["temperature_C"].tolist() == [0, 2, 4, 6]
    assert len(data.select(np.zeros(8, dtype=bool))) == len(data.select([])) == 0
    assert data.select([-1, 0]).rows.tolist() == [8, 1]
    assert data.select(slice(0, 4)).rows.tolist() == data[:4].rows.tolist() == [1, 2, 3, 4]
    assert data[::-3].rows.tolist() == [8, 5, 2]


@pytest.mark.parametrize(
    ("index", "words"),
    [
        ([0, 8], "there is no row 8. Rows are counted from 0 to 7"),
        ([-9], "there is no row -9"),
        ([True, False], r"bool of shape \(2,\) says no rows. Rows are said by a boolean mask of 8"),
        ([0.0, 1.0], "float64 of shape"),
        (slice("a"), "says no rows: slice indices must be integers"),
        (3, r"int64 of shape \(\)"),
    ],
)
def test_rows_that_cannot_be_selected_are_named(index, words):
    data = Measurements.from_dataframe(frame(8))
    with pytest.raises(InputError, match=words):
        data.select(index)


def test_putting_parts_together(tmp_path: Path) -> None:
    one = read(tmp_path, "q1,x,y,z,distance,pair", ["0,1,2,3,0.5,p", "1,1,2,3,0.5,p"])
    header = "q1,x,y,z,x2,y2,z2,qw,qx,qy,qz,sigma_mm,temperature_C,distance,pair"
    path = write(
        tmp_path,
        header,
        ["0,1,2,3,4,5,6,1,0,0,0,0.1,20,0.6,p", "1,1,2,3,4,5,6,1,0,0,0,0.1,20,0.6,p"],
        "other.csv",
    )
    both = Measurements.concatenate([one, Measurements.read_csv(path)])
    assert both.groups == ["tracker", "other"]
    assert both.targets.shape == (4, 2, 3)
    assert np.isnan(both.targets[:2, 1]).all()
    assert both.orientations is not None
    assert np.isnan(both.orientations[:2]).all()
    assert both.sigma_m is not None
    np.testing.assert_array_equal(both.sigma_m, [np.nan, np.nan, 1e-4, 1e-4])
    np.testing.assert_array_equal(both.features["temperature_C"], [np.nan, np.nan, 20, 20])
    assert both.pair is not None
    assert len(set(both.pair.tolist())) == 2
    assert both.rows.tolist() == [1, 2, 1, 2]
    assert both.row_names(np.array([True, False, True, True])) == (
        f"row 1 of {tmp_path / 'tracker.csv'}; rows 1 and 2 of {path}"
    )


def test_files_of_one_name_are_groups_of_their_own(tmp_path: Path) -> None:
    for folder in ("monday", "tuesday"):
        (tmp_path / folder).mkdir()
        write(tmp_path / folder)
    other = write(tmp_path, name="other.csv")
    same = [tmp_path / folder / "tracker.csv" for folder in ("monday", "tuesday")]
    data = Measurements.read_files([*same, other])
    assert data.groups == [str(same[0]), str(same[1]), "other"]
    assert len(data) == 9
    with pytest.raises(UsageError, match=r"other\.csv: the file is named twice"):
        Measurements.read_files([other, other])


def test_set_ups_that_are_numbered_are_the_same_with_and_without_a_point(tmp_path: Path) -> None:
    header = "q1,x,y,z,group"
    plain = write(tmp_path, header, ["0,1,2,3,2", "1,1,2,3,10"], "plain.csv")
    behind_a_gap = write(tmp_path, header, ["2,1,2,3,2.0", "3,1,2,3,10.0"], "behind_a_gap.csv")
    assert Measurements.read_files([plain, behind_a_gap]).groups == ["2", "10"]
    named = write(tmp_path, header, ["2,1,2,3,2.0", "3,1,2,3,2.5"], "named.csv")
    assert Measurements.read_csv(named).groups == ["2.0", "2.5"]


def test_files_that_name_the_same_group_share_it(tmp_path: Path) -> None:
    paths = [write(tmp_path, "q1,x,y,z,group", ["0,1,2,3,a"], name) for name in ("one.csv", "two.csv")]
    assert Measurements.read_files(paths).groups == ["a"]


def test_parts_of_other_arms_do_not_go_together() -> None:
    parts = [Measurements.from_dataframe(frame(joints=n), name=f"arm{n}") for n in (3, 4)]
    with pytest.raises(InputError, match="4 joints in arm4, 3 in arm3"):
        Measurements.concatenate(parts)
    with pytest.raises(InputError, match="no measurements"):
        Measurements.concatenate([])


def test_identical_rows_are_counted_once() -> None:
    table = frame(5)
    table = pd.concat([table, table.iloc[[1, 3]]], ignore_index=True)
    data = Measurements.from_dataframe(table)
    assert data.identical_rows().tolist() == [False] * 5 + [True] * 2
    assert data.deduplicated().rows.tolist() == [1, 2, 3, 4, 5]
    table["temperature_C"] = np.arange(7.0)
    assert not Measurements.from_dataframe(table).identical_rows().any()


@given(rows=st.permutations(range(6)))
def test_the_hash_is_of_the_content(rows: list[int]) -> None:
    data = Measurements.from_dataframe(frame(), name="one")
    same = Measurements.concatenate([data.select([0, 1]), data.select([2, 3, 4, 5])])
    assert same.hash() == data.hash()
    assert (data.select(rows).hash() == data.hash()) == (rows == list(range(6)))


def test_every_part_of_the_content_counts_in_the_hash() -> None:
    table = frame()
    hashes = {Measurements.from_dataframe(table, name="a").hash()}
    changes: dict[str, Any] = {"q1": 0.5, "x": 9.0, "sigma_m": 1e-5, "temperature_C": 20.0, "group": "b"}
    axes = {f"sigma_{axis}": 1e-5 for axis in "xyz"}
    turned = {"qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0, "sigma_rad": 1e-4}
    for name, value in changes.items():
        changed = Measurements.from_dataframe(table.assign(**{name: value}), name="a")
        hashes.add(changed.hash())
    for columns in (axes, turned, {**turned, "sigma_rad": 2e-4}):
        hashes.add(Measurements.from_dataframe(table.assign(**columns), name="a").hash())
    assert len(hashes) == 9
    assert all(len(text) == 64 for text in hashes)


finite = st.floats(-1e6, 1e6)


@given(values=st.lists(st.tuples(*[finite] * 5), min_size=1, max_size=5))
def test_numbers_survive_the_file_bit_for_bit(tmp_path_factory: pytest.TempPathFactory, values: Any) -> None:
    path = tmp_path_factory.mktemp("csv") / "data.csv"
    path.write_text("\n".join([HEADER, *(",".join(map(repr, row)) for row in values)]))
    data = Measurements.read_csv(path)
    np.testing.assert_array_equal(np.hstack([data.readings, data.targets[:, 0]]), values)


def test_arrays_cannot_be_changed() -> None:
    data = Measurements.from_dataframe(frame())
    with pytest.raises(ValueError, match="read-only"):
        data.readings[0, 0] = 1.0


@pytest.mark.parametrize(
    ("name", "count", "joints", "targets"),
    [("ur10_ipa_B", 1495, 6, 1), ("irb120_faro", 1000, 6, 3), ("ur5_gtpn", 727, 6, 1)],
)
def test_public_data(shared_data: Path, name: str, count: int, joints: int, targets: int) -> None:
    data = Measurements.read_csv(shared_data / f"{name}.csv")
    assert (len(data), data.joint_count, data.target_count) == (count, joints, targets)
    table = np.genfromtxt(shared_data / f"{name}.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(data.readings[:, 0], table["q1"])
    np.testing.assert_array_equal(data.targets[:, 0], np.column_stack([table[axis] for axis in "xyz"]))


def test_tables_of_one_name_are_set_ups_of_their_own(tmp_path: Path) -> None:
    tables = [Measurements.from_dataframe(frame().assign(x=float(k))) for k in range(3)]
    together = Measurements.of(tables)
    assert together.groups == together.files == ["data", "data 2", "data 3"]
    again = Measurements.concatenate([Measurements.of(tables[:2]), tables[1], tables[2]])
    assert again.groups == ["data", "data 2", "data 3"]
    assert again.deduplicated().hash() == together.hash()
    for folder in ("monday", "tuesday"):
        (tmp_path / folder).mkdir()
    paths = [write(tmp_path / "monday"), write(tmp_path / "tuesday")]
    listed = Measurements.of([Measurements.read_csv(path) for path in paths])
    files = Measurements.read_files(paths)
    assert listed.groups == files.groups == [str(path) for path in paths]
    assert listed.hash() == files.hash()
    assert Measurements.of([files, Measurements.read_csv(paths[0])]).groups == files.groups


def test_names_that_are_stated_and_parts_of_one_table_stay_together() -> None:
    named = [Measurements.from_dataframe(frame().assign(group="lab", x=float(k))) for k in range(2)]
    assert Measurements.of(named).groups == ["lab"]
    data = Measurements.from_dataframe(frame())
    parts = [data.select([0, 1]), data.select([1, 2, 3])]
    assert Measurements.of(parts).groups == ["data"]
    renamed = [
        replace(part, group=np.full(len(part), "lab"))
        for part in (data, Measurements.from_dataframe(frame().assign(x=9.0), name="b"))
    ]
    assert Measurements.of(renamed).groups == ["lab"]


def test_arrays_of_the_caller_stay_the_callers() -> None:
    data = Measurements.from_dataframe(frame().assign(load=1.0))
    arrays: dict[str, Any] = {
        name: np.array(getattr(data, name)) for name in ("readings", "targets", "group", "sources", "rows")
    }
    features = pd.DataFrame({"load": np.ones(len(data))})
    made = replace(data, **arrays, features=features)
    assert all(array.flags.writeable for array in arrays.values())
    arrays["readings"][:], features["new"], features["load"] = 9.0, 1.0, 2.0
    assert made.hash() == data.hash()
    other = replace(made, group=np.full(len(data), "b"))
    handed_out = other.features
    handed_out["new"] = 1.0
    assert list(made.features) == list(other.features) == ["load"]
    with pytest.raises(InputError, match="features: 2 rows. There are 6 readings"):
        replace(data, features=pd.DataFrame({"load": [1.0, 2.0]}))


def test_the_name_of_a_set_up_counts_in_the_hash() -> None:
    one, two = (Measurements.from_dataframe(frame(), name=name) for name in ("one", "two"))
    assert one.hash() != two.hash()
    named = [Measurements.from_dataframe(frame().assign(group="a"), name=name) for name in ("one", "two")]
    assert named[0].hash() == named[1].hash()


def test_distances_that_nothing_names_lead_to_one_anchor() -> None:
    wire = pd.DataFrame({"q1": [0.0, 1.0, 2.0], "distance": [1.0, 2.0, 3.0]})
    data = Measurements.from_dataframe(wire)
    assert data.anchor is not None
    assert data.anchor.tolist() == ["anchor of data"] * 3
    assert [notice.kind for notice in data.notices] == ["no_anchor_named"]
    assert not Measurements.from_dataframe(wire.assign(anchor="box")).notices


def test_tables_that_are_set_ups_of_their_own_have_anchors_of_their_own() -> None:
    wires = [pd.DataFrame({"q1": [0.0, 1.0], "distance": [1.0, k]}) for k in (2.0, 3.0)]
    first, second = (Measurements.from_dataframe(wire) for wire in wires)
    both = Measurements.concatenate([first, second, first.select([1])])
    assert both.anchor is not None
    assert both.group.tolist() == ["data", "data", "data 2", "data 2", "data"]
    assert both.anchor.tolist() == [f"anchor of {group}" for group in both.group]
    again = Measurements.concatenate([both, second])
    assert again.anchor is not None
    assert again.anchor.tolist() == [*both.anchor.tolist(), *["anchor of data 2"] * 2]
    named = [Measurements.from_dataframe(wire.assign(group="a"), name=wire.columns[0]) for wire in wires]
    joined = Measurements.concatenate(named).anchor
    assert joined is not None
    assert set(joined.tolist()) == {"anchor 1"}


BY_HAND: dict[str, Any] = {
    "readings": np.linspace(0.0, 1.0, 18).reshape(3, 6),
    "targets": np.linspace(1.0, 2.0, 9).reshape(3, 1, 3),
    "orientations": None,
    "sigma_m": None,
    "group": np.array(["a", "a", "b"]),
    "features": pd.DataFrame(index=range(3)),
    "sources": np.array(["hand"] * 3),
    "rows": np.arange(1, 4),
}


def test_arrays_of_any_kind_make_the_same_measurements() -> None:
    lists = {name: value.tolist() for name, value in BY_HAND.items() if isinstance(value, np.ndarray)}
    plain, listed = Measurements(**BY_HAND), Measurements(**{**BY_HAND, **lists})
    assert listed.hash() == plain.hash()
    assert listed.row_names(np.array([True, False, True])) == "rows 1 and 3"
    single = Measurements(**{**BY_HAND, "readings": np.asfortranarray(BY_HAND["readings"], dtype=np.float32)})
    assert single.readings.dtype == np.float64
    assert single.readings.flags.c_contiguous
    hidden = np.ma.masked_less(BY_HAND["targets"], 1.1)
    assert np.isnan(Measurements(**{**BY_HAND, "targets": hidden}).targets[0, 0, 0])


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("readings", None, r"readings: shape \(\). It must be \(n, N\)"),
        ("readings", np.zeros(6), r"readings: shape \(6,\). It must be \(n, N\)"),
        ("readings", np.zeros((3, 6), complex), "readings are not real numbers"),
        ("targets", np.zeros((3, 3)), r"targets: shape \(3, 3\). It must be \(n, T, 3\)"),
        ("targets", np.zeros((3, 1, 2)), r"targets: shape \(3, 1, 2\)"),
        ("targets", np.zeros((2, 1, 3)), "targets: 2 rows. There are 3 readings"),
        ("orientations", np.zeros((3, 3)), r"orientations: shape \(3, 3\). It must be \(n, 4\)"),
        ("sigma_m", 1e-4, r"sigma_m: shape \(\). It must be \(n,\)"),
        ("sigma_axes_m", np.ones(3), r"sigma_axes_m: shape \(3,\). It must be \(n, 3\)"),
        ("group", "a", r"group: shape \(\). It must be \(n,\)"),
        ("rows", [1.0, 2.0, 3.0], "rows: values of type float64. They must be whole numbers"),
        ("features", pd.DataFrame({"n": ["x"] * 3}), 'features: column "n" of type .* Columns hold numbers'),
    ],
)  # fmt: skip
def test_arrays_of_another_shape_are_told_theirs(name: str, value: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        Measurements(**{**BY_HAND, name: value})


def test_a_file_whose_name_is_no_text_names_its_set_up_readably(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"caf\xe9.csv")
    path.write_text("q1,x,y,z\n0.1,1,2,3\n0.2,1,2,3\n")
    read = Measurements.read_csv(path)
    assert read.groups == ["caf\ufffd"]
    assert len(read.hash()) == 64
    assert Measurements.read_files([path]).groups == Measurements.read_touches(path).groups == read.groups
    write_whole(path, path.name)
    assert path.read_text() == "caf\\udce9.csv"


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null"])
def test_devices_are_refused_before_they_are_read(device: str) -> None:
    with pytest.raises(InputError, match=f"{device}: this is a device. A file or a pipe is needed"):
        Measurements.read_csv(device)
