"""SCARAs, whose parallel axes leave frame and target hard to tell apart."""

import numpy as np
from scipy.spatial.transform import Rotation

import truearm as ta
from truearm.simulation import VirtualArm


def test_a_scara_s_open_set_up_is_noticed():
    arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=2)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), model="constant")
    assert [notice.kind for notice in calibration.notices] == ["open_setup"]


def rigidly_off(points, others):
    """Mean distance of points (n, 3) from others after the best motion onto them (Kabsch 1976)."""
    here, there = points - points.mean(axis=0), others - others.mean(axis=0)
    turn, _ = Rotation.align_vectors(there, here)
    return np.linalg.norm(turn.apply(here) - there, axis=1).mean()


def test_a_scara_s_target_stays_near_its_flange_and_the_flange_is_known_better():
    nominal, calibrated = [], []
    for seed in range(3):
        arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=seed)
        found = ta.calibrate(arm.robot, arm.measure(arm.poses(120)), refit=False)
        assert np.abs(found.model.setup.targets).max() < 0.2
        q = arm.poses(200, seed=9)
        true = arm.true_pose(q, tool=np.eye(4))[:, :3, 3]
        nominal.append(rigidly_off(arm.robot.pose(q)[:, :3, 3], true))
        calibrated.append(rigidly_off(found.position(q, tool=np.zeros(3)), true))
    assert np.mean(calibrated) < 0.7 * np.mean(nominal)
