"""The virtual arm is as wrong as it says, and hides what an instrument would not know."""

import numpy as np
import pytest

from truearm.errors import InputError, UsageError
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.simulation import PAPER_PARAMETERS, Imperfections, VirtualArm

ONLY_CONSTANT = Imperfections(share=0.0, noise_mm=0.0, noise_mrad=0.0)
LENGTH_M, ANGLE_RAD = 0.4e-3, np.deg2rad(0.05)


def distances(points, others):
    return np.linalg.norm(points - others, axis=1)


def test_paper_arm_errs_on_the_fifteen_parameters_only():
    errors = VirtualArm.paper(seed=3).errors
    assert errors.shape == (6, 5)
    assert np.count_nonzero(errors) == len(PAPER_PARAMETERS) == 15
    assert set(np.abs(errors[:, [1, 2]]).ravel()) == {0.0, LENGTH_M}
    assert set(np.abs(errors[:, [0, 3, 4]]).ravel()) == {0.0, ANGLE_RAD}


def test_paper_arm_errs_in_the_places_the_paper_names():
    errors = VirtualArm.paper().errors
    erring = {(row, column) for row, column in zip(*np.nonzero(errors), strict=True)}
    base = {(0, 0), (0, 2), (0, 3), (0, 4)}
    first = {(1, 0), (1, 1), (1, 2), (1, 3)}
    second = {(2, 0), (2, 2), (2, 3), (2, 4)}
    third = {(3, 0), (3, 1), (3, 2)}
    assert erring == base | first | second | third


def test_same_seed_same_arm_other_seed_other_arm():
    q = VirtualArm.paper().poses(5)
    first, again, other = (VirtualArm.paper(seed=seed).measure_table(q) for seed in (1, 1, 2))
    assert first.equals(again)
    assert not first[["x", "y", "z"]].equals(other[["x", "y", "z"]])


def test_errors_are_of_the_size_that_the_paper_reports():
    """Random signs give 1.5 to 1.9 mm on the paper's path and about 1.4 mm over the workspace."""
    means = []
    for seed in range(20):
        arm = VirtualArm.paper(seed=seed)
        q = arm.poses(500, held=(4, 5))
        means.append(distances(arm.true_position(q), arm.robot.position(q)).mean())
    assert 0.8e-3 < np.median(means) < 2.2e-3


@pytest.mark.parametrize("kind", ["cartesian", "joint"])
@pytest.mark.parametrize("share", [0.0, 0.09, 0.3])
def test_harmonics_have_the_stated_share_of_the_error(kind, share):
    arm = VirtualArm.paper(seed=4, imperfections=Imperfections(share=share, non_geometric=kind))
    plain = VirtualArm.paper(seed=4, imperfections=ONLY_CONSTANT)
    q = arm.poses(4000, seed=9)
    geometric = distances(plain.true_position(q), arm.robot.position(q)).mean()
    waves = distances(arm.true_position(q), plain.true_position(q)).mean()
    assert waves == pytest.approx(share * geometric, rel=0.05)


def test_cartesian_harmonics_depend_on_the_first_three_joints_only():
    arm = VirtualArm.paper(seed=5)
    plain = VirtualArm.paper(seed=5, imperfections=ONLY_CONSTANT)
    q = arm.poses(2)
    q[1, :3] = q[0, :3]
    waves = arm.true_position(q) - plain.true_position(q)
    np.testing.assert_allclose(waves[0], waves[1], atol=1e-15)
    assert np.linalg.norm(waves[0]) > 0.0


def test_measured_without_noise_is_the_truth_seen_by_the_instrument():
    arm = VirtualArm.paper(seed=6, imperfections=Imperfections(noise_mm=0.0))
    q = arm.poses(50)
    seen = arm.measure_table(q)[["x", "y", "z"]].to_numpy()
    base_from_world = np.linalg.inv(arm.world_from_base)
    in_base = seen @ base_from_world[:3, :3].T + base_from_world[:3, 3]
    offset = np.linalg.norm(arm.target_in_flange - arm.robot.tool[:3, 3])
    np.testing.assert_allclose(distances(in_base, arm.true_position(q)), offset, rtol=1e-9)


