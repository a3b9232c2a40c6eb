"""Set-ups that share an arm: how few rows each may have, and what each measured."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm.proposing import Candidates
from truearm.simulation import VirtualArm


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(ta.Robot.load("ur10"), seed=1)


def written(table, path):
    table.to_csv(path, index=False)
    return path


def test_a_set_up_too_small_to_find_its_frame_is_refused_with_the_way_out(arm, tmp_path):
    many = written(arm.measure_table(arm.poses(60)), tmp_path / "monday.csv")
    few = written(arm.measure_table(arm.poses(5, seed=1), seed=1), tmp_path / "more.csv")
    data = ta.Measurements.read_files([many, few])
    words = (
        r"more.csv: \d+ measured values in [1-3] training rows? cannot determine the 9 unknowns of frame and "
        r'target of set-up "more". .* the same name in a column "group"'
    )
    with pytest.raises(ta.WorkError, match=words):
        ta.calibrate(arm.robot, data, model="constant")


def test_few_rows_join_the_set_up_that_their_group_names(arm, tmp_path):
    many = written(arm.measure_table(arm.poses(60)), tmp_path / "monday.csv")
    table = arm.measure_table(arm.poses(5, seed=1), seed=1)
    table["group"] = "monday"
    data = ta.Measurements.read_files([many, written(table, tmp_path / "more.csv")])
    found = ta.calibrate(arm.robot, data, model="constant")
    assert found.groups == ("monday",)
    assert found.validation.holdout["constant"].position.max < 2.0


def test_the_group_of_a_file_means_the_set_up_of_another_that_has_its_name(arm, tmp_path):
    paths = [tmp_path / day / "measurements.csv" for day in ("day1", "day2", "day3")]
    for seed, path in enumerate(paths):
        path.parent.mkdir()
        written(arm.measure_table(arm.poses((60, 5, 30)[seed], seed=seed), seed=seed), path)
    assert ta.Measurements.read_files(paths).groups == list(map(str, paths))
    written(pd.read_csv(paths[1]).assign(group="measurements"), paths[1])
    data = ta.Measurements.read_files(paths[:2])
    assert data.groups == ["measurements"]
    found = ta.calibrate(arm.robot, data, model="constant")
    assert found.validation.holdout["constant"].position.max < 2.0
    again = ta.Measurements.concatenate([data.select(slice(60)), ta.Measurements.read_csv(paths[1])])
    assert again.groups == ["measurements"]


def test_a_group_that_two_files_have_the_name_of_is_asked_for(arm, tmp_path):
    paths = [tmp_path / day / "measurements.csv" for day in ("day1", "day2", "day3")]
    for seed, path in enumerate(paths):
        path.parent.mkdir()
        written(arm.measure_table(arm.poses(5, seed=seed), seed=seed), path)
    written(pd.read_csv(paths[1]).assign(group="measurements"), paths[1])
    words = (
        r'day2/measurements.csv": column "group" says "measurements", as ".*day1.*" and ".*day3.*" are called'
    )
    with pytest.raises(ta.InputError, match=words):
        ta.Measurements.read_files(paths)
    written(pd.read_csv(paths[0]).assign(group="measurements"), paths[0])
    assert ta.Measurements.read_files(paths).groups == ["measurements"], "the stem of the only one without"


def test_a_set_up_without_orientations_leaves_nothing_open_that_was_measured(arm):
    posed = arm.measure(arm.poses(40), orientation=True, seed=0)
    placed = arm.measure(arm.poses(40, seed=1), seed=1)
    both = ta.Measurements.concatenate([posed, placed])
    group = np.repeat(["posed", "placed"], 40)
    found = ta.calibrate(arm.robot, replace(both, group=group), model="constant")
    assert found.groups == ("posed", "placed")
    assert not [notice for notice in found.notices if notice.kind == "open_setup"]


def numbered(arm, names):
    """Rows of as many set-ups as there are names, ten of each, in a table."""
    table = arm.measure_table(arm.poses(10 * len(names)))
    return table.assign(group=np.repeat(np.array(names), 10))


@pytest.mark.parametrize(
    ("names", "told"),
    [
        ([1764400000000000001, 1764400000000000002], ["1764400000000000001", "1764400000000000002"]),
        (np.array([2**64 - 1, 2**64 - 2], dtype=np.uint64), ["18446744073709551615", "18446744073709551614"]),
        ([True, False], ["True", "False"]),
        ([1.0, 2.0], ["1", "2"]),
    ],
    ids=["times in ns", "hashes", "truth values", "floats"],
)
@pytest.mark.parametrize("nullable", [False, True])
def test_set_ups_are_told_apart_by_all_digits_of_their_numbers(arm, tmp_path, names, told, nullable):
    table = numbered(arm, names)
    data = ta.Measurements.from_dataframe(table.convert_dtypes() if nullable else table)
    assert data.groups == told
    again = ta.Measurements.read_csv(written(table, tmp_path / "numbered.csv"))
    assert again.groups == told


def test_pairs_and_anchors_are_told_apart_by_all_digits(arm):
    wire = arm.measure_table(arm.poses(4)).drop(columns=["x", "y", "z"]).assign(distance=1.0)
    number = 1764400000000000001
    anchors = ta.Measurements.from_dataframe(wire.assign(anchor=[number, number, number + 1, number + 1]))
    assert anchors.anchor is not None
    assert len(set(anchors.anchor)) == 2
    gaps = pd.array([number, number, number + 1, number + 1], dtype="Int64")
    pairs = ta.Measurements.from_dataframe(wire.assign(pair=gaps))
    assert pairs.pair is not None
    assert pairs.pair.tolist() == [str(number)] * 2 + [str(number + 1)] * 2


def test_whole_and_truth_columns_are_features_as_before(arm):
    table = arm.measure_table(arm.poses(6)).assign(load=[1, 2, 3, 1, 2, 3], warm=[True, False] * 3)
    table["shift"] = pd.array([1, None, 3, 1, 2, 3], dtype="Int64")
    data = ta.Measurements.from_dataframe(table)
    assert data.features["load"].tolist() == [1.0, 2.0, 3.0, 1.0, 2.0, 3.0]
    assert data.features["warm"].tolist() == [1.0, 0.0] * 3
    np.testing.assert_array_equal(data.features["shift"], [1.0, np.nan, 3.0, 1.0, 2.0, 3.0])


def test_a_set_up_with_a_number_for_its_name_may_be_asked_for_by_it(arm):
    data = ta.Measurements.from_dataframe(arm.measure_table(arm.poses(60)).assign(group=1))
    found, q = ta.calibrate(arm.robot, data, model="constant"), arm.poses(2, seed=3)
    assert found.groups == ("1",)
    numbers: list[Any] = [1, np.int64(1)]
    for number in numbers:
        np.testing.assert_array_equal(found.position(q, group=number), found.position(q, group="1"))
        assert Candidates(found, q, group=number).group == "1"
    for ask in (lambda: found.position(q, group=2), lambda: Candidates(found, q, group=2)):
        with pytest.raises(ta.UsageError, match='there is no set-up "2". The calibration knows "1"'):
            ask()
    with pytest.raises(ta.UsageError, match=r"group is 1.5. It must be a name, a text or a whole number"):
        found.position(q, group=cast("Any", 1.5))
