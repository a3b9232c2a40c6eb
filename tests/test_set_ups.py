"""Set-ups that share an arm: how few rows each may have, and what each measured."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import truearm as ta
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
