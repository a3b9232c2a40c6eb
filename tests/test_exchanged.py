"""Rows in the wrong order, and targets exchanged in a row, are told from outliers."""

import numpy as np
import pytest

import truearm as ta
from truearm.doubts.of_results import to_check
from truearm.doubts.outliers import Outliers
from truearm.outlier_fate import FULL_WEIGHT, TAKEN_OUT
from truearm.reporting.facts import Facts
from truearm.reporting.parts import Table
from truearm.reporting.provenance import provenance
from truearm.simulation import VirtualArm

ROWS = 64
POINT = ["x", "y", "z"]
BENDING = {10: 11, 11: 10, 40: 41, 41: 40}


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(ta.Robot.load("abb-irb-120"), seed=5)


@pytest.fixture(scope="module")
def table(arm):
    return arm.measure_table(arm.poses(ROWS))


@pytest.fixture(scope="module")
def both(arm, table):
    """Rows of two targets."""
    second = VirtualArm(arm.robot, seed=5)
    second.target_in_flange = arm.target_in_flange + np.array([0.05, 0.08, -0.03])
    other = second.measure_table(arm.poses(ROWS), seed=1)
    return table.assign(**{f"{axis}2": other[axis] for axis in POINT})


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
    assert "taken out of the fits" in notice.message
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


def test_exchanged_targets_of_a_row_are_named(arm, both):
    changed, there = both.copy(), [f"{axis}2" for axis in POINT]
    changed.loc[[12], POINT + there] = both.loc[[12], there + POINT].to_numpy()
    notice = notices_of(arm, changed)["targets_exchanged"]
    assert "In row 13 points fit the places of other targets" in notice.message
    assert notice.rows == (13,)


def constants_of(arm, table, **options):
    found = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant", **options)
    return found, {notice.kind: notice for notice in found.notices}


def test_rows_that_bend_the_constants_are_named_as_exchanged(arm, table):
    """A constant fit takes no row out: what is exchanged bends it until nothing fits anywhere."""
    _, told = constants_of(arm, with_points_of(table, BENDING))
    assert told["rows_exchanged"].rows == (11, 12, 41, 42)
    assert "kept at full weight in the fit" in told["rows_exchanged"].message
    assert "Put right first what is exchanged" in told["no_help"].message
    assert "another robot" not in " ".join(map(str, told.values()))


def test_targets_that_bend_the_constants_are_named_as_exchanged(arm, both):
    changed, there = both.copy(), [f"{axis}2" for axis in POINT]
    changed.loc[[10, 30, 50], POINT + there] = both.loc[[10, 30, 50], there + POINT].to_numpy()
    _, told = constants_of(arm, changed)
    assert told["targets_exchanged"].rows == (11, 31, 51)
    assert "coupling" not in " ".join(map(str, told.values()))


@pytest.mark.parametrize(
    ("options", "fate"),
    [
        ({"robust": "cauchy"}, "given less weight in the fit"),
        ({}, "kept at full weight in the fit"),
    ],
)
def test_what_became_of_exchanged_rows_is_said_alike_everywhere(arm, table, options, fate):
    found, told = constants_of(arm, with_points_of(table, {50: 51, 51: 50}), **options)
    assert fate in told["rows_exchanged"].message
    parts = provenance(Facts(found)).parts
    (listed,) = (part for part in parts if isinstance(part, Table) and part.title == "Outliers")
    assert f"They were {fate}" in listed.says


def test_outliers_of_constants_are_given_with_a_robust_way_out():
    assert "--robust cauchy" in to_check(Outliers("row 3 (20.00 mm)", {}, fate=FULL_WEIGHT))
    assert "--robust" not in to_check(Outliers("row 3 (20.00 mm)", {}, fate=TAKEN_OUT))
