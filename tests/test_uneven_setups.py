"""Set-ups of different instruments that state no sigma are told, with the figure to state."""

import re
from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from truearm.doubts.uneven_setups import UNEVEN_SETUPS
from truearm.reporting.report import report
from truearm.simulation import Imperfections, VirtualArm

TRACKER, CAMERA = 40, 30


@pytest.fixture(scope="module")
def arm():
    plain = Imperfections(share=0.0, noise_mm=0.02)
    return VirtualArm(ta.Robot.load("ur10"), seed=4, imperfections=plain)


def told(arm, camera_mm, stated_mm=None, **options):
    """What a calibration from a tracker and a camera with so much more noise says of the two."""
    readings = arm.poses(TRACKER + CAMERA)
    data = arm.measure(readings)
    extra = 1e-3 * camera_mm * np.random.default_rng(1).normal(size=(CAMERA, 1, 3))
    targets = data.targets + np.concatenate([np.zeros((TRACKER, 1, 3)), extra])
    sigma = None if stated_mm is None else np.repeat([0.0, 1e-3 * stated_mm], [TRACKER, CAMERA])
    group = np.repeat(["tracker", "camera"], [TRACKER, CAMERA])
    data = replace(data, targets=targets, sigma_m=sigma, group=group)
    found = ta.calibrate(arm.robot, data, drift="none", refit=False, holdout=0.1, **options)
    return next((str(notice) for notice in found.notices if notice.kind == UNEVEN_SETUPS), ""), found


@pytest.mark.parametrize("model", ["variable", "constant"])
def test_an_instrument_that_scatters_more_is_told_with_the_sigma_to_state(arm, model):
    said, found = told(arm, camera_mm=0.5, model=model)
    assert "camera" in said
    assert "sigma_mm" in said
    assert ("--model variable" in said) == (model == "constant")
    about = re.search(r"about ([\d.]+) mm in the rows of camera", said)
    assert about is not None
    # What varies with the pose takes up some of so much noise.
    assert float(about[1]) < 0.75
    if model == "constant":
        assert float(about[1]) > 0.25
        assert said in {advice.words for advice in report(found).advice}


def test_where_it_is_stated_nothing_is_told(arm):
    assert told(arm, camera_mm=0.5, stated_mm=0.5)[0] == ""


def test_set_ups_that_scatter_alike_are_not_told(arm):
    assert told(arm, camera_mm=0.0)[0] == ""
