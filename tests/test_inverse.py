"""All inverse kinematics of the library's arms, of factory-calibrated arms and of arms nobody knows."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from truearm import Robot
from truearm.description.library import library_names
from truearm.errors import InputError, WorkError
from truearm.inverse import Inverse

SPHERICAL = {
    "abb-irb-120",
    "abb-irb-1200",
    "fanuc-lr-mate-200id",
    "kuka-kr-6-r900",
    "mitsubishi-rv-4fl",
    "puma-560",
    "staubli-tx2-90l",
}
PARALLEL = {name for name in library_names() if name.startswith("ur")}
REDUNDANT = {"franka-panda", "kuka-iiwa-14", "kuka-iiwa-7"}
SOLVERS = {name: Inverse(Robot.load(name)) for name in library_names()}
FULL_CIRCLE = np.tile([-np.pi, np.pi], (6, 1))


def random_readings(robot, count, seed=0):
    low, high = robot.limits.T
    low, high = np.maximum(low, -np.pi), np.minimum(high, np.pi)
    return np.random.default_rng(seed).uniform(low, high, (count, robot.joint_count))


def poses_of(robot, q):
    return robot.flange_chain.pose(np.ascontiguousarray(np.atleast_2d(robot.joints_from_readings(q))))


def without_limits(robot):
    return Robot.from_dict({**robot.to_dict(), "limits": FULL_CIRCLE.tolist()})


def bent(robot, seed=0, size=1e-3):
    """The same arm as its maker's factory might have measured it: no axis square or parallel any more."""
    rng = np.random.default_rng(seed)
    return Robot.from_dict(
        {**robot.to_dict(), "table": (robot.table + rng.uniform(-size, size, robot.table.shape)).tolist()}
    )


def is_among(q, solutions):
    apart = (solutions - q + np.pi) % (2.0 * np.pi) - np.pi
    return bool((np.abs(apart).max(axis=1) < 1e-6).any())


@pytest.mark.parametrize("name", library_names())
def test_solutions_reach_the_pose_within_limits(name):
    solver = SOLVERS[name]
    robot = solver.robot
    for q, pose in zip(random_readings(robot, 12), poses_of(robot, random_readings(robot, 12)), strict=True):
        found = solver.solutions(pose)
        assert len(found)
        assert np.abs(poses_of(robot, found) - pose).max() < 1e-9
        low, high = robot.limits.T
        assert (found > low - 1e-8).all()
        assert (found < high + 1e-8).all()
        if name not in REDUNDANT:
            assert is_among(q, found)


@pytest.mark.parametrize("name", library_names())
def test_near_gives_the_seed_back_at_its_own_pose(name):
    solver = SOLVERS[name]
    q = random_readings(solver.robot, 50, seed=1)
    assert np.abs(solver.near(poses_of(solver.robot, q), q) - q).max() < 1e-7


@pytest.mark.parametrize("name", library_names())
def test_near_a_seed_nearby_reaches_the_pose_nearby(name):
    solver = SOLVERS[name]
    robot = solver.robot
    q = random_readings(robot, 50, seed=2)
    middle = 0.5 * (np.maximum(robot.limits[:, 0], -np.pi) + np.minimum(robot.limits[:, 1], np.pi))
    seeds = q + 0.02 * (middle - q)
    found = solver.near(poses_of(robot, q), seeds)
    assert np.abs(poses_of(robot, found) - poses_of(robot, q)).max() < 1e-9
    # Where infinitely many readings reach a pose, Newton's steps lead to nearly the nearest.
    more = 2.0 if name in REDUNDANT else 1.0
    assert (np.linalg.norm(found - seeds, axis=1) <= more * np.linalg.norm(q - seeds, axis=1) + 1e-9).all()


def test_methods_are_those_of_the_shapes():
    for name, solver in SOLVERS.items():
        expected = "spherical wrist" if name in SPHERICAL else "numeric"
        assert solver.method == ("three parallel axes" if name in PARALLEL else expected), name


