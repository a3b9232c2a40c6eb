"""Inverse kinematics from a seed stays on the seed's branch, where it is on one, and finds what is there."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from truearm._core import Solver
from truearm.branches import crossed
from truearm.inverse import Inverse
from truearm.limits import Limits
from truearm.searching import Search
from truearm.simulation import VirtualArm
from truearm.solving import core_options, plain_model

SEED = np.array([0.3, -1.4, 1.8, -1.9, -1.5, 0.2])
BRANCH = (11, "the solution lies on another branch of the arm than its seed")
LIMITS = ta.Limits(largest_mm=20.0, largest_std_mm=100.0)
BENT = np.array([0.3, -1.2, 1.5, 0.4, 0.9, 0.2])
"""Well within a branch of a KR 6."""


@cache
def calibrated(name):
    arm = VirtualArm(ta.Robot.load(name), seed=2)
    return ta.calibrate(arm.robot, arm.measure(arm.poses(40)), model="constant")


@pytest.fixture(scope="module")
def calibration():
    return calibrated("ur10")


@pytest.fixture(scope="module")
def targets():
    """Poses (n, 4, 4) in front of the arm, pointing down, far from the seed."""
    rng = np.random.default_rng(1)
    turns = np.stack([np.full(150, 180.0), np.zeros(150), rng.uniform(-90.0, 90.0, 150)], axis=1)
    poses = np.tile(np.eye(4), (150, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("xyz", turns, degrees=True).as_matrix()
    poses[:, :3, 3] = rng.uniform([0.4, -0.5, 0.3], [0.8, 0.5, 0.6], (150, 3))
    return poses


def at_singularity(robot, q, joint):
    """Readings q (N,) with one joint turned to where the arm changes a side."""
    inverse, low, high = Inverse(robot), q.copy(), q.copy()
    turns = q + np.linspace(0.0, -2.0, 400)[:, None] * np.eye(6)[joint]
    sides = inverse.sides(turns)
    (first,) = np.nonzero((sides[1:] != sides[:-1]).any(axis=1))[0][:1]
    low, high = turns[first : first + 2]
    for _ in range(60):
        middle = 0.5 * (low + high)
        same = (inverse.sides(middle[None]) == sides[first]).all()
        low, high = (middle, high) if same else (low, middle)
    return middle


def solved_one_by_one(calibration, poses, seed):
    """Readings (n, N), NaN where refused."""
    found = np.full((len(poses), len(seed)), np.nan)
    for row, pose in enumerate(poses):
        try:
            found[row] = calibration.solve(pose, seed)
        except ta.WorkError:
            continue
    return found


def test_targets_far_from_the_seed_are_solved_on_its_branch_and_turn(calibration, targets):
    inverse, seeds = Inverse(calibration.robot), np.tile(SEED, (len(targets), 1))
    seeds[:, 5] += 2.0 * np.pi
    (wanted,) = inverse.branch_names(SEED[None])
    found = ta.Compensator(calibration, limits=LIMITS).poses(targets, seeds).nominal
    assert np.isfinite(found).all()
    readings = calibration.solve(targets, seeds)
    assert set(inverse.branch_names(np.concatenate([found, readings]))) == {wanted}
    assert (readings[:, 5] > 0.0).all()
    np.testing.assert_allclose(calibration.pose(readings), targets, atol=1e-9)


def test_targets_that_the_branch_of_the_seed_does_not_reach_are_refused():
    calibration = calibrated("kuka-kr-6-r900")
    robot, inverse = calibration.robot, Inverse(calibration.robot)
    poses = robot.pose(VirtualArm(robot).poses(400, seed=3))
    (wanted,) = inverse.branch_names(BENT[None])
    solutions = [rows[np.isfinite(rows).all(axis=1)] for rows in inverse.branches(poses)]
    lacking = np.array([wanted not in inverse.branch_names(rows) for rows in solutions])
    assert 20 < lacking.sum() < 200
    found = ta.Compensator(calibration, limits=LIMITS).poses(poses, np.tile(BENT, (len(poses), 1)))
    np.testing.assert_array_equal(np.isfinite(found.nominal).all(axis=1), ~lacking)
    strays = [
        each.number
        for each in found.refusals
        if (each.code, each.reason) == BRANCH and lacking[each.number - 1]
    ]
    assert strays
    with pytest.raises(ta.WorkError, match=r"cannot be reached: .*another branch.*Inverse\(robot\) finds"):
        calibration.solve(poses[strays[0] - 1], BENT)


@pytest.mark.parametrize("joint", [1, 2, 4])
def test_from_a_singularity_the_arm_may_go_to_either_side(joint):
    calibration = calibrated("kuka-kr-6-r900")
    seed = at_singularity(calibration.robot, BENT, joint)
    rng = np.random.default_rng(4)
    readings = seed + rng.uniform(-0.1, 0.1, (40, 6))
    readings[:, joint] = seed[joint] + rng.choice([-1.0, 1.0], 40) * rng.uniform(0.05, 0.15, 40)
    poses, seeds = calibration.pose(readings), np.tile(seed, (40, 1))
    found = calibration.solve(poses, seeds)
    np.testing.assert_allclose(calibration.pose(found), poses, atol=1e-6)
    assert not crossed(Inverse(calibration.robot), found, seeds).any()


def test_a_seed_at_zero_tells_elbow_and_shoulder_though_not_the_wrist():
    calibration = calibrated("kuka-kr-6-r900")
    seed, inverse = np.zeros(6), Inverse(calibration.robot)
    readings = seed + np.random.default_rng(1).uniform(-0.15, 0.15, (80, 6))
    found = solved_one_by_one(calibration, calibration.pose(readings), seed)
    there, within = np.isfinite(found).all(axis=1), ~crossed(inverse, readings, np.tile(seed, (80, 1)))
    assert there[within].mean() > 0.95
    assert not crossed(inverse, found[there], np.tile(seed, (there.sum(), 1))).any()


@pytest.mark.parametrize("bent", [0.5, -0.5])
def test_a_path_from_the_zero_position_is_followed(bent):
    compensator = ta.Compensator(calibrated("kuka-kr-6-r900"), limits=LIMITS)
    path = np.linspace(0.02, 1.0, 25)[:, None] * np.array([0.2, -0.1, -0.1, 0.1, bent, 0.2])
    found = compensator.poses(compensator.programming.pose(path), np.zeros(6))
    np.testing.assert_allclose(found.nominal, path, atol=1e-6)


def test_a_path_through_a_singularity_is_refused_behind_it_and_does_not_swing_round():
    compensator = ta.Compensator(calibrated("kuka-kr-6-r900"), limits=LIMITS)
    path = np.tile(BENT, (20, 1))
    path[:, 4] = np.linspace(0.2, -0.2, 20)
    found = compensator.poses(compensator.programming.pose(path), path[0])
    assert [refusal.code for refusal in found.refusals if refusal.number > 10] == [11] * 10
    np.testing.assert_allclose(found.nominal[:10], path[:10], atol=1e-6)


def test_an_arm_without_named_branches_goes_to_either_side_too():
    kuka = ta.Robot.load("kuka-kr-6-r900")
    table, turned = kuka.table.copy(), kuka.table.copy()
    table[4, 2] = turned[4, 2] = 0.06
    turned[4, 0] = 1e-3
    robot, real = dataclasses.replace(kuka, table=table), dataclasses.replace(kuka, table=turned)
    assert Inverse(robot).method == "numeric"
    seed = at_singularity(robot, BENT, 4)
    readings = seed + np.random.default_rng(2).uniform(-0.1, 0.1, (40, 6))
    solver = Solver(plain_model(real), robot.tool, core_options(robot, "pose", None, Limits()))
    search = Search(robot, solver, "pose", robot.tool, [])
    found, refused = search.near(real.pose(readings), np.tile(seed, (40, 1)))
    assert not refused
    np.testing.assert_allclose(real.pose(found), real.pose(readings), atol=1e-6)


def test_from_a_stretched_elbow_poses_are_found_that_the_nominal_arm_does_not_reach():
    robot = ta.Robot.load("ur10")
    table, rng = robot.table.copy(), np.random.default_rng(5)
    table[1:3, 2] *= 1.0 + 1e-3
    table[2, 0] += 1e-3
    real = dataclasses.replace(robot, table=table)
    readings = np.array([0.3, -1.2, 0.0, -0.5, 0.9, 0.2]) + rng.uniform(-0.05, 0.05, (20, 6))
    readings[:, 2] = rng.choice([-1.0, 1.0], 20) * rng.uniform(0.02, 0.08, 20)
    poses, seeds = real.pose(readings), readings * (np.arange(6) != 2)
    assert not np.isfinite(Inverse(robot).branches(poses @ np.linalg.inv(robot.tool))).any()
    solver = Solver(plain_model(real), robot.tool, core_options(robot, "pose", None, Limits()))
    search = Search(robot, solver, "pose", robot.tool, [])
    paths = [search.near(poses[k : k + 1], seeds[k])[0] for k in range(20)]
    for found in (search.near(poses, seeds)[0], np.concatenate(paths)):
        np.testing.assert_allclose(real.pose(found), poses, atol=1e-8)


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
