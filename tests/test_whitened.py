"""What a fit has taken of its rows, where these leave frame and target open."""

import numpy as np
import pytest

import truearm as ta
from tests.xyzc import xyzc
from truearm.doubts.at_once import STEP_KINDS
from truearm.doubts.whitened import Whitened
from truearm.simulation import VirtualArm

ROWS = 60


def scara(_):
    return ta.Robot.load("adept-cobra-600")


def held(_):
    return ta.Robot.load("ur10")


def poses_of(arm, seed):
    """Those of an arm, of one with a wrist those that hold the tool vertical."""
    readings = arm.poses(ROWS, seed=seed)
    if arm.robot.joint_count == 6:
        readings[:, 3] = -np.pi / 2 - readings[:, 1] - readings[:, 2]
        readings[:, 4] = -np.pi / 2
    return readings


@pytest.mark.parametrize("robot", [scara, xyzc, held])
def test_no_more_is_taken_of_rows_than_there_is_of_them(robot, tmp_path):
    """Where rows leave frame and target open, the posterior is as wide as its prior."""
    arm = VirtualArm(robot(tmp_path), seed=1)
    found = ta.calibrate(arm.robot, arm.measure(poses_of(arm, 1)), refit=False, holdout=0.1)
    assert found.rows is not None
    seen = Whitened.of(found, found.rows, np.linspace(0.0, 1.0, len(found.rows.weight)))
    assert seen is not None
    assert np.linalg.eigvalsh(seen.taken).max() < 1.0 + 1e-6
    assert not set(STEP_KINDS) & {notice.kind for notice in found.notices}
