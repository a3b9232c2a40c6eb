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


def told(arm, camera_mm, stated_mm=None, shots=1, gross_mm=0.0, **options):
    """What a calibration from a tracker, one reading a pose, and a camera with so much more noise and shots
    says of the two, with a row of the camera that is off.
    """
    count = TRACKER + CAMERA
    readings = np.repeat(arm.poses(count), np.repeat([1, shots], [TRACKER, CAMERA]), axis=0)
    camera = np.arange(len(readings)) >= TRACKER
    data = arm.measure(readings)
    extra = 1e-3 * camera_mm * np.random.default_rng(1).normal(size=(CAMERA * shots, 1, 3))
    targets = data.targets.copy()
    targets[camera] += extra
    targets[-5, 0, 0] += 1e-3 * gross_mm
    sigma = None if stated_mm is None else 1e-3 * stated_mm * camera
    data = replace(data, targets=targets, sigma_m=sigma, group=np.where(camera, "camera", "tracker"))
    found = ta.calibrate(arm.robot, data, drift="none", refit=False, holdout=0.1, **options)
    return next((str(notice) for notice in found.notices if notice.kind == UNEVEN_SETUPS), ""), found


def to_state(said):
    """The sigma that rows of the camera are to state, mm."""
    about = re.search(r"about ([\d.]+) mm in the rows of camera", said)
    assert about is not None
    return float(about[1])


@pytest.mark.parametrize("model", ["variable", "constant"])
def test_an_instrument_that_scatters_more_is_told_with_the_sigma_to_state(arm, model):
    said, found = told(arm, camera_mm=0.5, model=model)
    assert "camera" in said
    assert "sigma_mm" in said
    assert ("--model variable" in said) == (model == "constant")
    # What varies with the pose takes up some of so much noise.
    assert to_state(said) < 0.75
    if model == "constant":
        assert to_state(said) > 0.25
        assert said in {advice.words for advice in report(found).advice}


def test_where_it_is_stated_nothing_is_told(arm):
    assert told(arm, camera_mm=0.5, stated_mm=0.5)[0] == ""


def test_set_ups_that_scatter_alike_are_not_told(arm):
    assert told(arm, camera_mm=0.0)[0] == ""


def test_shots_of_a_pose_are_no_other_instrument(arm):
    assert told(arm, camera_mm=0.0, shots=8, model="constant")[0] == ""


def test_what_each_shot_has_to_state_is_told(arm):
    assert to_state(told(arm, camera_mm=0.5, shots=4, model="constant")[0]) == pytest.approx(0.5, rel=0.3)


@pytest.mark.parametrize("camera_mm", [0.0, 0.5])
def test_an_outlier_does_not_make_an_instrument_worse_nor_hide_one(arm, camera_mm):
    said, found = told(arm, camera_mm, gross_mm=10.0, model="constant")
    assert bool(said) == (camera_mm > 0.0)
    assert report(found).advice[0].kind == "outliers"
