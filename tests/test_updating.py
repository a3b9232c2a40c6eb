"""Updating a calibration after re-mastering, a crash or a change of motor, on virtual arms."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.remastered import (
    SHIFT,
    TOOL_MM,
    check_offset,
    paper_arm,
    remastered,
    remastered_table,
    std_mm,
    updated,
)
from tests.report_support import words_of
from truearm._core import setup_jacobian, step_setup
from truearm.doubts.of_results import LARGE_MM
from truearm.errors import Notice, in_json
from truearm.fits.core_set import Selection
from truearm.programs.notices import update_notices
from truearm.reporting.facts import Facts
from truearm.reporting.report import report
from truearm.simulation import Imperfections, VirtualArm
from truearm.solving import beyond_learnt
from truearm.updating.some_poses import FEWEST_OF_A_GROUP, MOST_VALUES, some_poses
from truearm.updating.squares import SquaresTest


@pytest.fixture(scope="module")
def known():
    return paper_arm()


@pytest.fixture(scope="module")
def moved(known):
    return updated(*known)


def error_mm(calibration, arm, shift, tool_mm=(0.0, 0.0, 0.0)):
    """Mean error of predictions of the target at fresh poses in the calibration's only set-up."""
    fresh = remastered(arm, arm.poses(200, seed=77), shift, seed=78, tool_mm=tool_mm)
    return ta.evaluate(calibration, fresh, keep_frames=True).errors[calibration.model_name].position.mean


def test_what_moved_is_found_and_the_error_comes_back(known, moved):
    arm, calibration = known
    _, found = moved
    assert found.verdict == "moved"
    for offset, shift in zip(found.offsets[1:4], SHIFT[1:4], strict=True):
        assert offset.told
        assert offset.moved
        check_offset(offset, shift)
    assert found.tools[0].moved
    own = error_mm(calibration, arm, np.zeros(5))
    assert error_mm(calibration, arm, SHIFT, TOOL_MM) > 10.0 * own
    assert error_mm(found.calibration, arm, SHIFT, TOOL_MM) < 1.4 * own
    assert found.after.position.mean < 0.1 * found.before.position.mean


@pytest.mark.parametrize(
    ("shift", "changed", "follows"),
    [([0.05, -0.05], [2, 3], 2), ([0.05, 0.0], [2], None), ([0.05, 0.05], [2, 3], None)],
)
def test_one_motor_that_changes_two_coupled_joints_is_told(shift, changed, follows):
    arm = VirtualArm(ta.Robot.load("fanuc-lr-mate-200id"), seed=2)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), model="constant")
    shift_deg = np.array([0.0, *shift, 0.0, 0.0, 0.0])
    found = ta.update(calibration, remastered(arm, arm.poses(15, seed=9), shift_deg, seed=9))
    assert [offset.joint for offset in found.offsets if offset.moved] == changed
    assert [offset.follows for offset in found.offsets] == [None, None, follows, None, None, None]
    words = "Joint 3 is coupled to joint 2, and its change is what that of joint 2 makes of its reading"
    assert (words in words_of(report(found.calibration).html)) == (follows is not None)


def test_what_cannot_be_told_is_said(moved):
    _, found = moved
    assert not found.offsets[0].told
    assert found.offsets[0].confounded == "frame"
    assert found.offsets[4].confounded == "tool"
    assert found.offsets[0].change == 0.0
    assert found.offsets[0].std is None


def test_a_device_and_a_target_that_stayed_tell_the_first_and_last_joint(known):
    arm, calibration = known
    shift = np.array([0.4, 0.0, 0.0, 0.0, -0.8])
    data = remastered(arm, arm.poses(15, seed=9), shift, seed=9)
    found = ta.update(calibration, data, keep_frame=True, keep_tool=True)
    assert found.verdict == "moved"
    assert [offset.moved for offset in found.offsets] == [True, False, False, False, True]
    for offset, truth in zip(found.offsets, shift, strict=True):
        check_offset(offset, truth)
    assert found.frames[0].largest_mm < 1e-9


@pytest.mark.parametrize("kept", ["frame", "tool"])
def test_what_is_kept_and_moved_is_named_where_nothing_fits(kept, known):
    arm, calibration = known
    other = VirtualArm.paper(seed=2)
    if kept == "frame":
        other.world_from_base = VirtualArm.paper(seed=99).world_from_base
    else:
        other.target_in_flange = other.target_in_flange + np.array([0.03, -0.02, 0.05])
    with pytest.raises(ta.WorkError, match=f"Leave --keep-{kept} out unless"):
        ta.update(
            calibration,
            other.measure(arm.poses(15, seed=9), seed=9),
            keep_frame=kept == "frame",
            keep_tool=kept == "tool",
        )


