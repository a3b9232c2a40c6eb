"""A tool that was held one way in all poses: found, told, and calibrated for work with the tool held so."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truearm as ta
from truearm.doubts.held_tool import held_tool, held_words
from truearm.reporting.report import report
from truearm.robot import Robot
from truearm.simulation import VirtualArm

DOWN = -np.pi / 2


def held(count, seed=0, *, spin=False, tilt_deg=0.0):
    """Readings of a UR whose tool points down; turned about the vertical, or not; tilted at random."""
    rng = np.random.default_rng(seed)
    readings = rng.uniform([-2.6, -2.2, 0.3, 0.0, 0.0, -2.6], [2.6, -0.6, 2.2, 0.0, 0.0, 2.6], (count, 6))
    readings[:, 3] = DOWN - readings[:, 1] - readings[:, 2]
    readings[:, 4] = DOWN
    if not spin:
        readings[:, 5] = readings[:, 0]
    readings[:, 3:5] += np.radians(rng.normal(0.0, tilt_deg, (count, 2)))
    return readings


def test_tools_that_are_held_one_way_are_found_with_how_far_they_turn():
    robot = Robot.load("ur10")
    found = held_tool(robot, held(50))
    assert found is not None
    assert found.entirely
    assert found.spread_rad == pytest.approx(0.0, abs=1e-12)
    assert held_words(found) == "the tool held one way, to within 0.01 deg"
    tilted = held_tool(robot, held(400, tilt_deg=0.5))
    assert tilted is not None
    # Along the tool both tilts show, across it one alone.
    assert np.degrees(tilted.spread_rad) == pytest.approx(np.sqrt(2.0) * 0.5, rel=0.1)
    assert held_tool(robot, held(400, tilt_deg=4.0)) is None


def test_tools_that_turn_about_one_direction_are_found_with_it():
    found = held_tool(Robot.load("ur10"), held(50, spin=True))
    assert found is not None
    assert not found.entirely
    assert found.direction == pytest.approx([0.0, 0.0, 1.0])
    assert held_words(found).startswith(
        "the tool turned about one direction of the flange alone, (0, 0, 1), "
    )


@pytest.mark.parametrize("name", ["adept-cobra-600", "rv-m2", "kuka-kr-6-r900", "ur5e", "franka-panda"])
@settings(max_examples=15)
@given(seed=st.integers(0, 10_000))
def test_poses_drawn_over_the_workspace_hold_no_tool(name, seed):
    robot = Robot.load(name)
    low, high = np.clip(robot.limits.T, -np.pi, np.pi)
    readings = np.random.default_rng(seed).uniform(low, high, (40, robot.joint_count))
    assert held_tool(robot, readings) is None


@pytest.mark.parametrize(("spin", "count"), [(False, 120), (True, 120), (False, 40)])
def test_poses_with_one_orientation_calibrate_work_with_that_orientation(spin, count):
    arm = VirtualArm(Robot.load("ur10"), seed=5)
    calibration = ta.calibrate(arm.robot, arm.measure(held(count, 1, spin=spin)))
    measured = arm.measure(held(200, 2, spin=spin))
    held_out = calibration.validation.holdout[calibration.model_name].position.mean
    for keep_frames in (False, True):
        errors = ta.evaluate(calibration, measured, keep_frames=keep_frames).errors
        nominal, best = errors["nominal"].position.mean, errors[calibration.model_name].position.mean
        assert best < 0.2 * nominal
        assert best < 1.5 * held_out


def test_a_tool_that_was_held_is_told_with_the_way_out_and_in_the_report():
    arm = VirtualArm(Robot.load("ur10"), seed=5)
    calibration = ta.calibrate(arm.robot, arm.measure(held(90)), model="constant")
    notices = {notice.kind: str(notice) for notice in calibration.notices}
    assert "have the tool held one way, to within 0.01 deg" in notices["held_tool"]
    assert "the wrist turned by 30 deg and more" in notices["held_tool"]
    assert "6 of 9 unknowns of frame and target" in notices["open_setup"]
    assert notices["held_tool"] in {advice.words for advice in report(calibration).advice}


def test_poses_with_one_orientation_in_a_plane_are_refused():
    arm = VirtualArm(Robot.load("ur10"), seed=5)
    readings = held(60)
    readings[:, 0] = readings[:, 5] = 0.4
    with pytest.raises(ta.WorkError, match="the poses are too alike to determine the set-up"):
        ta.calibrate(arm.robot, arm.measure(readings))
