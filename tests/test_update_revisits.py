"""Updates from poses that were visited more than once: a looped program, or there and back."""

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from tests.remastered import remastered, remastered_table
from truearm.errors import TooFewError
from truearm.simulation import Imperfections, VirtualArm
from truearm.updating.revisits import UNSEEN, Apart

NOISE = 4.0


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(ta.Robot.load("ur10"), seed=0, imperfections=Imperfections(noise_mm=0.02))


@pytest.fixture(scope="module")
def constant(arm):
    """Constants, which leave far more of each pose than its visits differ by."""
    return ta.calibrate(arm.robot, arm.measure(arm.poses(60, seed=1), seed=1), model="constant")


def looped(arm, poses, times):
    return np.tile(arm.poses(poses, seed=70), (times, 1))


def test_what_constants_leave_of_a_pose_its_visits_share(arm, constant):
    once, often = (ta.update(constant, arm.measure(looped(arm, 6, times))) for times in (1, 8))
    assert (once.verdict, often.verdict) == ("holds", "holds")
    assert (often.n_poses, often.rest.freedom) == (6, once.rest.freedom)
    assert often.after.position.mean > 0.8 * once.after.position.mean
    validation = often.calibration.validation
    assert (validation.n_holdout_poses, validation.n_holdout) == (6, 48)


def test_four_poses_are_too_few_however_often_they_are_visited(arm, constant):
    with pytest.raises(TooFewError, match="12 measured values in 4 poses cannot tell 15 unknowns"):
        ta.update(constant, arm.measure(looped(arm, 4, 10)))


def test_noise_that_a_field_took_for_its_own_contradicts_no_visit():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=5, imperfections=Imperfections(noise_mm=0.02))
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(40, seed=6), seed=6), drift="none")
    there = looped(arm, 12, 1)
    back = ta.update(calibration, arm.measure(np.concatenate([there, there[::-1]])))
    assert (back.verdict, back.n_poses, back.outliers) == ("holds", 12, ())


def test_what_moved_is_found_among_visits(arm, constant):
    poses = looped(arm, 14, 2)
    turned = ta.update(constant, remastered(arm, poses, np.array([0, 0.03, 0, 0, 0, 0]), seed=3))
    assert [offset.joint for offset in turned.offsets if offset.moved] == [2]
    slipped = ta.update(constant, remastered(arm, poses, np.zeros(6), tool_mm=(0.3, 0.0, 0.0), seed=3))
    assert (slipped.verdict, slipped.tools[0].moved) == ("moved", True)


def test_a_visit_that_no_other_supports_is_left_out_alone(arm, constant):
    table = arm.measure_table(looped(arm, 12, 3))
    table.loc[17, "x"] += 0.004
    found = ta.update(constant, ta.Measurements.from_dataframe(table))
    assert (found.outliers, found.n_poses, found.verdict) == ((18,), 12, "holds")
    assert found.calibration.validation.n_holdout == 35


def test_a_target_that_slips_between_two_rounds_is_told(arm, constant):
    poses = looped(arm, 14, 1)
    first, then = (
        remastered_table(arm, poses, np.zeros(6), seed=3, tool_mm=(0.0, way, 0.0)) for way in (0.0, 1.5)
    )
    found = ta.update(constant, ta.Measurements.from_dataframe(pd.concat([first, then], ignore_index=True)))
    assert found.changed_meanwhile
    assert str(found.notices[0]).startswith("Between row 14 and row 15 ")


def test_poses_that_took_turns_are_no_step_in_time(arm, constant):
    rounds = [np.tile(arm.poses(7, seed=80 + block), (4, 1)) for block in range(2)]
    found = ta.update(constant, arm.measure(np.concatenate(rounds), seed=3))
    assert (found.verdict, found.changed_meanwhile) == ("holds", False)


def test_play_that_no_calibration_expects_is_no_noise_of_visits(arm, constant):
    there = looped(arm, 12, 1)
    poses = np.concatenate([there, there[::-1]])
    way = np.random.default_rng(1).choice([-1.0, 1.0], len(poses))
    table = arm.measure_table(poses + np.radians([[0, 0.05, 0, 0, 0, 0]]) * way[:, None])
    for joint, column in enumerate(poses.T, start=1):
        table[f"q{joint}"] = column
    assert ta.update(constant, ta.Measurements.from_dataframe(table)).verdict == "field"


def scattered(visits, deviation):
    rng = np.random.default_rng(3)
    poses = np.repeat(np.arange(40), visits)
    return poses, rng.normal(size=(40, 3))[poses] + deviation * rng.normal(size=(len(poses), 3))


@pytest.mark.parametrize(("deviation", "far"), [(0.5, 0.0), (0.5, 1e3), (6.0, 0.0)])
def test_visits_are_as_far_apart_as_most_of_them_are_seen_to_be(deviation, far):
    poses, residual = scattered(3, deviation)
    residual[4] += far
    held, noise = np.ones(residual.shape, dtype=bool), np.full(residual.shape, NOISE)
    apart = Apart.of(residual, held, poses, (noise, np.zeros_like(noise)), np.zeros(3, dtype=bool))
    points, turns = apart.seen
    assert (points, turns) == pytest.approx((deviation**2, 0.0), rel=0.25)
    assert apart.part == pytest.approx(min(deviation**2 / NOISE, 1.0), rel=0.25)


def test_poses_that_were_visited_once_have_all_their_noise():
    poses, residual = scattered(1, 0.5)
    held, noise = np.ones(residual.shape, dtype=bool), np.full(residual.shape, NOISE)
    assert Apart.of(residual, held, poses, (noise, noise), np.zeros(3, dtype=bool)) == UNSEEN


def test_all_shots_of_a_visit_that_is_left_out_are_named(arm, constant):
    table = arm.measure_table(np.repeat(arm.poses(12, seed=70), 3, axis=0))
    table.loc[12:14, "x"] += 0.004
    found = ta.update(constant, ta.Measurements.from_dataframe(table))
    assert found.outliers == (13, 14, 15)
    assert "rows 13, 14 and 15" in str(found.notices[0])
    assert found.n_poses == 12
