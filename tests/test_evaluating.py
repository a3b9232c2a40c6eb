"""Judging a calibration on measurements of another set-up."""

from typing import Any

import numpy as np
import pytest

import truearm as ta
from truearm.registration import register
from truearm.rotations import matrix_from_quaternion, quaternion_from_rotation_vector
from truearm.simulation import Imperfections, VirtualArm


def moved(arm, *, tool=(0.0, 0.0, 0.0)):
    """The same arm after the instrument was moved."""
    other = VirtualArm.paper(seed=arm.seed, imperfections=arm.imperfections)
    turn = np.eye(4)
    turn[:3, :3] = matrix_from_quaternion(quaternion_from_rotation_vector([[0.4, -0.2, 1.0]]))[0]
    turn[:3, 3] = 0.3, -0.5, 0.2
    other.world_from_base = turn @ arm.world_from_base
    other.target_in_flange = arm.target_in_flange + np.array(tool)
    return other


@pytest.fixture(scope="module")
def known():
    arm = VirtualArm.paper(seed=2)
    return arm, ta.calibrate(arm.robot, arm.measure(arm.poses(120)))


def test_a_new_set_up_is_found_and_the_rest_judged(known):
    arm, calibration = known
    other = moved(arm, tool=(0.05, 0.0, 0.02))
    found = ta.evaluate(calibration, other.measure(other.poses(150, seed=3)))
    assert (found.n_frame, found.n_judged) == (50, 100)
    assert repr(found).startswith("<Evaluation: frame of 50 rows, 100 rows judged; nominal")
    errors = {name: entry.position.mean for name, entry in found.errors.items()}
    assert errors["variable"] < errors["constant"] < 0.2 * errors["nominal"]
    keys = ["n_frame", "n_frame_poses", "n_judged", "n_judged_poses", "errors", "notices"]
    assert list(found.to_dict()) == keys


def test_rows_that_the_calibration_was_fitted_to_are_told(known):
    arm, calibration = known
    table = arm.measure_table(arm.poses(120))
    (notice,) = ta.evaluate(calibration, ta.Measurements.from_dataframe(table)).notices
    assert (notice.kind, len(notice.rows)) == ("known_rows", 120)
    assert str(notice).startswith("All rows took part in the fit")
    table.loc[3:, "x"] += 1e-5
    (notice,) = ta.evaluate(calibration, ta.Measurements.from_dataframe(table)).notices
    assert str(notice).startswith("Rows 1, 2 and 3 took part")
    table.loc[:3, "x"] += 1e-5
    assert not ta.evaluate(calibration, ta.Measurements.from_dataframe(table)).notices


@pytest.mark.parametrize(("count", "expected"), [(30, 10), (1500, 400)])
def test_a_third_and_400_at_most_find_the_frame(known, count, expected):
    arm, calibration = known
    found = ta.evaluate(calibration, arm.measure(arm.poses(count, seed=3)))
    assert (found.n_frame, found.n_judged) == (expected, count - expected)


def test_frame_rows_are_the_first_of_the_permutation(known):
    arm, calibration = known
    table = arm.measure_table(arm.poses(60, seed=3))
    order = np.random.default_rng(5).permutation(60)
    table.loc[order[20], "x"] += 0.5
    found = ta.evaluate(calibration, ta.Measurements.from_dataframe(table), frame_rows=20, seed=5)
    assert found.errors["constant"].position.max > 400.0
    assert found.errors["constant"].position.mean < 20.0
    table.loc[order[20], "x"] -= 0.5
    table.loc[order[19], "x"] += 0.5
    spoilt = ta.evaluate(calibration, ta.Measurements.from_dataframe(table), frame_rows=20, seed=5)
    assert spoilt.errors["constant"].position.max < 400.0
    assert [(notice.kind, notice.rows) for notice in found.notices] == [("outliers", (order[20] + 1,))]
    assert [(notice.kind, notice.rows) for notice in spoilt.notices] == [("far_rows", (order[19] + 1,))]


def test_a_kept_tool_needs_few_rows(known):
    arm, calibration = known
    other = moved(arm)
    data = other.measure(other.poses(150, seed=3))
    kept = ta.evaluate(calibration, data, keep_tool=True, frame_rows=4)
    free = ta.evaluate(calibration, data, frame_rows=4)
    assert kept.errors["variable"].position.mean < 0.3
    assert kept.errors["variable"].position.mean < free.errors["variable"].position.mean


