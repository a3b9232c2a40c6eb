"""What is asked for, what positions determine, and what is said about the rest."""

import numpy as np
import pytest

from truearm._core import MeasurementSet, Problem, Setup, identifiability
from truearm.description.library import library_names
from truearm.fits.identifiability import identify
from truearm.fits.identified import IdentifiedArm
from truearm.fits.parameters import candidates
from truearm.robot import Robot
from truearm.simulation import VirtualArm

TARGET_IN_FLANGE = np.array([0.05, 0.03, 0.1])


def exact_set(robot, *, held=(), with_orientation=False, count=200):
    """Exact measurements of an arm, and their set-up."""
    joints = robot.joints_from_readings(VirtualArm(robot, seed=1).poses(count, held=held))
    poses = robot.flange_chain.pose(joints)
    points = poses[:, :3, 3] + poses[:, :3, :3] @ TARGET_IN_FLANGE
    measured = MeasurementSet(
        {
            "joints": joints,
            "group": np.zeros(count, dtype=np.int64),
            "targets": points[:, None],
            "rotations": np.ascontiguousarray(poses[:, :3, :3]) if with_orientation else None,
            "sigma": np.zeros((count, 4)),
            "weight": np.ones(count),
            "distances": [],
        }
    )
    return measured, Setup(np.eye(4)[None], TARGET_IN_FLANGE[None, None], np.eye(3)[None], np.empty((0, 3)))


def names_of(robot, **more):
    return IdentifiedArm(robot, **more).candidates.names


def test_links_bring_theta_d_a_alpha_and_beta_in_place_of_d_between_parallel_axes():
    assert names_of(Robot.load("ur10")) == (
        *("theta1", "d1", "a1", "alpha1"),
        *("theta2", "a2", "alpha2", "beta2"),
        *("theta3", "a3", "alpha3", "beta3"),
        *("theta4", "d4", "a4", "alpha4"),
        *("theta5", "d5", "a5", "alpha5"),
        *("theta6", "d6", "a6", "alpha6"),
    )


def test_in_modified_convention_the_axis_before_counts():
    table = np.zeros((3, 5))
    table[:, 3] = [0.0, np.pi / 2, np.pi]
    found = candidates("modified", ["revolute"] * 3, table).names
    assert [name for name in found if name.startswith(("beta", "d"))] == ["d1", "d2", "beta3"]
    found = candidates("standard", ["revolute"] * 3, table).names
    assert [name for name in found if name.startswith(("beta", "d"))] == ["beta1", "d2", "d3"]


@pytest.mark.parametrize(("alpha_deg", "expected"), [(4.9, "beta1"), (175.1, "beta1"), (5.1, "d1")])
def test_parallel_is_within_the_stated_angle(alpha_deg, expected):
    table = np.zeros((2, 5))
    table[0, 3] = np.radians(alpha_deg)
    assert expected in candidates("standard", ["revolute"] * 2, table, 5.0).names


def test_a_prismatic_joint_brings_two_constants_and_a_d_that_varies():
    table = np.zeros((3, 5))
    table[:, 3] = np.pi / 2
    found = candidates("standard", ["revolute", "prismatic", "revolute"], table)
    assert [found.names[k] for k in found.constant if found.names[k].endswith("2")] == ["theta2", "alpha2"]
    assert "d2" in [found.names[k] for k in found.driven]


def test_the_base_brings_all_five_and_does_not_vary():
    found = IdentifiedArm(Robot.load("rv-m2"), frame="world").candidates
    assert found.names[:5] == ("theta0", "d0", "a0", "alpha0", "beta0")
    assert [found.columns[k] for k in found.constant[:5]] == [0, 1, 2, 3, 4]
    assert min(found.driven) == 5


@pytest.mark.parametrize("with_orientation", [False, True])
@pytest.mark.parametrize("name", library_names())
def test_candidates_say_as_much_as_all_parameters_would(name, with_orientation):
    robot = Robot.load(name)
    arm = IdentifiedArm(robot)
    measured, setup = exact_set(robot, with_orientation=with_orientation)
    found = identify(arm, measured, setup)
    everything = Problem(arm.flange_chain, measured, list(range(arm.table.size)))
    determined, _, total_rank, _ = identifiability(everything, arm.table, setup)
    assert (found.rank, found.total_rank) == (len(determined), total_rank)
    assert found.rank + len(found.undetermined) == found.parameters


def plain(robot, measured, setup):
    """Determined, undetermined, rank of theta, d, a and alpha of all links."""
    arm = IdentifiedArm(robot)
    columns = [5 * link + kind for link in range(robot.joint_count) for kind in range(4)]
    determined, undetermined, total_rank, _ = identifiability(
        Problem(arm.flange_chain, measured, columns), arm.table, setup
    )
    return columns, determined, undetermined, total_rank


def test_ur10_from_positions_has_16_of_24_and_18_with_beta():
    robot = Robot.load("ur10")
    measured, setup = exact_set(robot)
    _, determined, _, total_rank = plain(robot, measured, setup)
    assert (len(determined), total_rank) == (16, 25)
    found = identify(IdentifiedArm(robot), measured, setup)
    assert (found.parameters, found.rank, found.total_rank) == (24, 18, 27)
    assert set(found.undetermined) == {"theta1", "d1", "theta6", "d6", "a6", "alpha6"}


def test_the_paper_s_arm_with_its_base_from_positions():
    robot = Robot.load("rv-m2")
    arm = IdentifiedArm(robot, frame="world")
    measured, setup = exact_set(robot, held=(4, 5))
    found = identify(arm, measured, setup)
    assert found.total_rank == 15


def test_a_confounded_parameter_is_said_in_words():
    robot = Robot.load("rv-m2")
    measured, setup = exact_set(robot)
    arm = IdentifiedArm(robot, frame="world")
    found = identify(arm, measured, setup)
    assert "d1 cannot be distinguished from d0." in found.words


def test_a_shift_along_parallel_axes_is_told_by_no_pose():
    robot = Robot.load("ur10")
    measured, setup = exact_set(robot)
    columns, _, undetermined, _ = plain(robot, measured, setup)
    (parts, with_setup) = next(entry[1:] for entry in undetermined if columns[entry[0]] == 11)
    assert {columns[k] for k, _ in parts} == {6}, "d3 is a shift of d2"
    assert not with_setup
