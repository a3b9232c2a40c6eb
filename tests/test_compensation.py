"""Compensation as a user calls it: the real tool goes where the program means it, and bounds are kept."""

import time
from collections import OrderedDict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

import truearm as ta
from truearm.compensation import TOOLS_KEPT
from truearm.simulation import Imperfections, VirtualArm
from truearm.solving import beyond_learnt

MET_M = 1e-9
PATH = np.linspace([0.3, -1.2, 1.5, -0.8, 1.1, 0.4], [0.8, -1.0, 1.3, -0.9, 1.2, 0.2], 40)
BOUNDS = [field.name for field in fields(ta.Limits) if field.name.startswith(("largest", "change"))]
OPEN = ta.Limits(largest_mm=20.0, largest_joint_deg=10.0)


@pytest.fixture(scope="module")
def robot():
    return ta.Robot.load("ur10")


@pytest.fixture(scope="module")
def constant(robot):
    arm = VirtualArm(robot, seed=2)
    return ta.calibrate(robot, arm.measure(arm.poses(80)), model="constant", refit=False)


@pytest.fixture(scope="module")
def variable(robot):
    arm = VirtualArm(robot, seed=2)
    return ta.calibrate(robot, arm.measure(arm.poses(110)), refit=False)


@pytest.fixture(params=["constant", "variable"])
def calibration(request):
    return request.getfixturevalue(request.param)


def angles(poses, others):
    """Angle between each two poses, rad, small ones."""
    turns = np.einsum("nji,njk->nik", poses[:, :3, :3], others[:, :3, :3])
    return np.linalg.norm(turns - np.eye(3), axis=(1, 2)) / np.sqrt(2.0)


def test_joint_targets_meet_the_programs_poses(calibration, robot):
    tool = np.eye(4)
    tool[:3, 3] = [0.02, -0.03, 0.2]
    found = ta.Compensator(calibration, limits=OPEN).joints(PATH, tool=tool)
    assert found.refusals == ()
    meant = robot.pose(PATH) @ np.linalg.inv(robot.tool) @ tool
    real = calibration.pose(found.q, tool=tool)
    assert np.linalg.norm((meant - real)[:, :3, 3], axis=1).max() < MET_M
    assert angles(meant, real).max() < MET_M
    assert found.residual_mm.max() < 1e-6
    assert np.array_equal(found.nominal, PATH)
    without = np.linalg.norm(calibration.position(PATH, tool=tool) - meant[:, :3, 3], axis=1)
    assert found.correction_mm == pytest.approx(1e3 * without, rel=0.1, abs=0.01)


def test_cartesian_targets_give_the_same(calibration, robot):
    compensator = ta.Compensator(calibration, limits=OPEN)
    by_joints = compensator.joints(PATH)
    along = compensator.poses(robot.pose(PATH), PATH[0])
    each = compensator.poses(robot.pose(PATH), PATH + 0.01)
    for found in (along, each):
        assert found.refusals == ()
        assert found.nominal == pytest.approx(PATH, abs=1e-9)
        assert found.q == pytest.approx(by_joints.q, abs=1e-9)


def test_one_waypoint_is_that_of_the_path(calibration):
    compensator = ta.Compensator(calibration, limits=OPEN)
    together = compensator.joints(PATH)
    for row, corrected in zip(PATH, together.q, strict=True):
        assert np.array_equal(compensator.correct(row), corrected)
    assert np.array_equal(compensator.joints(PATH[3]).q, together.q[3:4])


def test_what_was_corrected_stays_what_it_was(constant):
    given = PATH.copy()
    found = ta.Compensator(constant).joints(given)
    given += 1.0
    assert np.array_equal(found.nominal, PATH)


class Dawdling(OrderedDict[Any, Any]):
    """Other threads have their turn between what it finds and what is done with that."""

    def get(self, key: Any, default: Any = None) -> Any:
        found = super().get(key, default)
        time.sleep(1e-4)
        return found

    def __contains__(self, key: object) -> bool:
        return self.get(key) is not None


def test_threads_share_a_compensator(constant):
    compensator = ta.Compensator(constant, limits=OPEN)
    compensator._correctors = Dawdling()
    tools = [np.array([0.0, 0.0, 0.001 * k]) for k in range(3 * TOOLS_KEPT)]
    alone = [ta.Compensator(constant, limits=OPEN).correct(PATH[0], tool=tool) for tool in tools]

    def all_right(seed):
        drawn = np.random.default_rng(seed).integers(len(tools), size=100)
        return all(np.array_equal(compensator.correct(PATH[0], tool=tools[k]), alone[k]) for k in drawn)

    with ThreadPoolExecutor(6) as pool:
        assert all(pool.map(all_right, range(6)))


