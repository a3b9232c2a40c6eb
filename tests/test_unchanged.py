"""What was given, or made, is not changed behind anyone's back, nor set to no effect."""

import pytest

import truearm as ta
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
