"""What is told of a calibration from several set-ups does not depend on which of them comes first."""

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm.simulation import Imperfections, VirtualArm

EACH = 30
COARSE_MM = 0.3
LEVER_M = 0.6


@pytest.fixture(scope="module")
def both():
    """Calibrations from two set-ups of as many rows, in either order: one is coarse, with a longer lever."""
    wearing = Imperfections(share=0.0, noise_mm=0.01, repeatability_deg=0.01)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4, imperfections=wearing)
    near = arm.measure_table(arm.poses(EACH))
    arm.target_in_flange = arm.target_in_flange + np.array([0.0, 0.0, LEVER_M])
    far = arm.measure_table(arm.poses(EACH, seed=1), seed=1)
    far[["x", "y", "z"]] += 1e-3 * COARSE_MM * np.random.default_rng(0).normal(size=(EACH, 3))
    parts = [
        part.assign(group=name, sigma_mm=sigma, purpose=["train", "train", "validate"] * 10)
        for part, name, sigma in ((near, "near", 0.01), (far, "far", COARSE_MM))
    ]
    return arm, [_calibrated(arm, order) for order in (parts, parts[::-1])]


def _calibrated(arm, parts):
    rows = ta.Measurements.from_dataframe(pd.concat(parts, ignore_index=True))
    return ta.calibrate(arm.robot, rows, drift="none", refit=False)


def test_what_is_left_is_that_of_all_targets(both):
    _, (first, second) = both
    assert first.summary["noise_mm"] == pytest.approx(second.summary["noise_mm"], rel=1e-4)


def test_standard_deviations_are_those_of_the_surest_set_up(both):
    arm, (first, second) = both
    readings = arm.poses(10, seed=9)
    np.testing.assert_allclose(first.position_std(readings), second.position_std(readings), rtol=1e-4)