def test_frame_and_tool_are_found_from_more_values_than_unknowns(known):
    arm, calibration = known
    poses = moved(arm).poses(10, seed=3)
    data = moved(arm).measure(poses)
    found = [ta.evaluate(calibration, data, seed=seed) for seed in range(4)]
    assert {each.n_frame for each in found} == {6}
    assert ta.evaluate(calibration, data, frame_rows=3, keep_tool=True).n_frame == 3
    turned = moved(arm).measure(poses, orientation=True)
    assert ta.evaluate(calibration, turned).n_frame == 4
    with pytest.raises(ta.InputError, match=r"9 measured values in 3 frame rows .* the 9 .*--frame-rows 4"):
        ta.evaluate(calibration, data, frame_rows=3)


def test_a_kept_tool_and_its_orientation():
    arm = VirtualArm.paper(seed=2)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(80), orientation=True), model="constant")
    other = moved(arm)
    data = other.measure(other.poses(60, seed=3), orientation=True)
    found = ta.evaluate(calibration, data, frame_rows=5, keep_tool=True)
    assert found.errors["constant"].position.mean < 0.3
    assert found.errors["constant"].to_dict()["mean_mrad"] < 0.5


def test_kept_frames_judge_every_row(known):
    arm, calibration = known
    data = arm.measure(arm.poses(40, seed=3), seed=3)
    found = ta.evaluate(calibration, data, keep_frames=True)
    assert (found.n_frame, found.n_judged) == (0, 40)
    assert found.errors["variable"].position.mean < 0.2
    other = moved(arm)
    elsewhere = ta.evaluate(calibration, other.measure(other.poses(40, seed=3)), keep_frames=True)
    assert elsewhere.errors["variable"].position.mean > 100.0
    (notice,) = elsewhere.notices
    assert notice.kind == "setup_moved"
    assert "Leave --keep-frames out" in notice.message


def test_a_tool_that_was_moved_is_not_blamed_on_the_calibration(known):
    arm, calibration = known
    other = moved(arm)
    other.target_in_flange = arm.target_in_flange + np.array([0.04, 0.0, 0.03])
    found = ta.evaluate(calibration, other.measure(other.poses(40, seed=3)), keep_tool=True)
    (notice,) = found.notices
    assert notice.kind == "setup_moved"
    assert "Leave --keep-tool out" in notice.message


def test_a_calibration_of_another_arm_is_blamed_with_kept_frames_too(known):
    _, calibration = known
    odd = VirtualArm.paper(seed=9, imperfections=Imperfections(angle_deg=3.0))
    found = ta.evaluate(calibration, odd.measure(odd.poses(40, seed=3)), keep_frames=True)
    told = {notice.kind: notice.message for notice in found.notices}
    assert "itself fits" not in told.get("setup_moved", "")
    assert "Do not use it" in told["not_as_calibrated"]


def test_kept_frames_are_chosen_by_name():
    arm = VirtualArm.paper(seed=2)
    other = moved(arm)
    parts = [
        ta.Measurements.from_dataframe(a.measure_table(a.poses(60)), name=name)
        for a, name in ((arm, "one"), (other, "two"))
    ]
    calibration = ta.calibrate(arm.robot, parts, model="constant")
    table = other.measure_table(other.poses(30, seed=4))
    named = ta.Measurements.from_dataframe(table, name="two")
    assert ta.evaluate(calibration, named, keep_frames=True).errors["constant"].position.mean < 0.3
    with pytest.raises(ta.UsageError, match=r'no set-up "three".*"one" and "two"'):
        ta.evaluate(calibration, ta.Measurements.from_dataframe(table, name="three"), keep_frames=True)


def test_several_set_ups_are_found_each_for_itself(known):
    arm, calibration = known
    other = moved(arm)
    parts = [
        ta.Measurements.from_dataframe(a.measure_table(a.poses(60, seed=6)), name=name)
        for a, name in ((arm, "one"), (other, "two"))
    ]
    found = ta.evaluate(calibration, ta.Measurements.concatenate(parts))
    assert (found.n_frame, found.n_judged) == (40, 80)
    assert found.errors["variable"].position.mean < 0.2


