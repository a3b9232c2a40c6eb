"""What cannot be true is said: rows that do not belong together, other robots, too few rows, wrong types."""

import re
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from tests.report_support import words_of
from truearm.cli import main
from truearm.doubts.grids import grid_steps, grid_words
from truearm.doubts.of_results import SIGMA_FIRST, no_help, poses_aside
from truearm.fits.identified import IdentifiedArm
from truearm.planning import JointSpace, choose, draw_pool
from truearm.reporting.report import report
from truearm.simulation import Imperfections, VirtualArm


def notice_of(calibration, kind):
    return next((str(notice) for notice in calibration.notices if notice.kind == kind), "")


STEP_DEG = 10.0


def on_grid(readings, step_deg=STEP_DEG, offset_deg=3.0, jitter_deg=0.02):
    """Readings (n, N) moved to the nearest values of a grid that a controller keeps within some jitter."""
    values = step_deg * np.round(np.degrees(readings) / step_deg) + offset_deg
    return np.radians(values + np.random.default_rng(0).normal(0.0, jitter_deg, values.shape))


@pytest.mark.parametrize("step_deg", [0.5, 1.0, 7.3, 10.0, 45.0])
@pytest.mark.parametrize("count", [30, 400])
def test_a_grid_is_found_with_its_step(step_deg, count):
    readings = np.random.default_rng(1).uniform(-2.8, 2.8, (count, 6))
    readings[:, 1] = 1e-2 * np.degrees(on_grid(readings[:, 1], step_deg, jitter_deg=0.004))
    readings[:, 0] = on_grid(readings[:, 0], step_deg)
    kinds = ["revolute", "prismatic", *["revolute"] * 4]
    found = grid_steps(readings, kinds)
    assert list(found) == [1, 2]
    assert found[1] == pytest.approx(step_deg, rel=1e-3)
    assert found[2] == pytest.approx(10.0 * step_deg, rel=1e-3)
    assert "joint 2 on a grid of" in (words := grid_words(found, kinds))
    assert " mm" in words
    assert grid_steps(readings[:25], kinds) == {}


@pytest.mark.parametrize("decimals", [1, 2, None])
def test_random_poses_stand_on_no_grid(decimals):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4)
    for count in (30, 300):
        readings = np.degrees(arm.poses(count))
        readings = readings if decimals is None else readings.round(decimals)
        assert grid_steps(np.radians(readings), arm.robot.joints) == {}


def test_planned_poses_stand_on_no_grid():
    robot = ta.Robot.load("ur10")
    pool = draw_pool(JointSpace(robot), 200)
    choice = choose(IdentifiedArm(robot), pool.readings, 40)
    assert grid_steps(pool.readings[choice.rows], robot.joints) == {}


def test_joints_that_stand_still_or_are_measured_between_stand_on_no_grid():
    drawn = np.random.default_rng(1).uniform(-2.8, 2.8, (100, 3))
    readings = on_grid(drawn)
    readings[:5, 0] = drawn[:5, 0]
    readings[10:, 1] = 0.3
    readings[:, 2] = np.radians(np.array([-70.3, -11.2, 33.9, 61.4])[np.arange(100) % 4])
    assert grid_steps(readings, ["revolute"] * 3) == {}


def test_a_grid_is_told_with_the_way_out():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4)
    readings = arm.poses(90)
    assert not notice_of(ta.calibrate(arm.robot, arm.measure(readings), model="constant"), "on_a_grid")
    readings[:, 1:3] = on_grid(readings[:, 1:3])
    told = notice_of(ta.calibrate(arm.robot, arm.measure(readings), model="constant"), "on_a_grid")
    assert "joints 2 and 3 on a grid of 10 deg" in told
    assert "20 to 30 poses between" in told
    assert "truearm evaluate" in told


def test_points_of_other_rows_are_doubted():
    arm = VirtualArm.paper(seed=4)
    table = arm.measure_table(arm.poses(60))
    good = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")
    assert not notice_of(good, "no_help") + notice_of(good, "far_from_nominal")
    points = [name for name in table.columns if name[0] in "xyz"]
    table[points] = np.roll(table[points].to_numpy(), 1, axis=0)
    shifted = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")
    assert "row by row" in notice_of(shifted, "no_help")


