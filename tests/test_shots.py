"""Shots of a pose that share what the arm did not repeat are no measurements of their own."""

import numpy as np
import pytest

import truearm as ta
from truearm.shots import KIND
from truearm.simulation import Imperfections, VirtualArm


@pytest.mark.parametrize(
    ("shots", "slip_m", "model", "told"),
    [
        (4, 5e-5, "constant", True),
        (4, 0.0, "constant", False),
        (1, 5e-5, "constant", False),
        (4, 5e-5, "variable", False),
    ],
)
def test_constants_alone_take_shots_for_poses_and_say_so(shots, slip_m, model, told):
    arm = VirtualArm.paper(seed=2, imperfections=Imperfections(share=0.0, noise_mm=0.005))
    table, rng = arm.measure_table(np.repeat(arm.poses(30), shots, axis=0)), np.random.default_rng(1)
    table[["x", "y", "z"]] += np.repeat(slip_m * rng.normal(size=(30, 3)), shots, axis=0)
    found = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model=model)
    notices = [str(notice) for notice in found.notices if notice.kind == KIND]
    assert bool(notices) == told
    assert not told or ("agree within 0.005" in notices[0] and "up to 2.0 times too small" in notices[0])
