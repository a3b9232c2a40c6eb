"""What a virtual arm is told to do wrong it does, by the stated amount."""

import numpy as np
import pytest

from truearm.errors import InputError, UsageError
from truearm.robot import Robot
from truearm.simulation import (
    Conditions,
    Deflection,
    Harmonic,
    Imperfections,
    JointError,
    Mass,
    Thermal,
    VirtualArm,
)
from truearm.simulation.imperfections import approach_in_sequence

PERFECT = {"length_mm": 0.0, "angle_deg": 0.0, "share": 0.0, "noise_mm": 0.0, "noise_mrad": 0.0}
TWO_LINKS = """
name = "two links"
convention = "standard"
length_unit = "m"
angle_unit = "deg"
[[link]]
joint = "revolute"
d = 0.0
a = 1.0
alpha = 0.0
[[link]]
joint = "revolute"
d = 0.0
a = 0.5
alpha = 0.0
"""


def two_links(**wrong):
    """Arm in the horizontal plane of x and y, with what is wrong and nothing else."""
    return VirtualArm(Robot.from_toml(TWO_LINKS), imperfections=Imperfections(**{**PERFECT, **wrong}))


def turned_by(arm, reading, **met):
    """Degrees that the first joint, the second held at zero, stands beside its reading."""
    x, y, _ = arm.true_position([reading, 0.0], conditions=Conditions(**met))
    return np.rad2deg(np.arctan2(y, x) - reading)


def test_stated_amounts_are_the_errors():
    arm = two_links(stated={"d1": 0.3, "theta2": -0.1, "beta1": 0.02})
    expected = np.zeros((2, 5))
    expected[0, 1], expected[1, 0], expected[0, 4] = 0.3e-3, np.deg2rad(-0.1), np.deg2rad(0.02)
    np.testing.assert_allclose(arm.errors, expected, atol=1e-18)


def test_positive_signs_are_all_positive_and_change_nothing_else():
    arms = [VirtualArm.paper(seed=2, imperfections=Imperfections(signs=s)) for s in ("random", "positive")]
    np.testing.assert_array_equal(np.abs(arms[0].errors), arms[1].errors)
    assert (arms[0].errors < 0.0).any()
    np.testing.assert_array_equal(arms[0].world_from_base, arms[1].world_from_base)


def test_positive_errors_give_the_papers_errors_on_its_path():
    """Section 6: 0.4 to 1.2 mm along the path of Figure 6, with equation (6) as joint errors."""
    path = np.zeros((200, 5))
    path[:, :3] = np.deg2rad(np.linspace((60, 60, -35), (125, 90, -10), 200))
    found = []
    for seed in range(10):
        arm = VirtualArm.paper(
            seed=seed, imperfections=Imperfections(signs="positive", non_geometric="joint")
        )
        found.append(np.linalg.norm(arm.true_position(path) - arm.robot.position(path), axis=1))
    low, high = np.median([errors.min() for errors in found]), np.median([errors.max() for errors in found])
    assert 0.35e-3 < low < 0.6e-3
    assert 1.0e-3 < high < 1.3e-3


def test_harmonics_and_eccentricity_add_up():
    error = JointError(
        1, harmonics=(Harmonic(100.0, 0.01, 30.0),), eccentricity_deg=0.02, eccentricity_phase_deg=90.0
    )
    arm = two_links(joint_errors=(error,))
    for reading in (0.0, 0.3, -1.1):
        gear, wheel = np.sin(100 * reading + np.deg2rad(30)), np.cos(reading)
        assert turned_by(arm, reading) == pytest.approx(0.01 * gear + 0.02 * wheel, abs=1e-9)


def test_backlash_lags_behind_the_movement():
    arm = two_links(joint_errors=(JointError(1, backlash_deg=0.04),))
    assert turned_by(arm, 0.5, approach=[1, 0]) == pytest.approx(-0.02)
    assert turned_by(arm, 0.5, approach=[-1, 0]) == pytest.approx(0.02)
    assert turned_by(arm, 0.5) == pytest.approx(0.0, abs=1e-12)


def test_directions_of_a_sequence():
    signs = approach_in_sequence([[1, 0], [2, 0], [2, -1], [0, -1]])
    np.testing.assert_array_equal(signs, [[1, 0], [1, 0], [1, -1], [-1, -1]])


def test_measuring_in_sequence_shows_the_play():
    arm = two_links(joint_errors=(JointError(1, backlash_deg=0.1),))
    q = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [0.5, 0.0]])
    points = arm.measure_table(q)[["x", "y", "z"]].to_numpy()
    reach = np.linalg.norm(arm.target_in_flange + np.array([1.5, 0, 0]))
    assert np.linalg.norm(points[1] - points[3]) == pytest.approx(np.deg2rad(0.1) * reach, rel=0.1)


def test_gravity_bends_a_horizontal_joint_by_compliance_times_torque():
    deflection = Deflection(
        compliance=(1e-5, 2e-5), masses=(Mass(1, 4.0, (-0.5, 0.0, 0.0)),), gravity_m_s2=(0.0, -10.0, 0.0)
    )
    arm = two_links(deflection=deflection)
    x, y, _ = arm.true_position([0.0, 0.0], conditions=Conditions(payload_kg=2.0))
    first = -(4.0 * 0.5 + 2.0 * 1.5) * 10.0 * 1e-5
    second = -2.0 * 0.5 * 10.0 * 2e-5
    assert y == pytest.approx(np.sin(first) + 0.5 * np.sin(first + second), rel=1e-6)
    assert x == pytest.approx(np.cos(first) + 0.5 * np.cos(first + second), rel=1e-6)