def test_a_field_that_does_not_fit_names_what_was_kept(known):
    from truearm.cli.update import _verdict

    arm, calibration = known
    data = remastered(arm, arm.poses(15, seed=9), np.zeros(5), seed=9, tool_mm=(2.0, 0.0, 0.0))
    found = ta.update(calibration, data, keep_tool=True)
    assert found.verdict == "field"
    assert "Leave --keep-tool out unless the target sits where it sat" in _verdict(found)


def test_unchanged_arms_are_said_to_hold_at_the_stated_rate(known):
    arm, calibration = known
    verdicts = [
        ta.update(calibration, arm.measure(arm.poses(15, seed=100 + k), seed=k), level=0.05).verdict
        for k in range(12)
    ]
    assert verdicts.count("holds") >= 10  # of 12 at 5 %: nine or fewer in 2 of 100 cases
    data = arm.measure(arm.poses(15, seed=9), seed=9)
    assert error_mm(ta.update(calibration, data).calibration, arm, np.zeros(5)) < 0.15


def test_another_field_is_noticed(known):
    _, calibration = known
    other = VirtualArm.paper(seed=2, imperfections=Imperfections(share=0.5))
    found = ta.update(calibration, other.measure(other.poses(15, seed=9), seed=9))
    assert found.verdict == "field"
    assert found.rest.p < 1e-3
    assert found.outliers == ()
    assert [notice.kind for notice in update_notices(found.calibration)] == ["update"]
    assert update_notices(calibration) == []


def test_a_noisier_device_moves_no_joint_of_an_unchanged_arm(known):
    """Its noise is seen in what is left, which then says how far offsets are known."""
    arm, calibration = known
    verdicts, moved = [], 0
    for seed in range(8):
        table = arm.measure_table(arm.poses(20, seed=9), seed=9)
        table[["x", "y", "z"]] += np.random.default_rng(seed).normal(0.0, 1e-3, (20, 3))
        found = ta.update(calibration, ta.Measurements.from_dataframe(table))
        verdicts.append(found.verdict)
        moved += sum(offset.moved for offset in found.offsets)
        stated = ta.update(calibration, ta.Measurements.from_dataframe(table.assign(sigma_mm=1.0)))
        assert stated.verdict == "holds"
    assert verdicts == ["field"] * 8
    assert moved <= 1


def check_kept_notices(found, before):
    """What was warned of is in the file and in JSON, beside what was before."""
    assert found.calibration.notices == found.notices
    assert found.to_dict()["notices"] == found.calibration.summary["notices"] == in_json(found.notices)
    assert found.calibration.summary["update"]["former"]["notices"] == in_json(before.notices)


def test_a_gross_error_is_left_out_and_named(known):
    arm, _ = known
    calibration = replace(known[1], notices=(Notice("limits", "Joint 2 was beyond its limits."),))
    table = remastered_table(arm, arm.poses(15, seed=9), SHIFT, seed=9)
    table.loc[3, "x"] += 0.02
    found = ta.update(calibration, ta.Measurements.from_dataframe(table))
    assert found.outliers == (4,)
    assert found.verdict == "moved"
    assert any("row 4" in str(notice) for notice in found.notices)
    check_kept_notices(found, calibration)
    assert error_mm(found.calibration, arm, SHIFT) < 0.2


def test_a_gross_row_that_was_held_out_gives_up_no_calibration_that_it_did_not_bend(known):
    arm, _ = known
    data = arm.measure(arm.poses(60))
    held = ta.calibrate(arm.robot, data, model="constant").held
    assert held is not None
    targets = data.targets.copy()
    targets[held.rows[0] - 1] = 0.0
    without, bent = (
        ta.calibrate(arm.robot, replace(data, targets=targets), model="constant", refit=refit)
        for refit in (False, True)
    )
    later = arm.measure(arm.poses(15, seed=9), seed=9)
    assert without.validation.holdout["constant"].position.mean > LARGE_MM
    assert ta.update(without, later).verdict == "holds"
    with pytest.raises(ta.WorkError, match=r"leaves \d+ mm of the rows that it was fitted to"):
        ta.update(bent, later)


def test_constants_are_updated_too(known):
    arm, _ = known
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), model="constant")
    data = remastered(arm, arm.poses(15, seed=9), SHIFT, seed=9)
    found = ta.update(calibration, data)
    assert found.verdict == "moved"
    own = error_mm(calibration, arm, np.zeros(5))
    assert error_mm(found.calibration, arm, SHIFT) < 1.4 * own
    q = arm.poses(20, seed=4)
    assert (std_mm(found.calibration, q) > 0.98 * std_mm(calibration, q)).all()


