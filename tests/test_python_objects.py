"""What Python does with any object: printing, copying, and sending to another process."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from truearm.compensation import TOOLS_KEPT
from truearm.simulation import VirtualArm


@pytest.fixture(scope="module")
def robot():
    return ta.Robot.load("ur10")


@pytest.fixture(scope="module")
def data(robot):
    arm = VirtualArm(robot, seed=2)
    return arm.measure(arm.poses(60))


@pytest.fixture(scope="module")
def calibration(robot, data):
    return ta.calibrate(robot, data)


def sent(value):
    return pickle.loads(pickle.dumps(value))


@pytest.mark.parametrize("again", [sent, copy.copy, copy.deepcopy])
def test_robots_measurements_and_calibrations_come_back_whole(again, robot, data, calibration):
    robot.position(data.readings)
    assert again(robot) == robot
    same = again(data)
    assert same.hash() == data.hash()
    assert not same.readings.flags.writeable
    found = again(calibration)
    assert found.to_bytes() == calibration.to_bytes()
    assert np.array_equal(found.position_std(data.readings), calibration.position_std(data.readings))
    assert (found.notices, found.seconds, found.file) == (calibration.notices, calibration.seconds, None)


def test_a_calibration_that_was_read_keeps_its_file(calibration, tmp_path):
    calibration.save(tmp_path / "arm.calib")
    read = ta.Calibration.load(tmp_path / "arm.calib")
    assert sent(read).file == (tmp_path / "arm.calib").read_bytes()
    other = replace(read, file=b"as an older version wrote it")
    assert sent(other).file == b"as an older version wrote it"


def test_a_compensator_corrects_the_same_after_it_was_sent(calibration, data):
    limits = ta.Limits(largest_mm=20.0, largest_joint_deg=10.0, largest_std_mm=100.0)
    compensator = ta.Compensator(calibration, task="position", moving=[1, 2, 3], limits=limits)
    q = data.readings[:5]
    assert np.array_equal(sent(compensator).joints(q).q, compensator.joints(q).q, equal_nan=True)


def test_what_is_printed_is_short_and_says_what_it_is(robot, data, calibration):
    assert repr(robot) == "<Robot UR10: 6 joints, standard Denavit-Hartenberg>"
    assert repr(data) == '<Measurements: 60 rows, 6 joints, 1 target; "data">'
    mean = calibration.validation.holdout["variable"].position.mean
    words = f"<Calibration of UR10: variable, 6 joints, 60 rows, {mean:.3g} mm mean on held-out rows>"
    assert repr(calibration) == words


def test_a_compensator_keeps_the_correctors_of_few_tools(calibration):
    compensator = ta.Compensator(calibration)
    first = compensator.corrector([0.0, 0.0, 0.1])
    for k in range(3 * TOOLS_KEPT):
        compensator.corrector([0.0, 0.001 * k, 0.2])
        assert compensator.corrector([0.0, 0.0, 0.1]) is first
    assert len(compensator._correctors) == TOOLS_KEPT
