"""What cannot be true is said: rows that do not belong together, other robots, too few rows, wrong types."""

import re
from typing import Any

import numpy as np
import pytest

import truearm as ta
from truearm.simulation import VirtualArm


def notice_of(calibration, kind):
    return next((str(notice) for notice in calibration.notices if notice.kind == kind), "")


def test_points_of_other_rows_are_doubted():
    arm = VirtualArm.paper(seed=4)
    table = arm.measure_table(arm.poses(60))
    good = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")
    assert not notice_of(good, "no_help") + notice_of(good, "far_from_nominal")
    points = [name for name in table.columns if name[0] in "xyz"]
    table[points] = np.roll(table[points].to_numpy(), 1, axis=0)
    shifted = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")
    assert "row by row" in notice_of(shifted, "no_help")


def test_another_robot_is_doubted():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4)
    found = ta.calibrate(ta.Robot.load("ur5"), arm.measure(arm.poses(60)), model="constant")
    doubt = notice_of(found, "far_from_nominal")
    assert "a2 comes out" in doubt
    assert "another robot" in doubt


def test_too_few_rows_say_how_many_are_enough():
    arm = VirtualArm.paper(seed=4)
    few = arm.measure(arm.poses(3))
    with pytest.raises(ta.WorkError, match=r"Measure at least (\d+) poses: 30% are held out") as caught:
        ta.calibrate(arm.robot, few, model="constant")
    said = re.search(r"at least (\d+) poses", str(caught.value))
    assert said is not None
    enough = int(said[1])
    assert ta.calibrate(arm.robot, arm.measure(arm.poses(enough)), model="constant").validation.n_holdout > 0


def test_what_is_no_robot_and_no_measurements_is_said(tmp_path):
    arm = VirtualArm.paper(seed=4)
    data = arm.measure(arm.poses(40))
    cases: list[tuple[Any, Any, str]] = [
        ("ur10", data, "robot is of type str.*Robot.load"),
        (arm.robot, "data.csv", "measurements are of type str.*read_csv"),
        (arm.robot, arm.measure_table(arm.poses(5)), "of type DataFrame.*from_dataframe"),
        (arm.robot, [data, 3], "of type list"),
    ]
    for robot, given, words in cases:
        with pytest.raises(ta.UsageError, match=words):
            ta.calibrate(robot, given)
    wrong: list[dict[str, Any]] = [
        {"train_size": "50"},
        {"train_size": 50.5},
        {"holdout": "0.3"},
        {"seed": 1.5},
    ]
    for options in wrong:
        with pytest.raises(ta.UsageError, match=r"It must be a (whole )?number"):
            ta.calibrate(arm.robot, data, **options)
    found = ta.calibrate(arm.robot, data, model="constant")
    with pytest.raises(ta.InputError, match="this is a directory"):
        found.save(tmp_path)
    with pytest.raises(ta.InputError, match="one waypoint has"):
        ta.Compensator(found).correct(arm.poses(2))
