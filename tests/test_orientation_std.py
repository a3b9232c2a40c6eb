"""What is known of the orientation of a measured target."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from truearm.fits.endpoints import at_target
from truearm.simulation import VirtualArm


@pytest.fixture(scope="module")
def posed():
    """An arm, and what is known of it from poses with orientation."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1)
    table = arm.measure_table(arm.poses(60), orientation=True)
    return arm, ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table))


def test_the_target_takes_over_how_the_flange_is_turned(posed):
    arm, calibration = posed
    q, group = arm.poses(300, seed=7), calibration.groups[0]
    end = at_target(calibration, None, group, 1).flange_from_end
    as_target = calibration.pose_std(q, group=group, target=1)
    as_tool = calibration.pose_std(q, group=group, tool=end)
    np.testing.assert_allclose(as_target[:, :3], as_tool[:, :3], rtol=1e-9)
    assert (as_target[:, 3:].mean(axis=0) < as_tool[:, 3:].mean(axis=0)).all()
    mounted = np.eye(4)
    mounted[:3, 3] = arm.target_in_flange
    true = arm.world_from_base @ arm.true_pose(q, tool=mounted)
    told = calibration.pose(q, group=group, target=1)
    off = Rotation.from_matrix(told[:, :3, :3] @ np.swapaxes(true[:, :3, :3], 1, 2)).as_rotvec()
    assert (np.abs(off) <= 1.96 * as_target[:, 3:]).mean() >= 0.93
    assert np.sqrt(np.square(off / as_target[:, 3:]).mean()) > 0.4


def test_motions_are_those_of_the_end(posed):
    arm, calibration = posed
    flanges = calibration.pose(arm.poses(4), tool=np.eye(4))
    end = at_target(calibration, None, calibration.groups[0], 1)
    found, step = end.motions(flanges, pose=True), 1e-6

    def moved(number, by):
        """The end where base, tool or the target's turn is moved a little."""
        base, tool, turn = np.eye(4), np.eye(4), np.eye(4)
        part = (base, base, tool, turn)[number // 3]
        if number // 3 in (0, 2):
            part[number % 3, 3] = by
        else:
            part[:3, :3] = Rotation.from_rotvec(by * np.eye(3)[number % 3]).as_matrix()
        return base @ flanges @ tool @ end.flange_from_end @ turn

    for number in range(12):
        after, before = moved(number, step), moved(number, -step)
        shift = (after[:, :3, 3] - before[:, :3, 3]) / (2.0 * step)
        turned = after[:, :3, :3] @ np.swapaxes(before[:, :3, :3], 1, 2)
        turn = Rotation.from_matrix(turned).as_rotvec() / (2.0 * step)
        np.testing.assert_allclose(np.hstack([shift, turn]), found[:, :, number], atol=1e-8)