def test_inverse_kinematics_of_the_calibrated_arm(calibration):
    poses = calibration.pose(PATH)
    assert calibration.solve(poses, PATH[0]) == pytest.approx(PATH, abs=1e-8)
    assert calibration.solve(poses[0], PATH[0] + 0.05) == pytest.approx(PATH[0], abs=1e-8)
    turned = PATH[0] - [0, 0, 0, 0, 0, 2 * np.pi]
    assert calibration.solve(poses[0], turned + 0.05) == pytest.approx(turned, abs=1e-8)
    position = calibration.solve(poses[0], PATH[1], task="position")
    assert calibration.position(position) == pytest.approx(poses[0][:3, 3], abs=MET_M)
    axis = calibration.pose(calibration.solve(poses[0], PATH[1], task="axis"))
    assert axis[:3, 2:] == pytest.approx(poses[0][:3, 2:], abs=MET_M)


def test_a_pose_out_of_reach_is_said_with_its_number(constant):
    poses = constant.pose(PATH[:3])
    poses[1, :3, 3] += 9.0
    with pytest.raises(ta.WorkError, match="pose 2 cannot be reached: the tool stays .* mm from its target"):
        constant.solve(poses, PATH[0])
    found = ta.Compensator(constant, limits=OPEN).poses(poses, PATH[0])
    assert [(refusal.number, refusal.code) for refusal in found.refusals] == [(2, 2)]
    assert found.refused.tolist() == [False, True, False]
    assert np.isnan(found.q[1]).all()
    assert np.isfinite(found.q[[0, 2]]).all()


def test_the_papers_task_moves_the_first_three_joints(constant, robot):
    found = ta.Compensator(constant, task="position", moving=(1, 2, 3), limits=OPEN).joints(PATH)
    assert found.refusals == ()
    assert np.array_equal(found.q[:, 3:], PATH[:, 3:])
    by_array = ta.Compensator(constant, task="position", moving=np.array([1, 2, 3]), limits=OPEN)
    assert by_array.moving == (1, 2, 3)
    assert constant.position(found.q) == pytest.approx(robot.position(PATH), abs=MET_M)


def test_another_programming_model(constant, robot):
    table = robot.table.copy()
    table[1, 2] += 2e-3
    other = ta.Robot.from_dict(robot.to_dict() | {"table": table.tolist()})
    found = ta.Compensator(constant, programming=other, limits=OPEN).joints(PATH)
    assert constant.position(found.q) == pytest.approx(other.position(PATH), abs=MET_M)


def test_the_papers_arm_with_joint_errors_comes_to_the_calibrations_residual():
    """Equation (6) as joint errors: compensated, the arm is off by what the calibration did not find."""
    imperfections = Imperfections(non_geometric="joint", noise_mm=0.0)
    arm = VirtualArm.paper(seed=1, imperfections=imperfections)
    table = arm.measure_table(arm.poses(150))
    world = arm.world_from_base
    table[["x", "y", "z"]] = (table[["x", "y", "z"]].to_numpy() - world[:3, 3]) @ world[:3, :3]
    data = ta.Measurements.from_dataframe(table)
    calibration = ta.calibrate(arm.robot, data, frame="world", refit=False)
    q = arm.poses(60, seed=9)
    limits = ta.Limits(largest_mm=None, largest_deg=None, largest_joint_deg=None, change_mm_per_mm=None,
                       change_mrad_per_rad=None, largest_std_mm=None, joint_limits=False)  # fmt: skip
    found = ta.Compensator(calibration, task="position", moving=(1, 2, 3), limits=limits).joints(q)
    good = ~found.refused
    assert good.mean() > 0.9
    meant = arm.robot.position(q[good])
    left = np.linalg.norm(arm.true_position(found.q[good]) - meant, axis=1)
    residual = np.linalg.norm(calibration.position(found.q[good]) - arm.true_position(found.q[good]), axis=1)
    assert left == pytest.approx(residual, abs=MET_M)
    assert left.mean() < 0.2 * np.linalg.norm(arm.true_position(q[good]) - meant, axis=1).mean()


