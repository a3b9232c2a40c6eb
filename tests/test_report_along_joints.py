"""Errors of the report along the joints and in space: what is told beyond chance, and what is counted."""

import re

import numpy as np
import pytest

import truearm as ta
from tests.report_support import figures_of, words_of
from truearm.reporting.along_joints import AlongJoints
from truearm.reporting.quiver import shared_direction
from truearm.reporting.report import report
from truearm.simulation import Imperfections, VirtualArm

SETS = 40
JOINTS = 6


def named(count, worse=1.0):
    """What is said along joint 3 of sets of so many random errors, and how many sets have a stretch of any
    joint named: with joint 3 above 60 deg of 90 they are `worse` times as large.
    """
    rng, along_third, with_any = np.random.default_rng(1), [], 0
    for _ in range(SETS):
        readings = rng.uniform(0.0, 90.0, (count, JOINTS))
        errors = np.linalg.norm(rng.normal(size=(count, 3)), axis=1)
        errors *= np.where(readings[:, 2] > 60.0, worse, 1.0)
        along = AlongJoints(readings, {"variable": errors}, ("deg",) * JOINTS, "variable")
        says = [along.where(joint) for joint in range(JOINTS)]
        along_third.append(says[2])
        with_any += any(words.startswith("Largest between") for words in says)
    return along_third, with_any


@pytest.mark.parametrize("count", [36, 75, 120])
def test_noise_alone_hardly_has_a_stretch_named(count):
    assert named(count)[1] <= 2


def test_a_stretch_whose_errors_are_twice_as_large_is_named():
    says, _ = named(120, worse=2.0)
    found = [re.match(r"Largest between (\d+) and \d+ deg", words) for words in says]
    low = [int(match[1]) for match in found if match]
    assert len(low) >= 0.9 * SETS
    assert min(low) >= 55


def test_a_pose_counts_once_along_the_joints_however_often_it_was_measured():
    """Some are measured 20 times: the poses make too few stretches, where rows would make enough."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1, imperfections=Imperfections(share=0.0, noise_mm=0.05))
    poses = arm.poses(60)
    readings = np.vstack([poses, np.repeat(poses[:6], 19, axis=0)])
    found = ta.calibrate(arm.robot, arm.measure(readings), model="constant", drift="none")
    held = found.held
    assert held is not None
    assert len(held) // 8 >= 3
    made = report(found)
    says = dict(made.figures)["Error along joint 2"]
    assert says.startswith("Too few poses to compare stretches of the joint")
    titles = [title for title, _ in made.figures]
    dots = figures_of(made.html)["figures"][titles.index("Error along joint 2")]["traces"][-1]
    q, place, counts = np.unique(
        np.degrees(held.readings[:, 1]).round(6), return_inverse=True, return_counts=True
    )
    assert len(q) == found.validation.n_holdout_poses
    order = np.argsort(dots["x"])
    assert np.array(dots["x"])[order] == pytest.approx(q, abs=0.06)
    means = np.bincount(place, 1e3 * held.errors["constant"].distance_m) / counts
    assert np.array(dots["y"])[order] == pytest.approx(means, rel=1e-3)
    missed = 1e3 * held.errors["constant"].position
    mean = np.linalg.norm([(np.bincount(place, each) / counts).mean() for each in missed.T])
    assert (
        f"mean of its error vectors is {mean:.3f} mm long" in dict(made.figures)["Errors in space, enlarged"]
    )
    assert "A pose that was measured several times has their mean." in words_of(made.html)


@pytest.mark.parametrize("count", [2, 6, 12, 18, 30, 100])
@pytest.mark.parametrize("across", [1.0, 0.05])
def test_random_errors_hardly_share_a_direction(count, across):
    rng = np.random.default_rng(2)
    sets = rng.normal(size=(1000, count, 3)) * [1.0, across, across]
    said = [shared_direction(vectors) for vectors in sets]
    assert said.count("share a direction") <= 25


def test_errors_with_a_part_in_common_share_a_direction():
    vectors = np.random.default_rng(2).normal([1.5, 0.0, 0.0], 1.0, (30, 3))
    assert shared_direction(vectors) == "share a direction"
    assert shared_direction(vectors[:5]) == "share no direction beyond chance"