def test_the_world_as_frame_is_kept():
    arm = VirtualArm.paper(seed=3, imperfections=Imperfections(share=0.0, noise_mm=0.01))
    arm.world_from_base = np.eye(4)
    calibration = ta.calibrate(
        arm.robot, arm.measure(arm.poses(80)), frame="world", model="constant", refit=False
    )
    for keep_tool in (False, True):
        found = ta.evaluate(calibration, arm.measure(arm.poses(60, seed=4)), keep_tool=keep_tool)
        assert found.errors["constant"].position.mean < 0.05
        assert found.errors["nominal"].position.mean > 0.5


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"frame_rows": 0}, "positive"),
        ({"frame_rows": 2}, "6 measured values in 2 frame rows .* and 3 poses. Give --frame-rows 4 or more"),
        ({"frame_rows": 10, "keep_frames": True}, "none to find"),
        (
            {"frame_rows": 38},
            "of which 38 rows .* 3 must be left to judge. Give --frame-rows 37 or less",
        ),
        ({"seed": -1}, "Zero or more"),
        ({"use": "pose"}, "no orientation was measured"),
        ({"judge_target": 2}, "no target 2"),
    ],
)
def test_options_that_cannot_be(known, options, words):
    arm, calibration = known
    with pytest.raises((ta.InputError, ta.UsageError), match=words):
        ta.evaluate(calibration, arm.measure(arm.poses(40)), **options)


@pytest.mark.parametrize("kept", [{"keep_tool": True}, {"keep_frames": True}])
def test_an_orientation_that_was_not_fitted_is_left_out_where_it_would_be_kept(known, kept: dict[str, Any]):
    arm, calibration = known
    data = arm.measure(arm.poses(40, seed=3), orientation=True)
    found = ta.evaluate(calibration, data, **kept)
    assert "orientations_left_out" in {notice.kind for notice in found.notices}
    placed = ta.evaluate(calibration, data, use="position", **kept)
    assert found.errors == placed.errors
    with pytest.raises(ta.UsageError, match="orientations took no part in the calibration"):
        ta.evaluate(calibration, data, use="pose", **kept)
    assert ta.evaluate(calibration, data).errors["variable"].orientation is not None


def test_another_arm_s_measurements_are_refused(known):
    _, calibration = known
    other = VirtualArm(ta.Robot.load("ur10"), seed=1)
    with pytest.raises(ta.InputError, match="6 joint columns"):
        ta.evaluate(calibration, other.measure(other.poses(40)))


def test_registration_finds_a_known_frame():
    rng = np.random.default_rng(0)
    truth = np.eye(4)
    truth[:3, :3] = matrix_from_quaternion(quaternion_from_rotation_vector([[2.0, -1.0, 0.5]]))[0]
    truth[:3, 3] = 1.0, 2.0, 3.0
    points = rng.normal(size=(10, 3))
    turned = matrix_from_quaternion(quaternion_from_rotation_vector(rng.normal(size=(10, 3))))
    in_world = points @ truth[:3, :3].T + truth[:3, 3]
    none = np.empty((0, 3, 3))
    np.testing.assert_allclose(register(points, in_world, none, none, 0.0), truth, atol=1e-12)
    one = register(points[:1], in_world[:1], turned[:3], truth[:3, :3] @ turned[:3], 0.5)
    np.testing.assert_allclose(one, truth, atol=1e-12)


def test_set_ups_without_the_judged_target_are_not_judged():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1)
    table = arm.measure_table(arm.poses(80)).assign(group=["a"] * 40 + ["b"] * 40)
    table[["x2", "y2", "z2"]] = table[["x", "y", "z"]]
    data = ta.Measurements.from_dataframe(table)
    calibration = ta.calibrate(arm.robot, data, model="constant", judge_target=2)
    table.loc[40:, ["x2", "y2", "z2"]] = np.nan
    lacking = ta.Measurements.from_dataframe(table)
    for found in (
        ta.calibrate(arm.robot, lacking, model="constant", judge_target=2),
        ta.evaluate(calibration, lacking, judge_target=2),
    ):
        (notice,) = [notice for notice in found.notices if notice.kind == "not_judged"]
        assert notice.message.startswith('Target 2 was measured in none of the rows of the set-up "b" that')
        assert notice.message.endswith('errors are those of the set-up "a" alone.')
        errors = found.validation.holdout if isinstance(found, ta.Calibration) else found.errors
        assert errors["constant"].position.max < 1.0
    with pytest.raises(ta.InputError, match=r'target 2 was measured in none of the rows .*"b"'):
        ta.evaluate(calibration, lacking.select(lacking.group == "b"), judge_target=2)
    assert ta.calibrate(arm.robot, lacking, model="constant").validation.n_holdout == 24
