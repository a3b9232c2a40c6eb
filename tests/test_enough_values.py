"""Shots of a pose are measured values of one: what they leave open is refused."""

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm.fits.core_set import select
from truearm.fits.enough_values import measured_values
from truearm.fits.fitting import Task
from truearm.fits.identified import IdentifiedArm
from truearm.simulation import VirtualArm

UR10 = ta.Robot.load("ur10")
SHOTS = 10


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(UR10, seed=5)


def shots(arm, poses):
    return arm.measure(np.repeat(arm.poses(poses, seed=1), SHOTS, axis=0), seed=1)


def test_shots_of_too_few_poses_are_refused_with_the_poses_that_are_needed(arm):
    words = r"15 measured values in 5 training poses \(50 rows\) .* Measure at least \d+ poses: 30% are held"
    with pytest.raises(ta.WorkError, match=words) as refused:
        ta.calibrate(UR10, shots(arm, 6), model="constant")
    needed = int(str(refused.value).split("Measure at least ")[1].split()[0])
    assert ta.calibrate(UR10, shots(arm, needed), model="constant").validation.n_holdout_poses > 1
    with pytest.raises(ta.WorkError, match="training poses"):
        ta.calibrate(UR10, shots(arm, needed - 6), model="constant")


def counted(data):
    arm = IdentifiedArm(UR10, "free", 5.0)
    return measured_values(Task(arm, select(data, None), data.groups, ta.CalibrationOptions()), data)


def test_values_of_a_pose_count_once_whatever_was_measured(arm):
    q = np.repeat(arm.poses(4), SHOTS, axis=0)
    assert counted(arm.measure(q)) == 4 * 3
    assert counted(arm.measure(q, orientation=True)) == 4 * 6
    table = pd.DataFrame(q, columns=[f"q{k}" for k in range(1, 7)]).assign(distance=1.0)
    wires = table.assign(anchor=np.tile(["one", "two"], len(q) // 2))
    assert counted(ta.Measurements.from_dataframe(wires)) == 4 * 2
    bars = table.assign(pair=np.tile(np.arange(len(q) // 2), 2))
    assert counted(ta.Measurements.from_dataframe(bars)) == 2
