"""A column whose unit changes from some row on is told; an instrument that was moved is not taken for it."""

import numpy as np
import pytest

import truearm as ta
from truearm.doubts.unit_change import check_one_unit
from truearm.errors import InputError
from truearm.simulation import VirtualArm

ROWS = 60


def table_of(name="ur10", seed=3):
    arm = VirtualArm(ta.Robot.load(name), seed=seed)
    return arm.measure_table(arm.poses(ROWS))


def changed(table, first, factor):
    other = table.copy()
    other.loc[first:, ["x", "y", "z"]] *= factor
    return ta.Measurements.from_dataframe(other)


@pytest.mark.parametrize("name", ["ur10", "rv-m2", "kuka-iiwa-7"])
@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1.0 / 25.4, "millimetres and inches"),
        (25.4, "millimetres and inches"),
        (1e-3, "millimetres and metres"),
        (39.37, "inches and metres"),
    ],
)
@pytest.mark.parametrize("first", [5, 30, ROWS - 5])
def test_a_unit_that_changes_is_told_with_the_row(name, factor, words, first):
    with pytest.raises(InputError, match=rf"from row {first + 1} on points look like another unit.*{words}"):
        check_one_unit(changed(table_of(name), first, factor), ta.Robot.load(name))


def test_a_calibration_is_not_begun():
    data = changed(table_of(), 40, 1.0 / 25.4)
    with pytest.raises(InputError, match="from row 41 on .* own with its unit"):
        ta.calibrate(ta.Robot.load("ur10"), data)


@pytest.mark.parametrize("seed", range(20))
def test_an_instrument_that_was_moved_is_no_unit(seed):
    table = table_of(seed=seed)
    away = np.random.default_rng(seed).normal(size=3)
    table.loc[30:, ["x", "y", "z"]] += 60.0 * away / np.linalg.norm(away)
    for each in (table, table_of(seed=seed)):
        check_one_unit(ta.Measurements.from_dataframe(each), ta.Robot.load("ur10"))


def test_an_arm_that_stays_near_by_is_no_unit():
    """Points about the origin of the device, wide ones and then some in one place."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    wide = arm.poses(30)
    near = wide[0] + 0.03 * np.random.default_rng(1).normal(size=(30, 6))
    table = arm.measure_table(np.concatenate([wide, near]))
    table[["x", "y", "z"]] -= table.loc[30:, ["x", "y", "z"]].mean()
    check_one_unit(ta.Measurements.from_dataframe(table), arm.robot)