def test_payload_for_each_pose_and_as_a_column():
    deflection = Deflection(compliance=(1e-4, 1e-4), gravity_m_s2=(0.0, -10.0, 0.0))
    arm = two_links(deflection=deflection)
    q = np.zeros((3, 2))
    heights = arm.true_position(q, conditions=Conditions(payload_kg=[0.0, 1.0, 2.0]))[:, 1]
    assert heights[0] == 0.0
    assert heights[2] == pytest.approx(2 * heights[1], rel=1e-3)
    table = arm.measure_table(q, conditions=Conditions(payload_kg=[0.0, 1.0, 2.0]))
    np.testing.assert_array_equal(table["payload_kg"], [0.0, 1.0, 2.0])


def test_links_grow_and_parameters_drift_with_temperature():
    thermal = Thermal(growth_per_k=2e-5, drift_per_k={"theta1": 0.001}, reference_c=20.0)
    arm = two_links(thermal=thermal)
    points = arm.true_position(np.zeros((2, 2)), conditions=Conditions(temperature_c=[20.0, 30.0]))
    assert np.linalg.norm(points[0]) == pytest.approx(1.5)
    assert np.linalg.norm(points[1]) == pytest.approx(1.5 * (1 + 2e-4))
    assert np.rad2deg(np.arctan2(points[1, 1], points[1, 0])) == pytest.approx(0.01)


def test_repeatability_is_what_visits_differ_by():
    arm = two_links(repeatability_mm=0.1)
    q = np.tile([0.3, -0.4], (4000, 1))
    points = arm.measure_table(q)[["x", "y", "z"]].to_numpy()
    np.testing.assert_allclose(points.std(axis=0), 1e-4, rtol=0.06)
    turning = two_links(repeatability_deg=0.01)
    scatter = turning.measure_table(q)[["x", "y", "z"]].to_numpy().std(axis=0)
    assert np.linalg.norm(scatter) == pytest.approx(np.deg2rad(0.01) * np.hypot(1.5, 0.5), rel=0.15)


@pytest.mark.parametrize("robot", ["rv-m2", "ur10"])
def test_an_arm_survives_its_file(robot):
    wrong = Imperfections(
        stated={"d1": 0.2},
        joint_errors=(JointError(1, (Harmonic(80.0, 0.003),), backlash_deg=0.01),),
        deflection=Deflection((1e-6,) * Robot.load(robot).joint_count, (Mass(2, 5.0),)),
        thermal=Thermal(drift_per_k={"theta1": 1e-4}),
        repeatability_mm=0.02,
    )
    arm = VirtualArm(Robot.load(robot), seed=5, imperfections=wrong, parameters=["theta2", "a1"])
    met = Conditions(payload_kg=3.0, temperature_c=28.0)
    q = arm.poses(10)
    expected = arm.measure_table(q, orientation=True, conditions=met)
    for again in (VirtualArm.from_dict(arm.to_dict()), VirtualArm.from_toml(arm.to_toml())):
        assert again.measure_table(q, orientation=True, conditions=met).equals(expected)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('robot = "rv-m2"\nsed = 3', 'unknown key "sed"'),
        ("seed = 3", '"robot" is missing'),
        ('robot = "rv-m2"\n[imperfections]\nnoise = 3', "imperfections|noise"),
        ('robot = "rv-m2"\n[imperfections]\nnoise_mm = "much"', "noise_mm.*much"),
        ('robot = "rv-m2"\n[imperfections]\nstated = { d9 = 1.0 }', 'no parameter "d9"'),
        ("robot = ", "TOML"),
    ],
)
def test_a_file_that_is_wrong_says_where(text, message):
    with pytest.raises(InputError, match=message):
        VirtualArm.from_toml(text)


def test_what_does_not_fit_the_arm_is_refused():
    with pytest.raises(InputError, match="joint 7"):
        two_links(joint_errors=(JointError(7),))
    with pytest.raises(InputError, match="3 compliances"):
        two_links(deflection=Deflection((1.0, 1.0, 1.0)))
    with pytest.raises(InputError, match="payload"):
        two_links().true_position([0, 0], conditions=Conditions(payload_kg=1.0))
    with pytest.raises(InputError, match="temperature"):
        two_links().true_position([0, 0], conditions=Conditions(temperature_c=30.0))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"non_geometric": "joints"}, '"joints" is not known. Either cartesian or joint'),
        ({"signs": "positve"}, '"positve" is not known'),
        ({"length_mm": -0.4}, "length_mm: -0.4. Zero or more"),
        ({"angle_deg": float("inf")}, "angle_deg: inf"),
        ({"noise_mm": "much"}, "noise_mm is 'much'"),
    ],
)
def test_imperfections_are_sizes_and_words_that_are_known(wrong, message):
    with pytest.raises(UsageError, match=message):
        Imperfections(**wrong)


def test_a_size_below_zero_in_a_file_is_told_with_its_key():
    with pytest.raises(InputError, match="cell, length_mm: -1. Zero or more") as refused:
        VirtualArm.from_toml('robot = "rv-m2"\n[imperfections]\nlength_mm = -1.0', where="cell")
    assert not isinstance(refused.value, UsageError)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda arm: VirtualArm(arm.robot, seed=-1), "the seed is -1. Zero or more"),
        (lambda arm: VirtualArm(arm.robot, seed=0.5), "the seed is 0.5"),  # type: ignore[arg-type]
        (lambda arm: arm.poses(-1), "the number of poses is -1"),
        (lambda arm: arm.poses(2.5), "the number of poses is 2.5"),
        (lambda arm: arm.poses(2, seed=-1), "the seed is -1"),
        (lambda arm: arm.measure(arm.poses(2), seed=-1), "the seed is -1"),
    ],
)
def test_counts_and_seeds_are_whole_numbers_from_zero_on(call, message):
    with pytest.raises(UsageError, match=message):
        call(two_links())