def test_points_that_a_controller_computed_are_doubted():
    robot = ta.Robot.load("ur10")
    readings = VirtualArm(robot, seed=4).poses(60)
    columns = [*(f"q{k}" for k in range(1, 7)), *"xyz"]
    table = pd.DataFrame(np.column_stack([readings, robot.position(readings).round(6)]), columns=columns)
    found = ta.calibrate(robot, ta.Measurements.from_dataframe(table), model="constant")
    assert "what a controller computes from its joints" in notice_of(found, "computed")
    assert not notice_of(found, "no_help")


@pytest.mark.parametrize(
    ("lag", "words"), [(1, "1 row before it"), (-1, "1 row after it"), (2, "2 rows before it")]
)
def test_readings_of_other_rows_are_named(lag, words):
    """Each point stands beside the readings of an earlier row, or of a later one."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    data = arm.measure(arm.poses(60))
    kept = np.arange(60)[max(lag, 0) : 60 + min(lag, 0)]
    shifted = replace(data.select(kept), readings=data.readings[kept - lag])
    found = ta.calibrate(arm.robot, shifted, model="constant", refit=False)
    assert words in notice_of(found, "rows_shifted")
    assert not notice_of(found, "fits_otherwise")


def with_lost(data, places, *, points):
    """Measurements that lost the points, or else the readings, of these rows: the next moved up."""
    count = len(data) - len(places)
    kept, others = np.delete(np.arange(len(data)), places), np.arange(count)
    seen, read = (kept, others) if points else (others, kept)
    return replace(data.select(others), targets=data.targets[seen], readings=data.readings[read])


@pytest.mark.parametrize(
    ("places", "points", "words"),
    [
        ([7], True, "From row 8 on .* the readings 1 row further on: 1 point was lost there, or 1 reading"),
        ([50], True, "From row 51 on each point belongs to the readings 1 row further on"),
        ([112], True, "From row 113 on each point belongs to the readings 1 row further on"),
        ([50], False, "From row 51 on .* the readings 1 row before it: 1 reading was lost there, or 1 point"),
        ([30, 80], True, "From row 31 on .* 1 row further on: 1 p.*; from row 80 on .* 2 rows further on"),
    ],
)
def test_from_where_rows_were_lost_is_named(places, points, words):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    data = with_lost(arm.measure(arm.poses(120)), places, points=points)
    found = ta.calibrate(arm.robot, data, model="constant", refit=False)
    told = notice_of(found, "rows_shifted")
    assert re.match(words, told), told
    assert "Look at these rows first" not in notice_of(found, "no_help")
    assert not notice_of(found, "single_rows")


def test_few_shifted_rows_that_are_taken_for_outliers_are_named():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    data = with_lost(arm.measure(arm.poses(120)), [112], points=True)
    told = notice_of(ta.calibrate(arm.robot, data, refit=False), "rows_shifted")
    assert told.startswith("From row 113 on each point belongs to the readings 1 row further on")


def test_a_lost_shot_is_named():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    data = with_lost(arm.measure(np.repeat(arm.poses(40), 3, axis=0)), [51], points=True)
    told = notice_of(ta.calibrate(arm.robot, data, model="constant", refit=False), "rows_shifted")
    assert re.match(r"From row 5[2-4] on each point belongs to the readings 1 row further on", told)


def test_of_several_set_ups_the_one_that_lost_a_row_is_named():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    data = arm.measure(arm.poses(120))
    rows = np.arange(120)
    lost = with_lost(data.select(rows < 50), [20], points=True)
    files = [("short.csv", lost), ("long.csv", data.select(rows >= 50))]
    parts = [
        replace(part, sources=np.full(len(part), name), group=np.full(len(part), name))
        for name, part in files
    ]
    both = ta.Measurements.concatenate(parts)
    told = notice_of(ta.calibrate(arm.robot, both, model="constant", refit=False), "rows_shifted")
    assert told.startswith("From row 21 of short.csv on")
    assert "long.csv" not in told


@pytest.mark.parametrize("seed", range(2))
def test_single_rows_that_are_far_off_are_not_taken_for_shifted_ones(seed):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    table = arm.measure_table(arm.poses(60, seed=seed), seed=seed)
    off = np.random.default_rng(seed).choice(60, 13, replace=False)
    table.loc[off, ["x", "y"]] += 0.5
    found = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), refit=False)
    assert notice_of(found, "rows_shifted") == ""


def test_another_robot_is_doubted():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4)
    found = ta.calibrate(ta.Robot.load("ur5"), arm.measure(arm.poses(60)), model="constant")
    doubt = notice_of(found, "far_from_nominal")
    assert "a2 is " in doubt
    assert "another robot" in doubt


def test_an_arm_of_ten_metres_may_be_off_by_more_than_a_small_one():
    robot = ta.Robot.load("ur10")
    table = robot.table.copy()
    table[:, 1:3] *= 7.0
    large = ta.Robot.from_table("gantry", table, joints=robot.joints, limits=robot.limits)
    arm = VirtualArm(large, seed=4, imperfections=Imperfections(length_mm=5.0, share=0.0))
    found = ta.calibrate(large, arm.measure(arm.poses(60)), model="constant")
    change_mm = 1e3 * np.abs(found.model.constants - table)[:, 1:3]
    assert change_mm.max() > 10.0
    assert notice_of(found, "far_from_nominal") == ""
    table[1, 2] += 0.2
    other = ta.Robot.from_table("sibling", table, joints=robot.joints, limits=robot.limits)
    doubt = notice_of(ta.calibrate(other, arm.measure(arm.poses(60)), model="constant"), "far_from_nominal")
    assert "a2 is " in doubt


def refusal(robot, data, **options):
    """What is said where so few rows are calibrated from; empty where they are enough."""
    try:
        held = ta.calibrate(robot, data, model="constant", refit=False, **options).validation.n_holdout
    except ta.WorkError as error:
        return str(error)
    assert held > 0
    return ""


@pytest.mark.parametrize(
    ("name", "orientation", "holdout", "enough"),
    [("ur10", False, 0.3, 15), ("rv-m2", False, 0.3, 12), ("ur10", False, 0.5, 20), ("ur10", True, 0.3, 9)],
)
def test_too_few_rows_say_how_many_are_just_enough(name, orientation, holdout, enough):
    arm = VirtualArm(ta.Robot.load(name), seed=4)
    table = arm.measure_table(arm.poses(enough), orientation=orientation)
    for count in (3, enough - 1):
        few = ta.Measurements.from_dataframe(table[:count])
        said = refusal(arm.robot, few, holdout=holdout)
        assert f"Measure at least {enough} poses: {holdout:.0%} are held out" in said
    assert "--holdout" not in refusal(arm.robot, ta.Measurements.from_dataframe(table[:3]))
    assert not refusal(arm.robot, ta.Measurements.from_dataframe(table), holdout=holdout)


def test_too_few_rows_name_the_largest_share_that_may_be_held_out():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4)
    few = arm.measure(arm.poses(14))
    found = re.search(r", or hold out less: --holdout (0\.\d+) is enough for", refusal(arm.robot, few))
    assert found is not None
    largest = float(found[1])
    assert not refusal(arm.robot, few, holdout=largest)
    assert refusal(arm.robot, few, holdout=round(largest + 0.01, 2))


def test_too_few_rows_of_several_files_say_how_many_are_just_enough():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4)
    table = arm.measure_table(arm.poses(21)).assign(group="one")

    def of_two(count):
        parts = (("a", table[:7]), ("b", table[7:count]))
        return ta.Measurements.concatenate([ta.Measurements.from_dataframe(t, name=n) for n, t in parts])

    for count in (14, 20):
        assert "Measure at least 21 poses: 50%" in refusal(arm.robot, of_two(count), holdout=0.5)
    assert not refusal(arm.robot, of_two(21), holdout=0.5)


def test_too_few_rows_that_train_by_another_rule_say_how_many_are_to_train():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4)
    data = arm.measure(arm.poses(30))
    said = refusal(arm.robot, data, train_size=9)
    assert "at least 10 poses to train on, or use a larger --train-size" in said
    assert not refusal(arm.robot, data, train_size=10)
    planned = np.where(np.arange(30) < 9, "fit", "validate")
    said = refusal(arm.robot, replace(data, purpose=planned))
    assert said.endswith("Measure at least 10 poses to train on.")


def test_what_is_no_robot_and_no_measurements_is_said(tmp_path):
    arm = VirtualArm.paper(seed=4)
    data = arm.measure(arm.poses(40))
    cases: list[tuple[Any, Any, str]] = [
        ("ur10", data, "robot is of type str.*Robot.load"),
        (arm.robot, "data.csv", "measurements are of type str.*read_csv"),
        (arm.robot, arm.measure_table(arm.poses(5)), "of type DataFrame.*from_dataframe"),
        (arm.robot, [data, 3], "of type int"),
    ]
    for robot, given, words in cases:
        with pytest.raises(ta.UsageError, match=words):
            ta.calibrate(robot, given)
    wrong: list[dict[str, Any]] = [
        {"train_size": "50"},
        {"train_size": 50.5},
        {"holdout": "0.3"},
        {"seed": 1.5},
    ]
    for options in wrong:
        with pytest.raises(ta.UsageError, match=r"It must be a (whole )?number"):
            ta.calibrate(arm.robot, data, **options)
    found = ta.calibrate(arm.robot, data, model="constant")
    with pytest.raises(ta.InputError, match="this is a directory"):
        found.save(tmp_path)
    with pytest.raises(ta.InputError, match="one waypoint has"):
        ta.Compensator(found).correct(arm.poses(2))


def test_a_tool_that_is_no_rigid_motion_is_refused():
    arm = VirtualArm.paper(seed=4)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(40)), model="constant")
    for tool in (np.zeros((4, 4)), np.diag([1.0, 1.0, -1.0, 1.0]), np.diag([2.0, 1.0, 1.0, 1.0])):
        with pytest.raises(ta.InputError, match="no rigid motion"):
            calibration.position(arm.poses(2), tool=tool)


def test_an_arm_that_fits_its_table_is_not_said_to_have_wrong_data(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exactly = Imperfections(length_mm=0.0, angle_deg=0.0, share=0.0, noise_mm=0.05)
    exact = VirtualArm(ta.Robot.load("ur10"), seed=3, imperfections=exactly)
    exact.measure_table(exact.poses(60)).to_csv("exact.csv", index=False)
    assert main(["calibrate", "ur10", "exact.csv", "-o", "exact", "--model", "constant"]) == 0
    told = capsys.readouterr()
    assert "There is nothing to gain" in told.err
    assert "truearm compensate" not in told.out
    assert "Do not use it" not in told.err
    assert "nothing to gain" in Path("exact/report.html").read_text()


@pytest.mark.parametrize(
    ("column", "stated", "told"),
    [("sigma_mm", 0.05, ""), ("sigma_mm", 2.0, "says 2 mm"), ("sigma", 0.025, "says 25 mm")],
)
def test_a_sigma_that_is_too_large_is_told(column, stated, told):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    table = arm.measure_table(arm.poses(90)).assign(**{column: stated})
    calibration = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), refit=False)
    said = notice_of(calibration, "stated_too_large")
    assert told in said
    assert bool(said) == bool(told)
    words = words_of(report(calibration).html)
    assert ("Correct the column of sigma" in words) == bool(told)
    assert not (told and "noise floor is reached" in words)


def test_a_sigma_in_another_unit_is_the_first_that_is_told_and_no_convention_is_tried():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    stages, table = [], arm.measure_table(arm.poses(60)).assign(sigma=0.03)

    def counting(name):
        stages.append(name)
        return nullcontext()

    data = ta.Measurements.from_dataframe(table)
    calibration = ta.calibrate(arm.robot, data, model="constant", stages=counting)
    kinds = [notice.kind for notice in calibration.notices]
    assert kinds == ["stated_too_large", "no_help"]
    assert notice_of(calibration, "no_help").endswith(SIGMA_FIRST)
    assert "trying other conventions" not in stages
    assert "the convention" not in words_of(report(calibration).html)


@pytest.mark.parametrize("honest", [False, True])
def test_a_sigma_that_is_too_large_in_a_part_of_the_rows_is_told(honest):
    """Their median is right."""
    arm, coarse = VirtualArm(ta.Robot.load("ur10"), seed=3), np.arange(60) % 5 < 2
    table = arm.measure_table(arm.poses(60)).assign(sigma_mm=np.where(coarse, 1.0, 0.05))
    if honest:
        table.loc[coarse, ["x", "y", "z"]] += np.random.default_rng(0).normal(0.0, 1e-3, (coarse.sum(), 3))
    calibration = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")
    said = notice_of(calibration, "stated_too_large")
    assert ("state a sigma of 1 mm, which alone would leave a mean error of 1.6 mm" in said) == (not honest)


def test_single_rows_that_nobody_trusts_say_nothing_of_the_others():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    table = arm.measure_table(arm.poses(60)).assign(sigma_mm=0.05)
    table.loc[[3, 11, 30, 44], "sigma_mm"] = 10.0
    calibration = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")
    assert notice_of(calibration, "stated_too_large") == ""


def test_constants_that_do_better_by_chance_are_not_told():
    constant = Imperfections(share=0.0, noise_mm=0.3)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3, imperfections=constant)
    rows = [arm.measure(arm.poses(40, seed=k), seed=k) for k in range(3)]
    found = [ta.calibrate(arm.robot, each, refit=False) for each in rows]
    nearer = 0
    for calibration in found:
        errors, held = calibration.validation.holdout, calibration.held
        assert held is not None
        lead, error = held.lead_mm("constant", "variable", [])
        is_nearer = 0.97 * errors["variable"].position.mean > errors["constant"].position.mean
        nearer += is_nearer
        said = notice_of(calibration, "too_few_to_tell")
        assert bool(said) == (is_nearer and lead > 2.0 * error)
        assert notice_of(calibration, "constant_better") == ""
        assert "constant_better" not in [advice.kind for advice in report(calibration).advice]
    assert nearer > 0


def test_one_gross_row_is_named_and_not_taken_for_wrong_data():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    table = arm.measure_table(arm.poses(60))
    found = []
    for row in (0, 48):
        wrong = table.assign(x=table["x"] + np.where(table.index == row, 0.9, 0.0))
        calibration = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(wrong), model="constant")
        assert calibration.held is not None
        judged = row + 1 in calibration.held.rows
        found.append(judged)
        told = notice_of(calibration, "single_rows" if judged else "no_help")
        assert f"row {row + 1} (" in told
        assert ("row by row" in told) == (not judged)
        assert ("Single rows are far off" in words_of(report(calibration).html)) == judged
    assert set(found) == {True, False}


@pytest.mark.parametrize(
    ("before", "after", "floor", "kind"),
    [
        (0.1, 0.12, 0.05, "no_gain"),
        (0.1, 1.3, 0.05, "no_help"),
        (0.6, 0.7, 0.05, "no_help"),
        (1.69, 1.78, 1.6, "no_gain"),
        (1.69, 2.4, 1.6, "no_help"),
        (3.0, 3.1, 20.0, "no_help"),
        (8.0, 9.0, 8.5, "no_help"),
    ],
)
def test_nothing_to_gain_is_said_of_small_errors_and_of_noise_alone(before, after, floor, kind):
    assert [notice.kind for notice in no_help(before, after, "mean error", floor)] == [kind]
    assert no_help(after, before, "mean error", floor) == []


@pytest.mark.parametrize(
    ("model", "who"),
    [("constant", "Constants gain nothing"), ("fcmac", "The model fcmac gains nothing"), ("variable", "")],
)
def test_what_models_leave_that_do_not_follow_what_varies_is_not_called_noise(model, who):
    said = str(no_help(1.69, 1.7, "mean error", 1.6, best=model)[0])
    assert said.startswith(who or "There is nothing to gain")
    assert ("calibrate with --model variable" in said) == bool(who)
    assert ("Noise alone would leave 1.6 mm" in said) != bool(who)


def test_poses_that_others_stood_for_are_told():
    (told,) = poses_aside(1000, 5000)
    assert (told.kind, "4000 of 5000 poses" in told.message) == ("poses_aside", True)
    assert poses_aside(0, 5000) == []


def test_errors_that_hide_in_noise_are_not_said_to_be_wrong_data(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    noisy = Imperfections(length_mm=0.0, angle_deg=0.0, share=0.0, noise_mm=1.0)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3, imperfections=noisy)
    arm.measure_table(arm.poses(100)).to_csv("noisy.csv", index=False)
    assert main(["calibrate", "ur10", "noisy.csv", "-o", "noisy"]) == 0
    told = capsys.readouterr()
    assert "Noise alone would leave" in told.err
    assert "right-handed" not in told.err
    assert main(["evaluate", "noisy/calibration.calib", "noisy.csv"]) == 0
    assert "right-handed" not in capsys.readouterr().err
    words = words_of(Path("noisy/report.html").read_text())
    assert "nothing to gain" in words
    assert "right-handed" not in words
