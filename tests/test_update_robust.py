"""An update of constants by a robust loss compares with how far their rows scatter, not with their median."""

import numpy as np
import pytest

import truearm as ta
from truearm.simulation import Imperfections, VirtualArm

COARSE_M, FINE_M = 3e-4, 5e-5


def measured(arm, count, seed):
    """Poses of which every third is coarse, and none says so."""
    table = arm.measure_table(arm.poses(count, seed=seed), seed=seed)
    size = np.where(np.arange(count) % 3, FINE_M, COARSE_M)[:, None]
    table[["x", "y", "z"]] += size * np.random.default_rng(seed).normal(size=(count, 3))
    return ta.Measurements.from_dataframe(table)


def test_a_robust_loss_does_not_make_an_update_compare_with_a_median():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=2, imperfections=Imperfections(share=0.0, noise_mm=0.02))
    left = {}
    for robust in ("none", "cauchy"):
        found = ta.calibrate(arm.robot, measured(arm, 60, 1), model="constant", robust=robust)
        again = ta.Calibration.from_bytes(found.to_bytes(), where="a test")
        told = ta.update(again, measured(arm, 15, 2))
        left[robust] = told.rest.squares / told.rest.freedom, found.constant
    (squares, plain), (robustly, median) = left.values()
    assert median.scale is not None
    assert robustly < 1.2 * squares
    assert median.noise_m < 0.7 * plain.noise_m
    assert median.noise_m * median.scale.widened == pytest.approx(plain.noise_m, rel=0.35)