@given(seed=st.integers(0, 10_000), name=st.sampled_from(sorted(SPHERICAL | PARALLEL)))
def test_there_are_up_to_eight_branches_each_with_a_name_of_its_own(seed, name):
    robot = without_limits(SOLVERS[name].robot)
    solver = Inverse(robot)
    pose = poses_of(robot, random_readings(robot, 1, seed))[0]
    found = solver.solutions(pose)
    names = solver.branch_names(found)
    assert len(found) in {2, 4, 6, 8}
    assert len(set(names)) == len(found)
    # A wrist that can be turned over, or for three parallel axes an elbow, can wherever the pose is.
    pair = {"spherical wrist": 2, "three parallel axes": 1}[solver.method]
    halves = {tuple(name.split()[:pair] + name.split()[pair + 1 :]) for name in names}
    assert len(halves) == len(found) // 2


@given(seed=st.integers(0, 10_000), name=st.sampled_from(sorted(SPHERICAL | PARALLEL)))
def test_a_factory_calibrated_arm_has_all_branches_too(seed, name):
    plain = without_limits(SOLVERS[name].robot)
    robot = bent(plain, seed)
    q = random_readings(robot, 1, seed)[0]
    pose = poses_of(robot, q)[0]
    solver = Inverse(robot)
    found = solver.solutions(pose)
    assert solver.method != "numeric"
    assert np.abs(poses_of(robot, found) - pose).max() < 1e-9
    assert is_among(q, found)


@pytest.mark.parametrize("name", ["abb-irb-120", "fanuc-lr-mate-200id"])
def test_a_nearly_straight_wrist_of_a_calibrated_arm_keeps_its_solutions(name):
    robot = bent(without_limits(SOLVERS[name].robot))
    q = random_readings(robot, 100)
    q[:, 4] = np.deg2rad(0.4) * np.sign(q[:, 4])
    branches = Inverse(robot).branches(poses_of(robot, q))
    missing = sum(not is_among(*pair) for pair in zip(q, branches, strict=True))
    assert missing <= 2


@given(seed=st.integers(0, 10_000))
def test_branch_names_do_not_change_with_the_turns(seed):
    solver = SOLVERS["ur10"]
    q = random_readings(solver.robot, 1, seed)
    turned = q + 2.0 * np.pi * np.random.default_rng(seed).integers(-1, 2, q.shape)
    assert solver.branch_names(q) == solver.branch_names(turned)


def test_branch_names_say_where_shoulder_elbow_and_wrist_are():
    solver = SOLVERS["kuka-kr-6-r900"]
    home = np.radians([0.0, -90.0, 90.0, 0.0, 30.0, 0.0])
    over_the_back = np.radians([0.0, -140.0, -30.0, 0.0, 30.0, 0.0])
    names = solver.branch_names([home, over_the_back, home * [1, 1, 1, 1, -1, 1]])
    assert names[0].startswith("front up")
    assert names[1].startswith("rear")
    assert {names[0].split()[2], names[2].split()[2]} == {"flip", "noflip"}


def test_arms_without_such_sides_have_no_names():
    assert SOLVERS["franka-panda"].branch_names(np.zeros((1, 7))) == [""]
    assert len(SOLVERS["rv-m2"].branch_names(np.zeros((1, 5)))[0].split()) == 2


def test_many_poses_are_solved_as_some():
    solver = SOLVERS["ur10"]
    q = random_readings(solver.robot, 600, seed=4)
    poses, seeds = poses_of(solver.robot, q), q + 0.01
    parts = [
        solver.near(p, s)
        for p, s in zip(np.split(poses, [100, 400]), np.split(seeds, [100, 400]), strict=True)
    ]
    np.testing.assert_array_equal(solver.near(poses, seeds), np.concatenate(parts))
    found = solver.branches(poses)
    for k in (0, 255, 256, 599):
        own = found[k][np.isfinite(found[k]).all(axis=1)]
        np.testing.assert_array_equal(own, solver.solutions(poses[k]))


