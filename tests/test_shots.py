"""Shots of a pose that share what the arm did not repeat are no measurements of their own."""

import numpy as np
import pytest

import truearm as ta
from truearm.fits.scheme_options import SchemeOptions
from truearm.rows.shots import Scatter, variance_factor
from truearm.rows.visits import one_row_a_pose
from truearm.simulation import Imperfections, VirtualArm

SHOTS = 4


def measured(arm, slip_m, poses=30, shots=SHOTS, seed=0):
    """Rows (poses x shots) of an arm that misses its pose by so much, once for all shots."""
    table = arm.measure_table(np.repeat(arm.poses(poses), shots, axis=0), seed=seed)
    slips = slip_m * np.random.default_rng(seed).normal(size=(poses, 3))
    table[["x", "y", "z"]] += np.repeat(slips, shots, axis=0)
    return ta.Measurements.from_dataframe(table)


def changes(arm, slip_m, shots):
    """Changes (k,) of constants of one arm from one calibration to the next, in standard errors of both."""
    both = [
        ta.calibrate(arm.robot, measured(arm, slip_m, shots=shots, seed=seed), model="constant", refit=True)
        for seed in (1, 2)
    ]
    one, other = (each.models["constant"].constants.ravel() for each in both)
    columns = both[0].arm.candidates.columns
    place = [columns[both[0].arm.candidates.names.index(name)] for name in both[0].constant.names]
    return (other - one)[place] / np.hypot(*(each.constant.standard_errors for each in both))


@pytest.mark.parametrize(("shots", "slip_m"), [(SHOTS, 5e-5), (SHOTS, 0.0), (1, 5e-5)])
def test_constants_of_an_unchanged_arm_differ_by_their_standard_errors(shots, slip_m):
    arm = VirtualArm.paper(seed=2, imperfections=Imperfections(share=0.0, noise_mm=0.005))
    found = changes(arm, slip_m, shots)
    assert 0.5 < np.sqrt(np.square(found).mean()) < 1.4


def test_the_variances_of_poses_and_shots_are_told_apart():
    rng, poses = np.random.default_rng(0), np.repeat(np.arange(400), 5)
    missed = 0.3 * rng.normal(size=(400, 3))[poses] + 0.1 * rng.normal(size=(2000, 3))
    missed[::7, 1] = np.nan
    found = Scatter.of(missed, poses)
    assert np.sqrt([found.shared, found.own]) == pytest.approx([0.3, 0.1], rel=0.05)
    assert found.counts(poses) == pytest.approx(np.full(2000, 1.0 / (1.0 + 4.0 * 0.9)), rel=0.05)
    assert variance_factor(missed / np.sqrt(0.1), poses, 0) == pytest.approx(4.6, rel=0.1)
    assert variance_factor(missed, np.arange(2000), 0) == 1.0


def test_a_pose_is_the_mean_of_its_shots_whenever_they_were_measured():
    arm = VirtualArm.paper(seed=2)
    cycles = arm.measure(np.tile(arm.poses(6), (SHOTS, 1)), orientation=True)
    found = one_row_a_pose(cycles)
    np.testing.assert_allclose(found.targets, cycles.targets.reshape(SHOTS, 6, 1, 3).mean(axis=0))
    assert len(found) == 6


def test_schemes_count_shots_of_a_pose_once():
    arm = VirtualArm.paper(seed=2, imperfections=Imperfections(noise_mm=0.002))
    data = measured(arm, 5e-5, poses=60)
    found = ta.calibrate(arm.robot, data, model="regions", scheme=SchemeOptions(region_rows=30), refit=False)
    assert found.scheme is not None
    assert found.scheme.regions == 1
    assert found.validation.holdout["regions"].position.mean == pytest.approx(
        found.validation.holdout["constant"].position.mean, rel=0.05
    )
