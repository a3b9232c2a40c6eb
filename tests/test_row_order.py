"""Rows in an order of their poses are told; where poses change at once no cause of a step is named."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truearm as ta
from truearm.cell.plan import PlanOptions, plan_poses
from truearm.doubts.row_order import poses_change
from truearm.drifting import drift_notices
from truearm.fits.details import DriftDetails, Jump
from truearm.reporting.report import report
from truearm.simulation import VirtualArm

ROWS = 90
ROBOT = ta.Robot.load("ur10")


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(ROBOT, seed=4)


def told_of(arm, readings, **options):
    """What a calibration from readings in this order says of the order."""
    chosen = {"model": "constant", "refit": False, **options}
    calibration = ta.calibrate(arm.robot, arm.measure(readings), **chosen)
    return [str(notice) for notice in calibration.notices if notice.kind == "order_of_poses"], calibration


@pytest.mark.parametrize("by", ["z", "joint", "nested"])
def test_rows_sorted_by_their_poses_are_told(arm, by):
    readings = arm.poses(ROWS)
    keys = {"z": ROBOT.position(readings)[:, 2], "joint": readings[:, 1]}
    readings = readings[np.argsort(keys.get(by, np.floor(3.0 * readings[:, 0])), kind="stable")]
    (told,), calibration = told_of(arm, readings)
    assert "there and back" in told
    assert "--drift none" in told
    assert told in {advice.words for advice in report(calibration).advice}
    assert told_of(arm, readings, drift="none")[0] == []


def test_shots_do_not_hide_an_order_nor_make_one(arm):
    readings = arm.poses(40)
    assert told_of(arm, np.repeat(readings, 3, axis=0))[0] == []
    assert told_of(arm, np.repeat(readings[np.argsort(readings[:, 0])], 3, axis=0))[0]


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.sampled_from([20, 30, 45, 100]))
def test_random_poses_follow_no_order(arm, seed, count):
    readings = arm.poses(count, seed=seed)
    assert told_of(arm, readings)[0] == []


@pytest.mark.parametrize(("order", "follows"), [("short", True), ("paper", True), ("there-and-back", False)])
def test_of_planned_orders_the_default_is_not_that_of_the_poses(arm, order, follows):
    assert PlanOptions().order == "there-and-back"
    readings = plan_poses(ROBOT, PlanOptions(60, order=order)).poses.readings
    assert bool(told_of(arm, readings)[0]) == follows


def test_poses_change_where_sorted_ones_begin_anew():
    rng = np.random.default_rng(0)
    poses, when = rng.uniform(-1.0, 1.0, (80, 6)), np.arange(80.0)
    assert not poses_change(poses, when, (39.0, 40.0))
    poses[:60] = poses[np.argsort(poses[:60, 1])]
    assert poses_change(poses, when, (59.0, 60.0))
    assert poses_change(poses, when, (57.0, 62.0))
    assert not poses_change(poses, when, (29.0, 30.0))
    assert not poses_change(poses, when, (78.0, 79.0))


@pytest.mark.parametrize("changes", [False, True])
def test_no_cause_is_named_where_the_poses_change_too(changes):
    jump = Jump("row 268 and row 271", 0.11, changes)
    details = DriftDetails({"A": 0.3}, {"constant": 0.2}, {"A": (jump,)})
    (notice,) = drift_notices(details)
    assert ("was touched" in str(notice)) != changes
    assert ("the poses change" in str(notice)) == changes
    assert details.slips == ({} if changes else {"A": [jump]})
    assert DriftDetails.from_dict(details.to_dict()) == details


@pytest.mark.parametrize("changes", [False, True])
def test_steps_farther_than_anything_slips_are_another_place_where_the_poses_change_too(changes):
    details = DriftDetails(
        {"A": 5e3}, {"constant": 0.2}, {"A": (Jump("row 120 and row 121", 4.9e3, changes),)}
    )
    (notice,) = drift_notices(details)
    assert notice.kind == "another_place"
    assert "column `group`" in str(notice)
    assert ("far from its nominal one" in str(notice)) == changes


def test_a_step_between_sorted_poses_and_their_repeats_is_not_put_down_to_a_slip():
    robot = VirtualArm.paper(seed=4).robot
    arm = VirtualArm.paper(seed=4)
    readings = arm.poses(100)
    readings = readings[np.argsort(robot.position(readings)[:, 2])]
    readings = np.vstack([readings, readings[::5] + 1e-3])
    points = arm.measure(readings).targets[:, 0].copy()
    points[100:, 0] += 1e-3
    columns = [*(f"q{k}" for k in range(1, 6)), *"xyz"]
    table = pd.DataFrame(np.hstack([readings, points]), columns=columns)
    calibration = ta.calibrate(robot, ta.Measurements.from_dataframe(table), refit=False)
    drift = calibration.validation.drift
    assert drift is not None
    assert drift.jumps
    assert drift.slips == {}
    assert "gave_way" not in {advice.kind for advice in report(calibration).advice}
