"""Loads whose centre of gravity is off the last axis bend an arm that gives way, and the field follows."""

import numpy as np
import pytest

import truearm as ta
from truearm.simulation import Conditions, Deflection, Imperfections, VirtualArm

COMPLIANCE = (1e-5,) * 6
LOADS_KG = (0.0, 12.0)
NEW_KG = 8.0


@pytest.mark.parametrize("beside_m", [(0.1, 0.0, 0.1), (0.0, -0.12, 0.05)])
def test_a_payload_beside_the_last_axis_is_no_noise(beside_m):
    robot = ta.Robot.load("ur10")
    weak = Deflection(COMPLIANCE, payload_at_m=beside_m)
    arm = VirtualArm(robot, seed=3, imperfections=Imperfections(deflection=weak, noise_mm=0.03, share=0.0))
    poses = arm.poses(150)
    carried = np.resize(LOADS_KG, len(poses))
    data = ta.Measurements.from_dataframe(
        arm.measure_table(poses, conditions=Conditions(payload_kg=carried)), joints=robot.joints
    )
    calibration = ta.calibrate(robot, data, features=("payload_kg",), use="position", refit=False)
    fresh = arm.poses(200, seed=9)
    group, target = calibration.groups[0], np.eye(4)
    target[:3, 3] = arm.target_in_flange
    for payload_kg in (*LOADS_KG, NEW_KG):
        met = Conditions(payload_kg=payload_kg)
        truth = (arm.world_from_base @ arm.true_pose(fresh, tool=target, conditions=met))[:, :3, 3]
        carries = {"payload_kg": payload_kg}
        found = calibration.position(fresh, group=group, target=1, features=carries)
        off_mm = 1e3 * (found - truth)
        assert np.linalg.norm(off_mm, axis=1).mean() < 0.035
        std_mm = 1e3 * calibration.position_std(fresh, group=group, target=1, features=carries)
        assert (np.abs(off_mm) < 1.96 * std_mm).mean() > 0.9
