"""Poses that find the frame of an evaluation are not judged, and what they leave uncertain is told."""

import re

import numpy as np
import pytest

import truearm as ta
from truearm.frame_share import FRAME_UNCERTAIN
from truearm.simulation import Imperfections, VirtualArm

UR10 = ta.Robot.load("ur10")
IMPERFECTIONS = Imperfections(noise_mm=0.02, repeatability_mm=0.03)


def arm_of(seed):
    return VirtualArm(UR10, seed=seed, imperfections=IMPERFECTIONS)


@pytest.fixture(scope="module")
def known():
    arm = arm_of(5)
    return arm, ta.calibrate(UR10, arm.measure(arm.poses(80, seed=1)), model="constant")


def uncertain(found):
    return [str(notice) for notice in found.notices if notice.kind == FRAME_UNCERTAIN]


@pytest.mark.parametrize("cycles", [False, True])
def test_shots_of_a_pose_are_on_one_side(known, cycles):
    _, calibration = known
    other = arm_of(6)
    poses = other.poses(10, seed=9)
    q = np.tile(poses, (6, 1)) if cycles else np.repeat(poses, 6, axis=0)
    data = other.measure(q, seed=4)
    found = ta.evaluate(calibration, data)
    assert (found.n_frame, found.n_frame_poses) == (36, 6)
    assert (found.n_judged, found.n_judged_poses) == (24, 4)
    assert repr(found).startswith("<Evaluation: frame of 6 poses (36 rows), 4 poses (24 rows) judged; ")
    assert found.errors["constant"].position.mean > 1.0
    assert "not_as_calibrated" in {notice.kind for notice in found.notices}
    assert ta.evaluate(calibration, data, frame_rows=25).n_frame == 30
    with pytest.raises(
        ta.InputError, match=r"9 measured values in 3 frame poses \(18 rows\).*--frame-rows 24"
    ):
        ta.evaluate(calibration, data, frame_rows=18)


@pytest.mark.parametrize("shots", [1, 5])
def test_too_few_poses_are_refused_with_what_is_needed(known, shots):
    arm, calibration = known
    few, enough = (arm.measure(np.repeat(arm.poses(n, seed=2), shots, axis=0)) for n in (6, 7))
    words = (
        'of set-up "data". At least 4 poses find its frame, and 3 must be left to judge. Measure at least 7'
    )
    with pytest.raises(ta.InputError, match=words):
        ta.evaluate(calibration, few)
    assert ta.evaluate(calibration, enough).n_judged_poses == 3


def test_what_an_uncertain_frame_adds_is_told_and_is_that(known):
    arm, calibration = known
    many = ta.evaluate(calibration, arm.measure(arm.poses(300, seed=2), seed=2))
    assert not uncertain(many)
    true_mm = many.errors["constant"].position.mean
    found = [
        ta.evaluate(calibration, arm.measure(arm.poses(12, seed=s), seed=s), frame_rows=4) for s in range(9)
    ]
    told = [re.search(r"about (\d+) % of .* about ([\d.]+) mm", *uncertain(each)) for each in found]
    means = [each.errors["constant"].position.mean for each in found]
    assert np.median(means) > 1.3 * true_mm
    assert np.median([float(each[2]) for each in told if each]) == pytest.approx(true_mm, rel=0.3)


def test_shots_that_scatter_by_themselves_find_the_frame_better():
    exact = Imperfections(share=0.0, noise_mm=0.5)
    arm = VirtualArm(UR10, seed=5, imperfections=exact)
    perfect = ta.calibrate(UR10, arm.measure(arm.poses(200, seed=1)), model="constant")
    data = arm.measure(np.repeat(arm.poses(12, seed=3), 20, axis=0), seed=3)
    assert not uncertain(ta.evaluate(perfect, data))
    assert uncertain(ta.evaluate(perfect, arm.measure(arm.poses(12, seed=3), seed=3)))
