"""Joints that were measured at a few values alone are told; joints of random poses never are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import truearm as ta
from truearm.doubts.few_values import few_values, values_words
from truearm.doubts.grids import grid_steps
from truearm.reporting.report import report
from truearm.simulation import VirtualArm

KINDS = ("prismatic", *["revolute"] * 3)
STATIONS = ([0.0, 1.5, 3.0, 4.5, 6.0], [0.1, 1.37, 2.91, 4.62, 5.83], [0.2, 4.0])


def drawn(count, seed=0):
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (count, len(KINDS)))


def at_values(count, values, seed=1, jitter=2e-4):
    rng = np.random.default_rng(seed)
    return rng.choice(values, count) + rng.normal(0.0, jitter, count)


@pytest.mark.parametrize("count", [30, 300])
@pytest.mark.parametrize("values", STATIONS)
def test_values_of_prismatic_and_revolute_joints_are_found_regular_or_not(count, values):
    readings = drawn(count)
    readings[:, 0], readings[:, 2] = at_values(count, values), at_values(count, values)
    found = few_values(readings, KINDS)
    assert list(found) == [1, 3]
    assert found[1] == pytest.approx(np.multiply(values, 1e3), abs=1.0)
    assert found[3] == pytest.approx(np.degrees(values), abs=0.1)
    assert f"joint 1 at {len(values)} values (" in values_words(found, KINDS)


@given(
    count=st.integers(2, 400),
    seed=st.integers(0, 10_000),
    scale=st.sampled_from([0.005, 0.01, 0.1, 1.0, 3.0]),
    kind=st.sampled_from(["uniform", "normal", "rounded", "slip"]),
)
def test_random_poses_have_no_few_values(count, seed, scale, kind):
    rng = np.random.default_rng(seed)
    readings = scale * (rng.normal if kind == "normal" else rng.uniform)(-1.0, 1.0, (count, len(KINDS)))
    if kind == "rounded":
        readings = np.hstack([readings[:, :1].round(4), np.radians(np.degrees(readings[:, 1:]).round(1))])
    if kind == "slip":
        readings[0, :] = 500.0
    assert few_values(readings, KINDS) == {}


def test_joints_that_stand_still_and_repeats_of_poses_have_no_few_values():
    readings = drawn(100)
    readings[:, 0], readings[:, 1] = 0.3, 0.2
    assert few_values(readings, KINDS) == {}
    for times in (5, 40):
        assert few_values(np.repeat(drawn(8), times, axis=0), KINDS) == {}
        assert few_values(np.tile(drawn(20), (times, 1)), KINDS) == {}


def test_a_few_values_are_told_with_the_way_out_and_in_the_report():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4)
    readings = arm.poses(90)
    readings[:, 0] = at_values(90, np.radians([-150.0, -60.0, 10.0, 50.0, 140.0]))
    calibration = ta.calibrate(arm.robot, arm.measure(readings), model="constant")
    (told,) = (str(notice) for notice in calibration.notices if notice.kind == "few_values")
    assert "joint 1 at 5 values (-150, -60, 10, 50, 140 deg) alone" in told
    assert "in between" in told
    assert "truearm evaluate" in told
    assert told in {advice.words for advice in report(calibration).advice}
    assert "on_a_grid" not in {notice.kind for notice in calibration.notices}
    readings[:, 0] = np.radians(40.0 * np.random.default_rng(0).integers(-3, 4, 90))
    kinds = {notice.kind for notice in ta.calibrate(arm.robot, arm.measure(readings)).notices}
    assert "on_a_grid" in kinds
    assert "few_values" not in kinds


@pytest.mark.parametrize("away", [[133.0], [171.3, 172.9, -160.2]])
def test_a_grid_is_seen_beside_poses_that_are_far_off_it(away):
    rng = np.random.default_rng(3)
    degrees = np.append(10.0 * rng.integers(-6, 7, 200), away)
    assert grid_steps(np.deg2rad(degrees)[:, None], ["revolute"])[1] == pytest.approx(10.0, abs=1e-3)


def test_grids_of_long_rails_and_of_values_far_away_are_looked_for_in_wider_bins():
    rng = np.random.default_rng(0)
    rail = np.append(1.5 * rng.integers(0, 41, 400), 60.0)
    assert grid_steps(rail[:, None], ["prismatic"])[1] == pytest.approx(1500.0)
    assert grid_steps(np.append(rng.uniform(0.0, 3.0, 400), 1e6)[:, None], ["prismatic"]) == {}