@pytest.mark.parametrize("model", ["variable", "constant"])
def test_heights_that_only_frame_and_tool_share_stay_together(model):
    # No pose of a SCARA tells its own height from those of frame, tool and sliding joint.
    arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=2)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(80)), model=model)
    new = arm.measure(arm.poses(15, seed=9), seed=9)
    found = ta.update(calibration, new)
    own = calibration.validation.holdout[model].position.mean
    assert found.verdict == "holds"
    for checked in (found.before, found.after):
        assert checked.position.mean < 2.0 * own
    kept = ta.evaluate(found.calibration, new, keep_frames=True)
    assert kept.errors[model].position.mean < 2.0 * own
    again = ta.update(calibration, remastered(arm, arm.poses(15, seed=9), [0.0, 0.2, 0.0, 0.0], seed=9))
    assert again.verdict == "moved"
    check_offset(again.offsets[1], 0.2)
    stds = [each.offsets[1].std or np.inf for each in (again, found)]
    assert stds[0] < 1.1 * stds[1]  # a moved joint spoils no place to linearise at


def test_another_target_on_a_scara_hides_no_offset():
    arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=1)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(80)), model="constant")
    shift = np.array([0.0, 0.5, 0.0, 0.0])
    data = remastered(arm, arm.poses(15, seed=9), shift, seed=9, tool_mm=(30.0, -20.0, 40.0))
    found = ta.update(calibration, data, new_tool=True)
    assert found.verdict == "moved"
    check_offset(found.offsets[1], shift[1])


def test_positions_are_compared_with_a_target_whose_orientation_was_measured_too():
    # Found anew, the target of a SCARA goes metres off along axes that are hardly tilted.
    arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=2)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(80), orientation=True), model="constant")
    shift = np.array([0.0, 0.5, 0.0, 0.0])
    found = ta.update(calibration, remastered(arm, arm.poses(15, seed=9), shift, seed=9))
    assert found.verdict == "moved"
    check_offset(found.offsets[1], shift[1])
    assert found.tools[0].largest_mm < 1.0
    other = ta.update(calibration, arm.measure(arm.poses(15, seed=9), seed=9), new_tool=True)
    assert other.verdict == "holds"


def test_orientations_that_the_calibration_did_not_use_are_left_out(known):
    arm, calibration = known
    data = arm.measure(arm.poses(15, seed=9), seed=9, orientation=True)
    found = ta.update(calibration, data)
    assert found.verdict == "holds"
    assert found.after.orientation is None
    with pytest.raises(ta.UsageError, match="took no part in the calibration"):
        ta.update(calibration, data, use="pose")


def test_without_rows_an_updated_calibration_holds_none_of_the_one_before(moved):
    found = moved[1].calibration
    stripped = found.without_rows()
    assert stripped.to_bytes() == found.to_bytes(with_rows=False)
    assert stripped.learned_from is None
    with pytest.raises(ta.WorkError, match="left out when the file was stripped"):
        _ = stripped.predecessor


def test_every_model_is_judged_at_poses_left_out_in_turn(known, moved):
    arm, calibration = known
    _, found = moved
    new = found.calibration
    assert new.validation.left_out
    assert new.held is not None
    for name, errors in new.held.errors.items():
        assert errors.statistics() == new.validation.holdout[name]
        assert new.validation.holdout[name].position.mean > new.validation.train[name].position.mean
    assert new.validation.holdout["variable"] == found.after
    former = {**calibration.validation.to_dict(), "notices": in_json(calibration.notices)}
    assert new.summary["update"]["former"] == former
    fresh = remastered(arm, arm.poses(60, seed=77), SHIFT, seed=78, tool_mm=TOOL_MM)
    outside = ta.evaluate(new, fresh, frame_rows=15).errors["nominal"].position.mean
    assert new.validation.holdout["nominal"].position.mean == pytest.approx(outside, rel=0.5)


def test_what_was_kept_is_told_apart_from_what_was_found(known, moved):
    arm, calibration = known
    data = arm.measure(arm.poses(15, seed=9), seed=9)
    assert moved[1].estimated == ("offsets", "frame", "tool")
    assert moved[1].tested == ("offsets", "tool")
    kept = ta.update(calibration, data, keep_frame=True, keep_tool=True)
    assert (kept.estimated, kept.tested) == (("offsets",), ("offsets",))
    assert kept.to_dict()["frames"][0]["kept"]
    assert ta.update(calibration, data, new_tool=True).tested == ("offsets",)


