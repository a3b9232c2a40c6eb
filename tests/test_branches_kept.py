"""Inverse kinematics from a seed stays on the seed's branch, also where an arm could turn over twice."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from truearm.inverse import Inverse
from truearm.simulation import VirtualArm

SEED = np.array([0.3, -1.4, 1.8, -1.9, -1.5, 0.2])
BRANCH = (11, "the solution lies on another branch of the arm than its seed")
LIMITS = ta.Limits(largest_mm=20.0, largest_std_mm=100.0)


@pytest.fixture(scope="module")
def calibration():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=2)
    return ta.calibrate(arm.robot, arm.measure(arm.poses(40)), model="constant")


@pytest.fixture(scope="module")
def targets():
    """Poses (n, 4, 4) in front of the arm, pointing down, far from the seed."""
    rng = np.random.default_rng(1)
    turns = np.stack([np.full(150, 180.0), np.zeros(150), rng.uniform(-90.0, 90.0, 150)], axis=1)
    poses = np.tile(np.eye(4), (150, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("xyz", turns, degrees=True).as_matrix()
    poses[:, :3, 3] = rng.uniform([0.4, -0.5, 0.3], [0.8, 0.5, 0.6], (150, 3))
    return poses


def test_targets_far_from_the_seed_are_solved_on_its_branch_or_refused(calibration, targets):
    inverse = Inverse(calibration.robot)
    (wanted,) = inverse.branch_names(SEED[None])
    found = ta.Compensator(calibration, limits=LIMITS).poses(targets, np.tile(SEED, (len(targets), 1)))
    solved = np.isfinite(found.nominal).all(axis=1)
    assert solved.sum() > 20
    assert set(inverse.branch_names(found.nominal[solved])) == {wanted}
    strays = [refusal.number for refusal in found.refusals if (refusal.code, refusal.reason) == BRANCH]
    assert len(strays) > 10
    with pytest.raises(ta.WorkError, match=r"cannot be reached: .*another branch.*Inverse\(robot\) finds"):
        calibration.solve(targets[np.array(strays) - 1], np.tile(SEED, (len(strays), 1)))


def test_readings_beside_their_seeds_are_found_beside_singularities_too(calibration):
    rng = np.random.default_rng(3)
    readings = rng.uniform(-2.0, 2.0, (200, 6))
    readings[::2, 4] = 0.02 * rng.choice([-1.0, 1.0], 100)
    poses = calibration.pose(readings)
    found = calibration.solve(poses, readings + 1e-3)
    np.testing.assert_allclose(calibration.pose(found), poses, atol=1e-6)


def test_a_task_that_leaves_the_arm_free_has_no_branch(calibration, targets):
    found = calibration.solve(targets[:5], SEED, task="position")
    np.testing.assert_allclose(calibration.position(found), targets[:5, :3, 3], atol=1e-6)
