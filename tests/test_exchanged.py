"""Rows in the wrong order, and targets exchanged in a row, are told from outliers."""

import numpy as np
import pytest

import truearm as ta
from truearm.simulation import VirtualArm

ROWS = 80
POINT = ["x", "y", "z"]


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(ta.Robot.load("abb-irb-120"), seed=5)


@pytest.fixture(scope="module")
def table(arm):
    return arm.measure_table(arm.poses(ROWS))


def with_points_of(table, source):
    """The points of rows `source` at the readings of the others they are given for."""
    changed = table.copy()
    changed.loc[list(source), POINT] = table.loc[list(source.values()), POINT].to_numpy()
    return changed


def notices_of(arm, table):
    found = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), refit=False)
    return {notice.kind: notice for notice in found.notices}


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ({50: 51, 51: 50}, "The points of rows 51 and 52 fit the readings of one another"),
        ({3: 20, 20: 61, 61: 3}, "The points of rows 4, 21 and 62 fit the readings of one another"),
    ],
)
def test_rows_in_the_wrong_order_are_named(arm, table, source, words):
    notice = notices_of(arm, with_points_of(table, source))["rows_exchanged"]
    assert words in notice.message
    assert set(notice.rows) == {row + 1 for row in source}


def test_outliers_that_fit_nowhere_are_no_exchange(arm, table):
    far = table.copy()
    far.loc[[10, 30], POINT] += np.array([[0.3, 0.1, 0.0], [0.0, 0.2, -0.4]])
    found = notices_of(arm, far)
    assert not {"rows_exchanged", "targets_exchanged"} & set(found)


def test_a_point_noted_twice_is_no_exchange(arm, table):
    """Row 21 holds the point of row 22, which is lost itself: nothing can be put right."""
    spoilt = with_points_of(table, {20: 21})
    spoilt.loc[[21], POINT] += np.array([[0.2, -0.1, 0.3]])
    found = notices_of(arm, spoilt)
    assert not {"rows_exchanged", "targets_exchanged"} & set(found)


def test_exchanged_targets_of_a_row_are_named(arm, table):
    second = VirtualArm(arm.robot, seed=5)
    second.target_in_flange = arm.target_in_flange + np.array([0.05, 0.08, -0.03])
    other = second.measure_table(arm.poses(ROWS), seed=1)
    both = table.assign(**{f"{axis}2": other[axis] for axis in POINT})
    here, there = POINT, [f"{axis}2" for axis in POINT]
    both.loc[[12], here + there] = both.loc[[12], there + here].to_numpy()
    notice = notices_of(arm, both)["targets_exchanged"]
    assert "In row 13 points fit the places of other targets" in notice.message
    assert notice.rows == (13,)
