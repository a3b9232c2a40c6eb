"""Standard errors of constants hold what these take over of what varies, and survive files and updates."""

import json
from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.remastered import remastered
from truearm.certainty.standard_errors import of_covariance
from truearm.fits.models import CONSTANT
from truearm.simulation import Deflection, Harmonic, Imperfections, JointError, Mass, VirtualArm
from truearm.storage import calibration_content

POSES = 150
GIVES_WAY = Deflection(
    compliance=(0.0, 2e-4, 2e-4, 1e-4, 0.0),
    masses=(Mass(2, 2.0), Mass(3, 1.5), Mass(5, 1.2, (0.0, 0.0, 0.07))),
)
RUNS_OUT = tuple(JointError(joint, harmonics=(Harmonic(2.0, 0.02, 40.0 * joint),)) for joint in (1, 2, 3))


def calibrated(model, **imperfections):
    """A calibration of an RV-M2 whose determined parameters err, and its arm."""
    robot = ta.Robot.load("rv-m2")
    q = VirtualArm(robot).poses(POSES)
    exact = VirtualArm(robot, imperfections=Imperfections(length_mm=0.0, angle_deg=0.0, share=0.0))
    determined = ta.calibrate(robot, exact.measure(q), model="constant").identifiability.determined
    errors = Imperfections(share=0.0, noise_mm=0.03, **imperfections)
    arm = VirtualArm(robot, seed=4, imperfections=errors, parameters=determined)
    return ta.calibrate(robot, arm.measure(q), model=model), arm


def off_by(calibration, arm):
    """How far each constant is from that of the arm, SI."""
    place = dict(zip(calibration.arm.candidates.names, calibration.arm.candidates.columns, strict=True))
    found = np.ravel(calibration.models[CONSTANT].constants) - np.ravel(calibration.arm.table)
    chosen = [place[name] for name in calibration.constant.names]
    links = arm.errors[-arm.robot.joint_count :]
    return found[chosen] - np.ravel(links)[chosen]


def root_mean_square(values):
    return float(np.sqrt(np.square(values).mean()))


@pytest.fixture(scope="module")
def yielding():
    return calibrated("variable", deflection=GIVES_WAY, joint_errors=RUNS_OUT)


def test_constants_are_as_far_off_as_told_where_joints_give_way(yielding):
    calibration, arm = yielding
    errors = off_by(calibration, arm)
    details = calibration.constant
    alone = of_covariance(details.covariance, len(details.names))
    assert root_mean_square(errors / alone) > 2.0, "else what varies moved no constant"
    assert 0.3 < root_mean_square(errors / details.standard_errors) < 1.5
    assert np.abs(errors / details.standard_errors).max() < 3.0


def test_of_a_rigid_arm_they_are_not_far_too_large():
    calibration, arm = calibrated("variable")
    assert 0.15 < root_mean_square(off_by(calibration, arm) / calibration.constant.standard_errors) < 1.5


def test_without_a_field_they_are_those_of_the_fit():
    calibration, arm = calibrated("constant")
    details = calibration.constant
    np.testing.assert_array_equal(
        details.standard_errors, np.sqrt(np.diagonal(details.covariance)[: len(details.names)])
    )
    assert 0.5 < root_mean_square(off_by(calibration, arm) / details.standard_errors) < 1.5


@pytest.mark.parametrize(("slip_m", "least", "most"), [(5e-5, 0.8, 1.1), (0.0, 0.5, 0.65)])
def test_three_targets_tell_as_much_as_one_of_what_they_have_in_common(slip_m, least, most):
    """Where each errs for itself they tell as three measurements do."""
    arm = VirtualArm(ta.Robot.load("rv-m2"), imperfections=Imperfections(share=0.0, noise_mm=0.01))
    q, place = arm.poses(40), arm.target_in_flange
    slips = slip_m * np.random.default_rng(0).normal(size=(len(q), 3))
    points = []
    for seed, shift in enumerate(0.02 * np.eye(3)):
        arm.target_in_flange = place + shift
        points.append(arm.measure(q, seed=seed).targets[:, 0] + slips)
    wide = replace(arm.measure(q), targets=np.stack(points, axis=1))
    alone = replace(wide, targets=wide.targets[:, :1])
    three, one = (ta.calibrate(arm.robot, rows, model="constant").constant for rows in (wide, alone))
    errors = [dict(zip(each.names, each.standard_errors, strict=True)) for each in (three, one)]
    ratios = [errors[0][name] / errors[1][name] for name in one.names]
    assert least < np.median(ratios) < most


def test_a_file_keeps_them(yielding, tmp_path):
    calibration, _ = yielding
    calibration.save(tmp_path / "arm.calib", with_rows=False)
    again = ta.Calibration.load(tmp_path / "arm.calib")
    np.testing.assert_array_equal(again.constant.standard_errors, calibration.constant.standard_errors)


def test_a_file_of_an_earlier_version_has_those_of_its_covariance(yielding):
    calibration, _ = yielding
    arrays, content = calibration_content.pack(calibration, with_rows=False)
    del arrays["constant.standard_errors"]
    stored = json.loads(json.dumps(content))
    found = calibration_content.unpack(arrays, stored, where="an old file")["constant"]
    np.testing.assert_array_equal(found.standard_errors, of_covariance(found.covariance, len(found.names)))


def test_an_update_from_few_poses_makes_those_of_new_offsets_larger_and_keeps_the_others(yielding):
    calibration, arm = yielding
    shift = np.array([0.0, 0.05, 0.0, 0.0, 0.0])
    found = ta.update(calibration, remastered(arm, arm.poses(10, seed=9), shift, seed=5)).calibration
    before = dict(zip(calibration.constant.names, calibration.constant.standard_errors, strict=True))
    after = dict(zip(found.constant.names, found.constant.standard_errors, strict=True))
    assert after["theta2"] > before["theta2"]
    assert after["a2"] == before["a2"]
