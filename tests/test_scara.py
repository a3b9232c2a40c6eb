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


def test_distances_between_poses_say_nothing_of_a_scara_s_target_along_its_axes():
    """The target stays near the flange there, and what the poses determine is found."""
    for seed in range(2):
        arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=seed)
        table = arm.measure_table(arm.poses(200))
        points = table[["x", "y", "z"]].to_numpy()
        table["pair"] = [f"p{k // 2}" for k in range(200)]
        table["distance"] = np.repeat(np.linalg.norm(points[::2] - points[1::2], axis=1), 2)
        data = ta.Measurements.from_dataframe(table.drop(columns=["x", "y", "z"]), joints=arm.robot.joints)
        found = ta.calibrate(arm.robot, data, model="constant", refit=False)
        assert {"theta2", "a1", "a2"} <= set(found.identifiability.determined)
        for model in found.models.values():
            assert np.abs(model.setup.targets).max() < 0.3
        errors = found.validation.holdout
        assert errors["constant"].position.mean < 0.3 * errors["nominal"].position.mean


def test_nothing_is_said_of_how_an_arm_stands_whose_axes_all_stand_upright():
    arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=0)
    data = arm.measure(arm.poses(90, seed=0), seed=0)
    calibration = ta.calibrate(arm.robot, data)
    assert calibration.variable is not None
    assert calibration.variable.hyper["up"] == [0.0, 0.0, 1.0]
    assert "mounting" not in {notice.kind for notice in calibration.notices}
