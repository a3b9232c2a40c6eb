"""Instruments that are read several times at each pose."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm._core import CoreError, same_poses
from truearm.measurements import Measurements
from truearm.reporting.facts import Facts
from truearm.reporting.parts import Figure
from truearm.reporting.repeats import Repeats, repeats
from truearm.simulation import Imperfections, VirtualArm
from truearm.splitting import SplitRule, split_rows
from truearm.summary import noise_mm
from truearm.validation import Validation
from truearm.visits import means, one_row_a_visit

POSES, SHOTS = 60, 3
NOT_REPEATED_MM, OF_A_SHOT_M, STILL_RAD = 0.04, 2e-6, 2e-5


def shots_of(once, seed=5):
    """Each row so many times, with the noise of a shot and of readings of an arm that stands still."""
    rng = np.random.default_rng(seed)
    table = once.loc[once.index.repeat(SHOTS)].reset_index(drop=True)
    joints = [name for name in table.columns if name.startswith("q")]
    table[joints] += STILL_RAD * rng.normal(size=(len(table), len(joints)))
    table[["x", "y", "z"]] += OF_A_SHOT_M * rng.normal(size=(len(table), 3))
    return Measurements.from_dataframe(table, name="shots")


@pytest.fixture(scope="module")
def arm():
    return VirtualArm.paper(seed=6, imperfections=Imperfections(noise_mm=NOT_REPEATED_MM))


@pytest.fixture(scope="module")
def measured(arm):
    once = arm.measure_table(arm.poses(POSES))
    return Measurements.from_dataframe(once, name="once"), shots_of(once)


@pytest.fixture(scope="module")
def calibration(arm, measured):
    return ta.calibrate(arm.robot, measured[1])


def test_rows_of_one_pose_are_known_by_their_readings():
    joints = np.array([[0.0, 1.0], [2.0, 1.0], [2e-4, 1.0 - 2e-4], [4e-4, 1.0], [2.0, 1.0]])
    found = same_poses(joints, np.zeros(5, dtype=np.int64))
    np.testing.assert_array_equal(found, [0, 1, 0, 3, 1])
    apart = same_poses(joints, np.array([0, 0, 1, 0, 1]))
    np.testing.assert_array_equal(apart, [0, 1, 2, 3, 4])
    with pytest.raises(CoreError, match="groups of rows"):
        same_poses(joints, np.zeros(4, dtype=np.int64))


@pytest.mark.parametrize("seed", range(5))
def test_shots_stay_on_one_side(measured, seed):
    split = split_rows(measured[1], SplitRule(seed=seed))
    assert not set(split.train // SHOTS) & set(split.holdout // SHOTS)


def test_a_pose_that_is_come_back_to_later_is_split_like_others(arm):
    once = arm.measure_table(arm.poses(POSES))
    joints = [name for name in once.columns if name.startswith("q")]
    again = once.assign(**{name: once[name] + STILL_RAD for name in joints})
    split = split_rows(Measurements.from_dataframe(pd.concat([once, again])), SplitRule())
    assert set(split.train % POSES) & set(split.holdout % POSES)


def test_what_the_arm_did_not_repeat_is_not_taken_for_the_field(arm, measured, calibration):
    test = arm.measure(arm.poses(400, seed=9), seed=9)

    def error(found):
        return ta.evaluate(found, test).errors["variable"].position.mean

    assert error(calibration) < 1.05 * error(ta.calibrate(arm.robot, measured[0]))
    assert noise_mm(calibration) == pytest.approx(NOT_REPEATED_MM, rel=0.5)


def test_held_out_poses_are_counted_not_their_shots(calibration):
    validation = calibration.validation
    assert validation.n_holdout == SHOTS * validation.n_holdout_poses == SHOTS * 18
    assert validation.poses_judged == "18 held-out poses (54 rows)"
    assert validation.few.startswith("The errors above come from 18 held-out poses")
    assert Validation.from_dict(validation.to_dict()) == validation
    assert validation.poses_trained == "42 training poses (126 rows)"
    older = {key: value for key, value in validation.to_dict().items() if not key.endswith("_poses")}
    assert Validation.from_dict(older).n_holdout_poses == validation.n_holdout
    assert Validation.from_dict(older).n_train_poses == validation.n_train


def test_the_report_tells_shots_from_poses_that_were_come_back_to(arm, measured, calibration):
    (figure,) = (part for part in repeats(Facts(calibration)).parts if isinstance(part, Figure))
    assert f"{SHOTS * POSES} measurements of {POSES} poses" in figure.says
    assert "All of the repeats came right after another measurement" in figure.says
    once = arm.measure_table(arm.poses(POSES))
    again = pd.concat([once, arm.measure_table(arm.poses(POSES), seed=8)], ignore_index=True)
    later = ta.calibrate(arm.robot, Measurements.from_dataframe(again))
    (figure,) = (part for part in repeats(Facts(later)).parts if isinstance(part, Figure))
    assert f"{2 * POSES} measurements of {POSES} poses" in figure.says
    assert "right after another" not in figure.says


def test_jitter_while_the_arm_stands_is_no_approach_and_no_scatter(calibration):
    found = Repeats.of(Facts(calibration))
    assert found is not None
    sides = [np.unique(found.approach[mine], axis=0) for mine in found.poses()]
    assert all(len(side) == 1 for side in sides)
    expected = 1e3 * OF_A_SHOT_M * np.sqrt(8.0 / np.pi)
    assert (found.widened() * found.distances_mm()).mean() == pytest.approx(expected, rel=0.15)


def test_poses_that_others_lie_between_did_not_stay(arm):
    once = arm.measure_table(arm.poses(POSES))
    reference = arm.measure_table(np.repeat(arm.poses(1, seed=4), POSES, axis=0), seed=5)
    between = pd.concat([once, reference]).sort_index(kind="stable").reset_index(drop=True)
    twice = arm.measure_table(np.repeat(arm.poses(POSES), 2, axis=0))
    planned = twice.assign(purpose=["train", "repeat"] * POSES)
    for table, words in ((between, "reference"), (planned, "planned")):
        data = Measurements.from_dataframe(table, name=words)
        found = Repeats.of(Facts(ta.calibrate(arm.robot, data, refit=words == "planned", holdout=0.3)))
        assert found is not None
        assert not found.stayed.any(), words


def test_shots_that_share_what_is_left_are_no_drift(calibration):
    assert calibration.validation.drift is None


def test_a_visit_is_the_mean_of_its_rows(measured):
    _, shots = measured
    found = one_row_a_visit(shots)
    assert found.rows.tolist() == shots.rows[::SHOTS].tolist()
    points = shots.targets.reshape(POSES, SHOTS, 1, 3).mean(axis=1)
    np.testing.assert_allclose(found.targets, points, rtol=0.0, atol=1e-15)
    stated = replace(shots, sigma_m=np.full(len(shots), 3e-5))
    sigma = one_row_a_visit(stated).sigma_m
    assert sigma is not None
    np.testing.assert_allclose(sigma, 3e-5 / np.sqrt(SHOTS))
    assert one_row_a_visit(found) is found


def test_turns_of_a_visit_are_averaged_whatever_their_sign():
    quaternion = np.array([0.5, -0.5, 0.5, 0.5])
    table = {"q1": [0.1] * 2, **dict.fromkeys("xyz", [1.0] * 2)}
    names = ("qw", "qx", "qy", "qz")
    turned = {name: [value, -value] for name, value in zip(names, quaternion, strict=True)}
    data = Measurements.from_dataframe(pd.DataFrame({**table, **turned}))
    found = one_row_a_visit(data)
    assert found.orientations is not None
    np.testing.assert_allclose(np.abs(found.orientations[0] @ quaternion), 1.0)


def test_rows_without_weight_do_not_count_in_a_visit():
    values, visits = np.array([[1.0], [2.0], [30.0], [4.0]]), np.array([0, 0, 0, 1])
    np.testing.assert_allclose(means(values, visits, np.array([1.0, 1.0, 0.0, 1.0])), [[1.5], [4.0]])


def test_an_update_sees_poses_not_shots(arm, calibration):
    new = shots_of(arm.measure_table(arm.poses(15, seed=31), seed=31), seed=32)
    found = ta.update(calibration, new)
    assert found.n_poses == 15
    assert 1e-3 < found.rest.p < 1.0 - 1e-6
    assert found.verdict == "holds"
