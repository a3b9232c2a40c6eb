"""Rows at one pose of a set-up are its shots, whatever they state and whichever points they hold."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from truearm.calibrating import _task
from truearm.fits.fitting import KnownHyper, fit_rows
from truearm.fits.options import CalibrationOptions
from truearm.rotations import matrix_from_quaternion
from truearm.rows.visits import fitted_poses, one_row_a_pose, one_row_a_visit
from truearm.simulation import Imperfections, VirtualArm
from truearm.stages import no_stages

SHOTS, POSES, SHOT_M = 3, 30, 3e-6
SECOND_TARGET_M = np.array([0.08, 0.02, -0.03])
ARM = VirtualArm(
    ta.Robot.load("ur5"), seed=0, imperfections=Imperfections(non_geometric="joint", repeatability_deg=0.004)
)


@pytest.fixture(scope="module")
def shots():
    """Two targets, three shots at each pose that share what the arm did not repeat."""
    once = ARM.measure(ARM.poses(POSES, seed=1), orientation=True)
    assert once.orientations is not None
    second = once.targets[:, 0] + matrix_from_quaternion(once.orientations) @ SECOND_TARGET_M
    targets = np.repeat(np.stack([once.targets[:, 0], second], axis=1), SHOTS, axis=0)
    noise = SHOT_M * np.random.default_rng(5).normal(size=targets.shape)
    again = once.select(np.repeat(np.arange(POSES), SHOTS))
    sigma = np.full(len(again), SHOT_M)
    return replace(again, targets=targets + noise, orientations=None, sigma_m=sigma)


@pytest.fixture(scope="module")
def fit(shots):
    """The fit of rows with the hyper-parameters of a rough fit to the shots."""
    options = CalibrationOptions()
    task = _task(ARM.robot, shots, options, 1, no_stages)
    rough = fit_rows(task, shots, KnownHyper(rough=True)).variable
    assert rough is not None
    known = KnownHyper(rough.hyper)
    return lambda data: fit_rows(task, data, known).variable


def differing(shots, how):
    """The same shots with sigmas read for each, or a target hidden in some."""
    if how == "sigma":
        return replace(shots, sigma_m=shots.sigma_m + 1e-7 * (np.arange(len(shots)) % 2))
    targets = shots.targets.copy()
    targets[1::SHOTS, 1] = np.nan
    return replace(shots, targets=targets)


@pytest.mark.parametrize("how", ["sigma", "hidden"])
def test_shots_are_joined_whatever_differs(shots, fit, how):
    equal, found = fit(shots), fit(differing(shots, how))
    poses = fitted_poses(found.posterior, found.residuals)
    assert np.array_equal(poses, np.repeat(np.arange(POSES) * SHOTS, SHOTS))
    apart = np.linalg.norm(found.residuals - equal.residuals, axis=1)[::SHOTS]
    assert np.median(apart) < SHOT_M


def test_means_are_of_the_rows_that_hold_a_point_by_their_sigma(shots):
    hidden = differing(shots, "hidden")
    for merged in (one_row_a_visit(hidden), one_row_a_pose(hidden)):
        each = shots.targets.reshape(POSES, SHOTS, 2, 3)
        np.testing.assert_allclose(merged.targets[:, 0], each[:, :, 0].mean(axis=1), rtol=1e-12)
        np.testing.assert_allclose(merged.targets[:, 1], each[:, ::2, 1].mean(axis=1), rtol=1e-12)
    sigma = np.tile([SHOT_M, 1.0, 1.0], POSES)
    merged = one_row_a_visit(replace(shots, sigma_m=sigma))
    np.testing.assert_allclose(merged.targets, shots.targets[::SHOTS], atol=1e-9)
    np.testing.assert_allclose(merged.stated_sigma_m, SHOT_M, rtol=1e-6)
