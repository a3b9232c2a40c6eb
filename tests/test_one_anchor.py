"""Distances that all go to one fixed point say nothing of errors across the way to it, and it is said so."""

import numpy as np
import pytest

import truearm as ta
from tests.report_support import words_of
from truearm.reporting.report import report
from truearm.simulation import Imperfections, VirtualArm

ARM = VirtualArm(ta.Robot.load("ur5e"), seed=4, imperfections=Imperfections(share=0.0, noise_mm=0.02))
FAR = np.array([[1.3, -0.4, 0.5], [-0.2, 1.4, 0.3], [0.1, -0.3, 1.6]])
POSES = 60


def to_points(q, number):
    """Distances of poses (n, N) to fixed points, named by their numbers (n,)."""
    table = ARM.measure_table(q)
    points = table[["x", "y", "z"]].to_numpy()
    away = np.linalg.norm(points - points.mean(axis=0) - FAR[number], axis=1)
    return table.drop(columns=["x", "y", "z"]).assign(distance=away, anchor=[f"wire {k}" for k in number])


def measured(anchors):
    """Distances of poses to fixed points in turn."""
    return to_points(ARM.poses(POSES), np.arange(POSES) % anchors)


@pytest.mark.parametrize(("anchors", "told"), [(1, True), (3, False)])
def test_one_fixed_point_is_told(anchors, told):
    found = ta.calibrate(ARM.robot, ta.Measurements.from_dataframe(measured(anchors)), model="constant")
    notices = {notice.kind: notice.message for notice in found.notices}
    assert ("one_anchor" in notices) == told
    assert not told or "(wire 0)" in notices["one_anchor"]
    kinds = {advice.kind for advice in report(found).advice}
    assert ("one_anchor" in kinds) == told
    assert "further_points" not in kinds


def test_further_points_are_advised_where_distances_go_two_ways_and_told_as_distances():
    found = ta.calibrate(ARM.robot, ta.Measurements.from_dataframe(measured(2)), model="constant")
    made = report(found)
    told = {advice.kind: advice.words for advice in made.advice}
    assert "Distances to further fixed points, in other directions" in told["further_points"]
    judged = f"{found.validation.n_holdout} held-out distances"
    assert made.verdict.startswith(f"On {judged} the mean distance error is")
    text = words_of(made.html)
    assert f"Distance errors on {judged}, mm" in text
    assert "mean error on held-out distances" in text


def test_two_arms_or_an_arm_that_was_moved_have_a_point_each():
    table = measured(1).assign(group=np.repeat(["left", "right"], POSES // 2))
    found = ta.calibrate(ARM.robot, ta.Measurements.from_dataframe(table), model="constant")
    assert "one_anchor" not in {notice.kind for notice in found.notices}


@pytest.mark.parametrize("poses", [25, 60])
def test_judged_distances_are_counted_alike_with_rows_and_without(poses):
    q = np.repeat(ARM.poses(poses), 3, axis=0)
    table = to_points(q, np.arange(len(q)) % 3)
    found = ta.calibrate(ARM.robot, ta.Measurements.from_dataframe(table), model="constant")
    validation, held = found.validation, found.held
    assert held is not None
    visited = len(np.unique(held.readings, axis=0))
    assert (validation.n_holdout_distances, validation.n_holdout_poses) == (3 * visited, visited)
    judged = f"{3 * visited} held-out distances at {visited} poses"
    assert validation.few == f"The errors above come from {judged}: another split would give others."
    for each in (found, found.without_rows()):
        made = report(ta.Calibration.from_bytes(each.to_bytes(), where="arm.calib"))
        text = words_of(made.html)
        assert made.verdict.startswith(f"On {judged} the mean distance error is")
        assert f"Distance errors on {judged}, mm" in text
        assert validation.few in " ".join(advice.words for advice in made.advice)
        assert "held-out poses" not in made.verdict


@pytest.mark.parametrize("refit", [True, False])
@pytest.mark.parametrize(("row", "count"), [(0, "1 distance"), (5, "0 distances")])
def test_a_fixed_point_that_no_training_row_finds_is_refused_in_words(refit, row, count):
    number = np.arange(POSES) % 2
    number[row] = 2
    data = ta.Measurements.from_dataframe(to_points(ARM.poses(POSES), number))
    words = f'{count} in the training rows cannot determine the 3 unknowns of the fixed point "wire 2".*'
    with pytest.raises(ta.WorkError, match=f"{words}Measure more poses to it, .* or leave its rows out"):
        ta.calibrate(ARM.robot, data, model="constant", refit=refit)


@pytest.mark.parametrize("lacking", [0, 1, 2])
def test_held_out_rows_are_judged_at_the_fixed_points_that_they_name(lacking):
    number = np.arange(2 * POSES) % 3
    table = to_points(ARM.poses(2 * POSES), number)
    held = (np.arange(2 * POSES) % 4 == 0) & (number != lacking)
    table["purpose"] = np.where(held, "validate", "train")
    validation = ta.calibrate(ARM.robot, ta.Measurements.from_dataframe(table), model="constant").validation
    assert validation.n_holdout_distances == validation.n_planned == held.sum()
    assert validation.holdout["constant"].position.mean < 0.05