@pytest.mark.parametrize("limit", [125.0, 1e300])
def test_turns_beyond_counting_are_refused(limit):
    robot = replace(Robot.load("ur10"), limits=np.tile([-limit, limit], (6, 1)))
    with pytest.raises(WorkError, match="differ by whole turns, at the most 100000 are listed"):
        Inverse(robot).solutions(robot.pose(np.full(6, 0.3)), turns=True)


def test_turns_are_all_whole_turns_within_limits():
    solver = SOLVERS["ur5"]
    q = np.array([0.3, -1.2, 1.5, -0.8, 1.1, 0.4])
    found = solver.solutions(poses_of(solver.robot, q)[0], turns=True)
    own = found[[is_among(row, q[None]) for row in found]]
    assert len(own) == 2**6
    assert len(np.unique(np.round(found, 9), axis=0)) == len(found)
    assert len(found) == 8 * 2**6


def test_near_takes_the_turn_of_the_seed():
    solver = SOLVERS["ur5"]
    q = np.array([3.5, -4.2, 4.5, -3.8, 5.1, -6.0])
    assert np.abs(solver.near(poses_of(solver.robot, q)[0], q) - q).max() < 1e-9


def test_fanuc_readings_turn_as_readings_and_not_as_joint_values():
    solver = SOLVERS["fanuc-lr-mate-200id"]
    robot = solver.robot
    q = np.radians([10.0, 40.0, 200.0, 20.0, 50.0, 100.0])
    assert np.abs(solver.near(poses_of(robot, q)[0], q) - q).max() < 1e-9


def test_branches_of_many_poses_are_those_of_each():
    solver = SOLVERS["abb-irb-120"]
    poses = poses_of(solver.robot, random_readings(solver.robot, 20))
    found = solver.branches(poses)
    for rows, pose in zip(found, poses, strict=True):
        one = solver.solutions(pose)
        assert np.array_equal(rows[: len(one)], one)
        assert np.isnan(rows[len(one) :]).all()
    assert solver.branches(np.empty((0, 4, 4))).shape == (0, 0, 6)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_solutions_are_those_of_one_pose(count):
    with pytest.raises(InputError, match=rf"shape \({count}, 4, 4\).*branches\(\) and near\(\)"):
        SOLVERS["ur5"].solutions(np.tile(np.eye(4), (count, 1, 1)))


def test_a_wrist_in_line_keeps_the_seed():
    for name in ("kuka-kr-6-r900", "ur10"):
        solver = SOLVERS[name]
        q = np.array([0.3, -1.2, 1.1, 0.7, 0.0, -0.4])
        assert np.abs(solver.near(poses_of(solver.robot, q)[0], q) - q).max() < 1e-6


def test_a_five_axis_arm_reaches_the_rounded_numbers_of_a_program():
    solver = SOLVERS["rv-m2"]
    q = random_readings(solver.robot, 20, seed=4)
    poses = poses_of(solver.robot, q)
    angle = np.radians(0.01)
    tilt = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    poses[:, :3, :3] = tilt @ poses[:, :3, :3]
    found = solver.near(poses, q)
    reached = poses_of(solver.robot, found)
    assert np.abs(reached[:, :3, 3] - poses[:, :3, 3]).max() < 1e-6
    assert np.abs(reached - poses).max() < angle


def test_an_arm_with_an_offset_wrist_is_solved_from_many_starts():
    plain = Robot.load("kuka-kr-6-r900")
    table = plain.table.copy()
    table[4, 2] = 0.06
    robot = Robot.from_dict({**plain.to_dict(), "table": table.tolist()})
    solver = Inverse(robot)
    q = random_readings(robot, 10)
    assert solver.method == "numeric"
    for one, pose in zip(q, poses_of(robot, q), strict=True):
        found = solver.solutions(pose)
        assert np.abs(poses_of(robot, found) - pose).max() < 1e-9
        assert is_among(one, found)


