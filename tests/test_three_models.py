"""Programming, controller and calibrated model: a right declaration, and what shows a wrong one."""

import numpy as np
import pytest

import truearm as ta
from truearm.controller import Controller
from truearm.registration import register
from truearm.simulation import VirtualArm


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(ta.Robot.load("ur10"), seed=4)


@pytest.fixture(scope="module")
def factory(arm):
    """The controller's own kinematics: not quite plain, and neither nominal nor true."""
    rng = np.random.default_rng(7)
    table = arm.robot.table + rng.normal(scale=5e-4, size=arm.robot.table.shape)
    return Controller(ta.Robot.from_dict({**arm.robot.to_dict(), "table": table.tolist()}), "factory")


@pytest.fixture(scope="module")
def compensated(arm):
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(150)), model="constant")
    q = arm.poses(60, seed=1)
    found = ta.Compensator(calibration).joints(q)
    return q[~found.refused], found.q[~found.refused]


def executed(controller, targets, seed):
    """Joints that a controller with its own kinematics moves to for Cartesian targets."""
    return controller.inverse.near(targets, seed)


def mean_error_mm(arm, promised, commanded):
    """Distance of the real tool from where the program promised it, but for where the base stands."""
    real, none = arm.true_position(commanded), np.empty((0, 3, 3))
    moved = register(real, promised, none, none, 0.0)
    return 1e3 * np.linalg.norm(real @ moved[:3, :3].T + moved[:3, 3] - promised, axis=1).mean()


def test_joint_targets_do_not_ask_for_the_controllers_model(arm, compensated):
    q, corrected = compensated
    promised = arm.robot.position(q)
    assert mean_error_mm(arm, promised, corrected) < 0.5 * mean_error_mm(arm, promised, q)


def test_cartesian_targets_through_the_declared_model_are_as_good_as_joint_targets(arm, factory, compensated):
    q, corrected = compensated
    written = factory.pose(corrected)
    assert np.abs(executed(factory, written, q) - corrected).max() < 1e-9


def test_a_wrong_declaration_makes_it_visibly_worse_and_shows_in_the_joints(arm, factory, compensated):
    q, corrected = compensated
    promised = arm.robot.position(q)
    written = Controller.nominal(arm.robot).pose(corrected)
    reached = executed(factory, written, q)
    right, wrong = (mean_error_mm(arm, promised, joints) for joints in (corrected, reached))
    assert wrong > 2.0 * right
    assert np.median(np.abs(reached - corrected).max(axis=1)) > np.radians(0.02), "joints read back show it"


def test_the_other_wrong_declaration_is_as_bad(arm, factory, compensated):
    q, corrected = compensated
    promised = arm.robot.position(q)
    reached = executed(Controller.nominal(arm.robot), factory.pose(corrected), q)
    assert mean_error_mm(arm, promised, reached) > 2.0 * mean_error_mm(arm, promised, corrected)


def test_what_lies_between_two_declarations_is_what_lies_between_their_poses(arm, factory, compensated):
    q, corrected = compensated
    nominal = Controller.nominal(arm.robot)
    between = np.linalg.norm((factory.pose(q) - nominal.pose(q))[:, :3, 3], axis=1)
    reached = executed(factory, nominal.pose(corrected), q)
    shift = np.linalg.norm(arm.true_position(reached) - arm.true_position(corrected), axis=1)
    assert np.median(np.abs(shift / between - 1.0)) < 0.02