def test_features_are_needed_where_the_field_has_them(robot):
    arm = VirtualArm(robot, seed=4)
    q = arm.poses(80)
    table = arm.measure_table(q)
    table["temperature"] = np.linspace(15.0, 30.0, len(q))
    data = ta.Measurements.from_dataframe(table)
    calibration = ta.calibrate(robot, data, features=("temperature",), refit=False)
    with pytest.raises(ta.UsageError, match='The calibration needs "temperature"'):
        ta.Compensator(calibration)
    with pytest.raises(ta.InputError, match='^the feature "temperature" is nan. All values must be finite'):
        ta.Compensator(calibration, features={"temperature": np.nan})
    with pytest.raises(ta.InputError, match=r'of the feature "temperature" hold NaN .* in row 1 \(counted'):
        calibration.position(PATH[:2], features={"temperature": [21.0, np.inf]})
    features = {"temperature": 21.0}
    found = ta.Compensator(calibration, limits=OPEN, features=features).joints(PATH)
    good = ~found.refused
    assert good.any()
    real = calibration.position(found.q[good], features=features)
    assert real == pytest.approx(robot.position(PATH[good]), abs=MET_M)
    assert beyond_learnt(calibration, [21.0]) == []
    assert beyond_learnt(calibration, [30.5]) == [
        "temperature = 30.5 lies beyond 15 to 30, where it was learnt"
    ]


def test_coupled_joints_are_corrected_in_readings():
    robot = ta.Robot.load("ur10")
    coupling = np.eye(6)
    coupling[2, 1], coupling[3, 3] = -1.0, -1.0
    coupled = ta.Robot.from_dict(robot.to_dict() | {"coupling": coupling.tolist()})
    arm = VirtualArm(coupled, seed=5)
    calibration = ta.calibrate(coupled, arm.measure(arm.poses(80)), model="constant", refit=False)
    q = np.linalg.solve(coupling, PATH.T).T
    found = ta.Compensator(calibration, limits=OPEN).joints(q)
    assert found.refusals == ()
    assert calibration.position(found.q) == pytest.approx(coupled.position(q), abs=MET_M)


def test_every_bound_refuses_with_a_sentence(constant):
    cases = {
        4: (replace(OPEN), "limit"),
        5: (replace(OPEN, largest_joint_deg=1e-4), "joint . would change by"),
        6: (replace(OPEN, largest_mm=1e-3), "shifts the tool by"),
        7: (replace(OPEN, largest_deg=1e-5), "turns the tool by"),
        8: (replace(OPEN, largest_std_mm=1e-4), "the calibration is uncertain"),
    }
    for code, (limits, words) in cases.items():
        q = PATH[:1].copy()
        if code == 4:
            q[0, 5] = constant.robot.limits[5, 1] + 0.2
        found = ta.Compensator(constant, limits=limits).joints(q)
        assert [refusal.code for refusal in found.refusals] == [code]
        assert np.isnan(found.q).all()
        with pytest.raises(ta.WorkError, match=words):
            ta.Compensator(constant, limits=limits).correct(q[0])


def test_the_change_along_a_path_is_bounded(constant):
    loose = ta.Compensator(constant, limits=OPEN).joints(PATH)
    tight = ta.Compensator(constant, limits=replace(OPEN, change_mm_per_mm=1e-5)).joints(PATH)
    assert loose.refusals == ()
    assert {refusal.code for refusal in tight.refusals} == {9}
    assert "over the way from the waypoint before, the shift changes by" in tight.refusals[0].reason
    assert tight.refusals[0].number == 2


def test_an_arm_with_a_joint_to_spare_may_move_while_its_tool_rests():
    robot = ta.Robot.load("franka-panda")
    arm = VirtualArm(robot, seed=3)
    calibration = ta.calibrate(robot, arm.measure(arm.poses(60)), model="constant", refit=False)
    path = [np.array([0.2, -0.3, 0.1, -1.9, 0.2, 1.7, 0.4])]
    for _ in range(40):
        spare = np.linalg.svd(robot.joint_jacobian(path[-1][None], pose=True)[0])[2][-1]
        path.append(path[-1] + 2e-3 * np.sign(spare[0]) * spare)
    assert np.ptp(robot.pose(np.array(path))[:, :3, 3], axis=0).max() < 1e-4
    assert ta.Compensator(calibration).joints(path).refusals == ()