def test_orientation_and_its_target_are_updated():
    arm = VirtualArm.paper(seed=2)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(50), orientation=True), model="constant")
    table = arm.measure_table(arm.poses(12, seed=3) + np.radians(SHIFT), seed=3, orientation=True)
    for joint, column in enumerate(arm.poses(12, seed=3).T, start=1):
        table[f"q{joint}"] = column
    found = ta.update(calibration, ta.Measurements.from_dataframe(table))
    assert found.verdict == "moved"
    assert found.tools[0].turn_deg is not None
    assert found.after.orientation is not None
    assert found.after.orientation.mean < 0.5
    for offset, shift in zip(found.offsets[1:4], SHIFT[1:4], strict=True):
        check_offset(offset, shift, errors=5.0)


def test_an_update_is_saved_with_what_was_before(known, moved, tmp_path):
    arm, calibration = known
    calibration.save(tmp_path / "old.calib")
    old = (tmp_path / "old.calib").read_bytes()
    data, _ = moved
    found = ta.update(ta.Calibration.load(tmp_path / "old.calib"), data)
    found.calibration.save(tmp_path / "new.calib")
    back = ta.Calibration.load(tmp_path / "new.calib")
    q = arm.poses(20, seed=4)
    assert np.array_equal(back.pose(q), found.calibration.pose(q))
    np.testing.assert_allclose(back.position_std(q), found.calibration.position_std(q), rtol=1e-9)
    assert back.revision is not None
    assert back.revision.report["verdict"] == "moved"
    ta.roll_back(tmp_path / "new.calib", tmp_path / "again.calib")
    assert (tmp_path / "again.calib").read_bytes() == old
    ta.roll_back(tmp_path / "new.calib", tmp_path / "again.calib")
    with pytest.raises(ta.UsageError, match="something else already"):
        ta.roll_back(tmp_path / "new.calib", tmp_path / "new.calib")


def test_features_were_learnt_where_the_first_calibration_was():
    arm = VirtualArm.paper(seed=2)
    data, later = (
        ta.Measurements.from_dataframe(
            arm.measure_table(arm.poses(count, seed=seed), seed=seed).assign(warmth=np.linspace(*span, count))
        )
        for count, seed, span in ((80, 0, (15.0, 30.0)), (20, 5, (21.0, 22.0)))
    )
    calibration = ta.calibrate(arm.robot, data, features=("warmth",))
    updated = ta.update(calibration, later).calibration
    assert beyond_learnt(updated, [28.0]) == []
    assert beyond_learnt(updated, [31.0]) == beyond_learnt(calibration, [31.0]) != []
    assert Facts(updated).features == {"warmth": 22.5}


def test_bounds_of_the_updated_deviation_are_no_smaller(known, moved):
    arm, _ = known
    updated = moved[1].calibration
    q = arm.poses(100, seed=5)
    assert (1e3 * updated.conservative_std(q)[:, 0] >= std_mm(updated, q) * (1.0 - 1e-9)).all()
    ratio = std_mm(updated, q) / std_mm(known[1], q)  # the device may see some poses better than before
    assert (ratio > 0.9).all()
    assert 1.0 < np.median(ratio) < 1.5


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"offset_deg": 0.0}, ta.UsageError, "positive"),
        ({"level": 1.0}, ta.UsageError, "Between 0 and 1"),
        ({"keep_tool": True, "new_tool": True}, ta.UsageError, "Give one of"),
        ({"use": "pose"}, ta.UsageError, "no orientation was measured"),
        ({"offset_deg": 0.05}, ta.WorkError, "--offset-deg"),
    ],
)
def test_options_that_cannot_be(known, moved, options, error, words):
    with pytest.raises(error, match=words):
        ta.update(known[1], moved[0], **options)


def test_data_that_cannot_be(known, tmp_path):
    arm, calibration = known
    with pytest.raises(ta.InputError, match=r"12 measured values in 4 poses .* 10 to 20"):
        ta.update(calibration, arm.measure(arm.poses(4, seed=3)))
    parts = [
        ta.Measurements.from_dataframe(arm.measure_table(arm.poses(count, seed=count)), name=f"of{count}")
        for count in (12, 3)
    ]
    with pytest.raises(ta.InputError, match='3 poses of set-up "of3".*at least 4'):
        ta.update(calibration, ta.Measurements.concatenate(parts))
    other = VirtualArm(ta.Robot.load("ur10"), seed=1)
    with pytest.raises(ta.InputError, match="6 joint columns"):
        ta.update(calibration, other.measure(other.poses(15)))
    calibration.save(tmp_path / "small.calib", with_rows=False)
    with pytest.raises(ta.WorkError, match="left out of this file"):
        ta.update(ta.Calibration.load(tmp_path / "small.calib"), arm.measure(arm.poses(15, seed=3)))


