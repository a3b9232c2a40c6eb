"""What was given, or made, is not changed behind anyone's back, nor set to no effect."""

import numpy as np
import pytest

import truearm as ta
from truearm.planning import InBox, JointSpace, KeepOut
from truearm.proposing import Candidates
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
    return ta.calibrate(robot, data, model="constant")


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("calibration", None),
        ("programming", None),
        ("task", "position"),
        ("moving", (1, 2, 3)),
        ("limits", ta.Limits(largest_mm=0.01)),
        ("features", (22.0,)),
    ],
)
def test_what_a_compensator_was_made_of_cannot_be_set(name, other, calibration):
    compensator = ta.Compensator(calibration)
    with pytest.raises(AttributeError, match=name):
        setattr(compensator, name, other)


@pytest.mark.parametrize("name", ["ur10", "rv-m2"])
def test_joint_values_are_no_ones_readings(name):
    robot = ta.Robot.load(name)
    q = np.full((3, robot.joint_count), 0.2)
    for given in (q, q[0]):
        for convert in (robot.joints_from_readings, robot.readings_from_joints):
            convert(given)[:] += 1.0
    np.testing.assert_array_equal(q, 0.2)


def test_candidates_spaces_and_rules_keep_their_numbers(robot, calibration):
    q = np.full((2, 6), 0.2)
    candidates = Candidates(calibration, q)
    held, low, high = q[0], np.zeros(3), np.ones(3)
    space, box, kept = JointSpace(robot, low, high, held=held), InBox(low, high), KeepOut(low, high)
    for array in (q, low, high):
        array[:] = 5.0
    np.testing.assert_array_equal(candidates.readings, 0.2)
    assert not candidates.readings.flags.writeable
    np.testing.assert_array_equal(space.readings(np.zeros((1, 3)))[0][0, 3:], 0.2)
    np.testing.assert_array_equal([space.low, box.low, kept.low], 0.0)
    np.testing.assert_array_equal([space.high, box.high, kept.high], 1.0)
