"""Readings with few decimals, and arms that stood at round readings."""

import numpy as np
import pytest

import truearm as ta
from truearm.doubts.rounded_readings import rounded_notices
from truearm.simulation import VirtualArm

UR10 = ta.Robot.load("ur10")
QS = [f"q{joint}" for joint in range(1, 7)]


def measured(*, decimals, rounds):
    """Rows of an arm that shows its readings rounded, or that stood at such ones."""
    arm = VirtualArm(UR10, seed=3)
    poses = arm.poses(60, seed=1)
    table = arm.measure_table(poses if rounds else shown(poses, decimals), seed=1)
    table[QS] = shown(table[QS].to_numpy(), decimals)
    return ta.Measurements.from_dataframe(table)


def shown(readings, decimals):
    return np.radians(np.round(np.degrees(readings), decimals))


def told(data):
    calibration = ta.calibrate(UR10, data, model="constant", refit=False)
    return [str(notice) for notice in calibration.notices if notice.kind == "rounded_readings"]


def test_rounding_that_makes_the_noise_is_told_with_what_it_leaves():
    (words,) = told(measured(decimals=1, rounds=True))
    assert "All readings are multiples of 0.1 deg" in words
    assert "about 0.3" in words


@pytest.mark.parametrize(("decimals", "rounds"), [(1, False), (2, True), (9, True)])
def test_rounding_that_does_not_is_not_told(decimals, rounds):
    assert told(measured(decimals=decimals, rounds=rounds)) == []


def test_what_rounding_leaves_is_what_it_does():
    """One joint at a lever of a metre: a thousandth of a radian, rounded, is 0.29 mm across."""
    arm = ta.Robot.from_table("One", [[0.0, 0.0, 1.0, 0.0]])
    readings = np.round(np.random.default_rng(0).uniform(-3.0, 3.0, (400, 1)), 3)
    across = 1.0 / np.sqrt(12.0) / np.sqrt(3.0)
    (notice,) = rounded_notices(arm, readings, across)
    assert "multiples of 0.001 rad" in notice.message
    assert f"about {across:.2f} mm" in notice.message
    assert rounded_notices(arm, readings, 3.0 * across) == []
    assert rounded_notices(arm, readings + 0.1 * readings**2, across) == []
    assert rounded_notices(arm, np.zeros((4, 1)), across) == []