def test_noise_is_what_it_is_said_to_be():
    q = VirtualArm.paper().poses(5000)
    noisy = VirtualArm.paper(imperfections=Imperfections(noise_mm=0.1)).measure_table(q)
    quiet = VirtualArm.paper(imperfections=Imperfections(noise_mm=0.0)).measure_table(q)
    noise = (noisy - quiet)[["x", "y", "z"]].to_numpy()
    np.testing.assert_allclose(noise.std(axis=0), 1e-4, rtol=0.05)


def test_measured_orientation_turns_with_the_tool():
    arm = VirtualArm.paper(imperfections=Imperfections(noise_mrad=0.0))
    q = arm.poses(20)
    table = arm.measure_table(q, orientation=True)
    quaternions = table[["qw", "qx", "qy", "qz"]].to_numpy()
    nominal = arm.world_from_base @ arm.robot.pose(q)
    traces = np.einsum("nij,nij->n", _matrices(quaternions), nominal[:, :3, :3])
    turned = np.arccos(np.clip((traces - 1.0) / 2.0, -1.0, 1.0))
    assert np.all(turned < 12 * ANGLE_RAD)
    assert np.all(turned > 0.0)


def test_repeated_measurements_differ_by_noise_alone():
    arm = VirtualArm.paper()
    q = arm.poses(100)
    first, second = (arm.measure_table(q, seed=seed) for seed in (0, 1))
    apart = distances(first[["x", "y", "z"]].to_numpy(), second[["x", "y", "z"]].to_numpy())
    assert 0.0 < apart.max() < 0.4e-3


@pytest.mark.parametrize("name", ["rv-m2", "ur10", "franka-panda", "adept-cobra-600", "fanuc-lr-mate-200id"])
def test_any_arm_of_the_library_can_be_drawn(name):
    robot = Robot.load(name)
    arm = VirtualArm(robot, seed=1)
    q = arm.poses(200)
    finite = np.isfinite(robot.limits)
    assert np.all(((q >= robot.limits[:, 0]) & (q <= robot.limits[:, 1])) | ~finite.all(axis=1))
    error = distances(arm.true_position(q), robot.position(q))
    assert 0.1e-3 < error.mean() < 10e-3


def test_held_joints_stay():
    q = VirtualArm.paper().poses(10, held=(4, 5))
    assert np.all(q[:, 3:] == 0.0)
    assert np.all(np.ptp(q[:, :3], axis=0) > 0.0)


def test_measure_returns_measurements_of_those_poses():
    arm = VirtualArm.paper()
    assert len(arm.measure(arm.poses(7))) == 7


def test_unknown_parameter_is_refused_by_name():
    with pytest.raises(InputError, match='no parameter "theta9"'):
        VirtualArm(Robot.load("ur10"), parameters=["theta9"])
    with pytest.raises(InputError, match="theta0"):
        VirtualArm(Robot.load("ur10"), parameters=["theta0"])


def _matrices(quaternions):
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


@pytest.mark.parametrize("held", [[0], [7], [1.5], "1", 3])
def test_joints_that_cannot_be_held_are_refused(held):
    arm = VirtualArm(Robot.load("ur10"), seed=1)
    with pytest.raises(UsageError, match="joint|held"):
        arm.poses(2, held=held)


def test_held_joints_stay_at_zero():
    arm = VirtualArm(Robot.load("ur10"), seed=1)
    readings = arm.poses(3, held=[1, 6])
    assert (readings[:, [0, 5]] == 0.0).all()
    assert (readings[:, 1:5] != 0.0).all()


def test_what_an_arm_measures_is_of_one_set_up():
    arm = VirtualArm(Robot.load("ur10"), seed=1)
    parts = [arm.measure(arm.poses(3, seed=k)) for k in range(2)]
    assert Measurements.of(parts).groups == ["data"]