def test_standard_deviations_of_constants_are_the_calibrations(constant):
    found = ta.Compensator(constant, limits=OPEN).joints(PATH)
    exact = 1e3 * np.linalg.norm(constant.position_std(found.q), axis=1)
    assert found.std_mm == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda c: ta.Compensator(c, task="tool"), '"tool" is not known'),  # type: ignore[arg-type]
        (lambda c: ta.Compensator(c, moving=(0, 1)), "Some of the joints 1 to 6"),
        (lambda c: ta.Compensator(c, moving=()), "Some of the joints 1 to 6"),
        (lambda c: ta.Compensator(c, moving=(1, 5, 5)), r"joints \[1, 5, 5\]\. .*, each once"),
        (lambda c: ta.Compensator(c, programming=ta.Robot.load("rv-m2")), "was calibrated with"),
        (lambda c: ta.Compensator(c, features={"t": 1.0}), "The calibration needs none"),
        (lambda c: ta.Compensator(c).joints(np.zeros((2, 5))), "must be \\(n, 6\\)"),
        (lambda c: ta.Compensator(c).joints([[np.nan] * 6]), "NaN or infinite"),
        (lambda c: ta.Compensator(c).joints(PATH, tool=2 * np.eye(4)), "the last row is 0 0 0 2"),
        (lambda c: ta.Compensator(c).joints(PATH, tool=np.diag([2.0, 1, 1, 1])), "the tool"),
        (lambda c: ta.Compensator(c).correct([0.0] * 5), "5 readings"),
        (lambda c: ta.Compensator(c).correct("home"), "texts were given"),
        (lambda c: ta.Compensator(c).correct([np.nan] * 6), "NaN or infinite values"),
        (lambda c: ta.Compensator(c).correct([0.0, np.inf, *[0.0] * 4]), "NaN or infinite values"),
        (lambda c: ta.Compensator(c).poses(np.zeros((2, 3)), PATH[0]), "\\(n, 4, 4\\)"),
        (lambda c: ta.Compensator(c).poses(np.ones((1, 4, 4)), PATH[0]), "last row"),
        (lambda c: ta.Compensator(c).poses(np.diag([2.0, 1, 1, 1]), PATH[0]), "not rigid in row 0"),
        (lambda c: c.solve(c.pose(PATH[:2]).astype(np.float32), PATH[0]), "rows 0 and 1 .*double precision"),
        (lambda c: ta.Compensator(c).poses([np.eye(4)] * 3, PATH[:2]), "2 seeds for 3 poses"),
        (lambda c: ta.Limits(largest_mm=-1.0), "A bound is positive"),
    ],
)  # fmt: skip
def test_bad_input_is_told_what_is_wrong(constant, make, words):
    with pytest.raises((ta.InputError, ta.UsageError), match=words):
        make(constant)


def planar(lengths):
    """An arm of parallel axes."""
    link = '[[link]]\njoint = "revolute"\ntheta = 0\nd = 0\na = {}\nalpha = 0\nlimits = [-170, 170]\n'
    head = 'name = "planar"\nconvention = "standard"\nlength_unit = "m"\nangle_unit = "deg"\n'
    return ta.Robot.from_toml(head + "".join(link.format(length) for length in lengths))


@pytest.mark.parametrize("lengths", [(0.4, 0.3), (0.4, 0.3, 0.2), (0.3, 0.3, 0.2, 0.1)])
def test_an_arm_that_cannot_leave_a_plane_is_corrected_in_it(lengths):
    robot = planar(lengths)
    arm = VirtualArm(robot, seed=2)
    calibration = ta.calibrate(robot, arm.measure(arm.poses(120)), model="constant", refit=False)
    q = arm.poses(60, seed=5)
    found = ta.Compensator(calibration).joints(q)
    assert found.refused.mean() < 0.2
    done = ~found.refused
    left = robot.position(q[done]) - calibration.position(found.q[done])
    assert np.abs(left[:, :2]).max() < MET_M
    beside = 1e3 * np.abs(left[:, 2])
    assert beside.max() > 0.01
    np.testing.assert_allclose(found.residual_mm[done], beside, atol=1e-5)


@pytest.mark.parametrize("name", ["adept-cobra-600", "rv-m2"])
def test_bounds_refuse_what_is_found_and_never_change_it(name):
    """Also where arms of few axes are nearly stretched, and a turn that can be met asks for long steps."""
    robot = ta.Robot.load(name)
    arm = VirtualArm(robot, seed=3)
    calibration = ta.calibrate(robot, arm.measure(arm.poses(60)), model="constant", refit=False)
    tool, q = np.eye(4), arm.poses(500, seed=9)
    tool[:3, 3] = [0.11, 0.04, 0.05]
    bounded = ta.Compensator(calibration).joints(q, tool=tool)
    none: dict[str, Any] = dict.fromkeys(BOUNDS)
    free = ta.Compensator(calibration, limits=ta.Limits(**none)).joints(q, tool=tool)
    both = ~bounded.refused & ~free.refused
    assert both.sum() > 450
    assert bounded.q[both] == pytest.approx(free.q[both], abs=1e-9)
    assert bounded.residual_mrad[both] == pytest.approx(free.residual_mrad[both], abs=1e-6)