def test_what_is_out_of_reach_is_said_by_number():
    solver = SOLVERS["ur5"]
    poses = poses_of(solver.robot, np.zeros((3, 6)))
    poses[1, 0, 3] = 5.0
    assert len(solver.solutions(poses[1])) == 0
    with pytest.raises(WorkError, match="does not reach pose 2 within its limits"):
        solver.near(poses, np.zeros(6))
    assert np.isnan(solver.near_or_nan(poses, np.zeros(6))).all(axis=1).tolist() == [False, True, False]


@pytest.mark.parametrize(
    ("pose", "seed", "message"),
    [
        (np.eye(3), np.zeros(6), r"shape \(3, 3\)"),
        (2.0 * np.eye(4), np.zeros(6), "not rigid in row 0"),
        (np.full((4, 4), np.nan), np.zeros(6), "NaN"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), np.zeros(6), "R mirrors"),
        (np.eye(4), np.zeros(5), r"\(n, 6\)"),
        (np.eye(4), np.full(6, np.nan), "seeds hold NaN"),
        (np.tile(np.eye(4), (2, 1, 1)), np.zeros((3, 6)), "3 seeds for 2 poses"),
    ],
)
def test_bad_poses_and_seeds_are_refused(pose, seed, message):
    with pytest.raises(InputError, match=message):
        SOLVERS["ur5"].near(pose, seed)


STRETCHED = {"staubli-tx2-90l": 0.0, "abb-irb-120": -np.arctan2(0.302, 0.07)}
"""Joint 3 where the arm is stretched: its forearm in line with its upper arm."""


@pytest.mark.parametrize("name", STRETCHED)
def test_a_stretched_arm_is_solved_at_the_border_of_its_reach(name):
    solver = SOLVERS[name]
    q = random_readings(solver.robot, 400, seed=3)
    q[:, 2] = STRETCHED[name]
    poses = poses_of(solver.robot, q)
    assert np.abs(poses_of(solver.robot, solver.near(poses, q)) - poses).max() < 1e-9
    assert all(len(solver.solutions(pose)) for pose in poses)


def test_a_wrist_on_the_first_axis_stays_at_its_seed():
    """Infinitely many readings reach such a pose: the seed is one of them."""
    solver = SOLVERS["abb-irb-120"]
    q = random_readings(solver.robot, 200, seed=4)

    def beside(joint_three, row):
        """How far the wrist is from the first axis, in the plane of the arm."""
        pose = poses_of(solver.robot, [*row[:2], joint_three, *row[3:]])[0]
        wrist = pose[:3, 3] - solver.robot.table[5, 1] * pose[:3, 2]
        return wrist[0] * np.cos(row[0]) + wrist[1] * np.sin(row[0])

    low, high = solver.robot.limits[2]
    crossing = [row for row in q if beside(low, row) * beside(high, row) < 0.0]
    assert len(crossing) > 20
    seeds = np.array([[*row[:2], brentq(beside, low, high, (row,), 1e-15), *row[3:]] for row in crossing])
    found = solver.near(poses_of(solver.robot, seeds), seeds)
    assert np.abs(found - seeds).max() < 1e-6


@pytest.mark.parametrize(("low", "high"), [(0.0, 360.0), (90.0, 360.0), (190.0, 355.0)])
def test_limits_beyond_half_a_turn_are_searched(low, high):
    """Of an arm without a closed form, whose solutions a search from starts within the limits finds."""
    arm = bent(SOLVERS["abb-irb-120"].robot, seed=1, size=0.2)
    limits = np.tile(np.radians([low, high]), (6, 1))
    robot = Robot.from_dict({**arm.to_dict(), "limits": limits.tolist()})
    solver = Inverse(robot)
    assert solver.method == "numeric"
    q = np.random.default_rng(5).uniform(limits[0, 0], limits[0, 1], (60, 6))
    found = [is_among(own, solver.solutions(pose)) for own, pose in zip(q, poses_of(robot, q), strict=True)]
    assert np.mean(found) > 0.9


def test_what_is_no_pose_is_said_in_a_sentence():
    with pytest.raises(InputError, match=r"^the poses have shape \(3, 3\)"):
        Inverse(Robot.load("ur10")).solutions(np.eye(3))