def test_kept_parts_need_a_set_up_that_is_known(known):
    arm = known[0]
    parts = [
        ta.Measurements.from_dataframe(arm.measure_table(arm.poses(30, seed=k), seed=k), name=name)
        for k, name in enumerate(("one", "two"))
    ]
    calibration = ta.calibrate(arm.robot, parts, model="constant")
    table = arm.measure_table(arm.poses(15, seed=9), seed=9)
    with pytest.raises(ta.UsageError, match=r'"three" that could be kept.*"one" and "two"'):
        ta.update(calibration, ta.Measurements.from_dataframe(table, name="three"), keep_frame=True)
    named = ta.update(calibration, ta.Measurements.from_dataframe(table, name="two"), keep_frame=True)
    assert named.verdict == "holds"
    free = ta.update(calibration, ta.Measurements.from_dataframe(table, name="three"))
    assert free.verdict == "holds"
    assert free.tools == ()


def test_set_up_derivatives_are_those_of_finite_differences(known):
    from truearm.fits.core_set import core_set, select
    from truearm.fits.fitting import Task
    from truearm.updating import UpdateOptions
    from truearm.updating.scene import Scene
    from truearm.updating.unknowns import Unknowns

    arm, calibration = known
    data = arm.measure(arm.poses(6, seed=3))
    task = Task(calibration.arm, select(data, None), data.groups, calibration.options)
    unknowns = Unknowns.of(calibration, task, UpdateOptions(), data)
    scene = Scene(task, data, calibration, unknowns)
    state = scene.first()
    linear = scene.linear(state)
    size = 1e-6
    for k in range(len(unknowns.std)):
        step = np.zeros(len(unknowns.std))
        step[k] = size
        ahead, back = (scene.linear(scene.moved(state, sign * step)).residual for sign in (1.0, -1.0))
        np.testing.assert_allclose((back - ahead) / (2.0 * size), linear.jacobian[:, k], atol=2e-4)
    assert setup_jacobian(scene.problem, scene.parameters, state.setup).shape == (6, 3, 9)
    with pytest.raises(ValueError, match="step has shape"):
        step_setup(scene.problem, state.setup, np.zeros((1, 4)))
    assert core_set(arm.robot, data, task.selection, task.groups).rows_per_pose == 3


def test_a_sum_of_squares_says_how_rare_it_is():
    found = SquaresTest.of(np.array([3.0, 4.0]), 2, 10**9)
    assert found.squares == 25.0
    np.testing.assert_allclose(found.p, np.exp(-12.5), rtol=1e-5)
    assert SquaresTest.of(np.array([3.0, 4.0]), 2, 20).p > 10.0 * found.p
    assert SquaresTest.of(np.empty(0), 0, 20).p == 1.0


def test_of_thousands_of_poses_some_are_used_of_every_setup(known):
    arm, _ = known
    many = remastered(arm, arm.poses(1500, seed=9), SHIFT, seed=9)
    few = remastered(arm, arm.poses(30, seed=10), SHIFT, seed=10)
    both = ta.Measurements.concatenate(
        [replace(many, group=np.full(1500, "a")), replace(few, group=np.full(30, "b"))]
    )
    used, notices = some_poses(both, Selection((0,)))
    most = MOST_VALUES // 3
    assert (used.group == "a").sum() == most // 2
    assert (used.group == "b").sum() == 30
    assert set(used.rows[used.group == "a"]) >= {1, 1500}
    assert str(notices[0]).startswith(f"{most // 2 + 30} of 1530 poses are used")
    assert some_poses(few, Selection((0,))) == (few, [])


def test_poses_of_many_values_are_fewer_but_never_less_than_twenty(known):
    arm, _ = known
    data = arm.measure(arm.poses(600, seed=9), seed=9)
    used, _ = some_poses(data, Selection((0, 1, 2, 3), orientation=True))
    assert len(used) == MOST_VALUES // 15
    used, _ = some_poses(data, Selection(tuple(range(MOST_VALUES))))
    assert len(used) == FEWEST_OF_A_GROUP


@pytest.mark.parametrize("allowed", [{"offset_deg": 60.0}, {"tool_mm": 1000.0}])
def test_what_may_have_moved_far_is_compared_too(known, moved, allowed):
    found = ta.update(known[1], moved[0], **allowed)
    assert found.verdict == "moved"
    assert [offset.joint for offset in found.offsets if offset.moved] == [2, 3, 4]
    assert found.tools[0].p is not None
    assert found.changed.freedom > 3
