"""Outliers of a calibration: which they are, and that nothing of them stays in it."""

import re
from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.report_support import words_of
from truearm.cli import main
from truearm.reporting.report import report
from truearm.simulation import Imperfections, VirtualArm


def test_outliers_are_listed_and_kept_in_the_held_out_errors():
    arm = VirtualArm.paper(seed=2)
    table = arm.measure_table(arm.poses(80))
    order = np.random.default_rng(7).permutation(80)
    trained, held = order[3], order[70]
    table.loc[[trained, held], "x"] += 0.02
    calibration = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table))
    assert {entry["row"] for entry in calibration.summary["outliers"][:2]} == {trained + 1, held + 1}
    assert calibration.summary["outliers"][0]["distance_mm"] > 15.0
    assert calibration.validation.holdout["variable"].position.max > 15.0
    assert calibration.validation.holdout["variable"].position.mean < 1.0
    rows = calibration.rows
    assert rows is not None
    ratio, is_outlier = rows.distance_m / np.linalg.norm(rows.residual[:, :3], axis=1), rows.score > 1.0
    np.testing.assert_allclose(ratio[is_outlier], 1.0, rtol=0.02)
    assert ratio.min() >= 1.0
    assert np.median(ratio[~is_outlier]) > 1.1, "the others' are of the model without the row"


def test_outliers_leave_nothing_behind_of_what_was_found_with_them():
    """One row in ten is millimetres off: errors, noise and deviations are those of the others alone."""
    arm = VirtualArm(ta.Robot.load("abb-irb-1200"), seed=3)
    table = arm.measure_table(arm.poses(90))
    rng = np.random.default_rng(3)
    off = rng.choice(90, 9, replace=False)
    spoilt = table.copy()
    spoilt.loc[off, ["x", "y", "z"]] += rng.normal(0.0, 4e-3, (9, 3))
    fresh = arm.poses(100, seed=5)
    found = []
    for each in (table.drop(index=off.tolist()), spoilt):
        calibration = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(each))
        misses = ta.evaluate(calibration, arm.measure(fresh, seed=6), keep_frames=True).errors["variable"]
        deviation = np.linalg.norm(calibration.position_std(fresh), axis=1).mean()
        found.append((misses.position.mean, deviation, calibration.summary["noise_mm"]))
    clean, cleaned = found
    assert {entry["row"] - 1 for entry in calibration.summary["outliers"]} >= set(off.tolist())
    assert np.max(np.divide(cleaned, clean)) < 1.5


def test_one_row_far_out_spoils_no_model():
    """A wrong decimal point, readings of the row before: neither constants nor what varies remember it."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1)
    table = arm.measure_table(arm.poses(90))
    trained = int(np.random.default_rng(7).permutation(90)[3])
    far, stale = table.copy(), table.copy()
    far.loc[[trained], "x"] += 1.0
    readings = [name for name in table.columns if name.startswith("q")]
    stale.loc[[trained], readings] = table.loc[[(trained + 1) % 90], readings].to_numpy()
    found = []
    for each in (table.drop(index=trained), far, stale):
        calibration = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(each), refit=False)
        holdout = calibration.validation.holdout
        means = [holdout[model].position.mean for model in ("nominal", "constant", "variable")]
        found.append([*means, calibration.summary["noise_mm"]])
        rows = [entry["row"] - 1 for entry in calibration.summary["outliers"]]
        assert rows == [trained] * (len(each) == len(table))
    assert np.max(np.divide(found[1:], found[0])) < 1.3, found


def test_what_is_fitted_is_said_to_be_without_outliers_that_were_taken_out(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arm = VirtualArm.paper(seed=2)
    table = arm.measure_table(arm.poses(60))
    table.loc[[11], "x"] += 0.05
    table.to_csv("m.csv", index=False)
    assert main(["calibrate", "rv-m2", "m.csv", "-o", "out"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "fitted to all 60 rows but 1 outlier." in printed
    assert "Outliers, taken out of the fits: row 12 (" in printed
    assert "Constants, frame and tool are without them where they bend these." in printed
    text = words_of(report(ta.Calibration.load("out/calibration.calib")).html)
    assert "the calibration in the file is fitted to 60 but for 1 outlier" in text
    assert "Outliers were taken out of the fit of what varies, and of constants" in text
    assert "They were taken out of the fits;" in text
    assert main(["calibrate", "rv-m2", "m.csv", "-o", "constant", "--model", "constant"]) == 0
    assert "fitted to all 60 rows." in capsys.readouterr().out


@pytest.mark.parametrize("model", ["constant", "variable"])
def test_an_outlier_by_its_orientation_is_told_with_its_turn(tmp_path, monkeypatch, capsys, model):
    monkeypatch.chdir(tmp_path)
    arm = VirtualArm.paper(seed=2, imperfections=Imperfections(share=0.0, noise_mm=0.02))
    table, columns = arm.measure_table(arm.poses(60), orientation=True), ["qw", "qx", "qy", "qz"]
    row = int(np.random.default_rng(7).permutation(60)[50])
    w, x, y, z = table[columns].to_numpy()[row]
    small, whole = np.sin(np.radians(2.5)), np.cos(np.radians(2.5))
    turned = whole * np.array([w, x, y, z]) + small * np.array([-x, w, -z, y])
    table.loc[[row], columns] = turned[None]
    table.to_csv("m.csv", index=False)
    assert main(["calibrate", "rv-m2", "m.csv", "-o", "out", "--model", model]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    calibration = ta.Calibration.load("out/calibration.calib")
    (outlier,) = calibration.summary["outliers"]
    assert (outlier["row"], outlier["turn_mrad"]) == (row + 1, pytest.approx(np.radians(5e3), rel=0.02))
    named = f"row {row + 1} ({outlier['distance_mm']:.2f} mm, {outlier['turn_mrad']:.1f} mrad)"
    assert f": {named}." in printed
    without = re.findall(
        rf"held-out ones among them: .*{model} [\d.]+ mm; nominal.*{model} ([\d.]+) mrad", printed
    )
    errors = calibration.validation.holdout[model].orientation
    assert errors is not None
    assert float(without[0]) < 0.2 * errors.mean
    text = words_of(report(calibration).html)
    assert "turn, mrad" in text
    assert f"{outlier['turn_mrad']:.3f}" in text
    assert re.search(r"up to [\d.]+ mm and 8[67][.\d]* mrad off", text)


def test_of_the_outliers_the_advice_has_the_largest_distance():
    """The row with the worst score need not be the farthest: far out a joint scatters more."""
    arm = VirtualArm.paper(seed=2)
    table = arm.measure_table(arm.poses(60))
    for row, shift in ((11, 0.02), (30, 0.03), (52, 0.05)):
        table.loc[[row], "x"] += shift
    calibration = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table))
    rows = calibration.rows
    assert rows is not None
    raised = replace(rows, score=np.where(rows.data.rows == 12, 1e9, rows.score))
    made = report(replace(calibration, rows=raised))
    words = next(advice.words for advice in made.advice if advice.kind == "outliers")
    assert "rows 12, " in words
    largest = max(entry["distance_mm"] for entry in raised.outliers())
    assert float(re.findall(r"up to ([\d.]+) mm", words)[0]) == pytest.approx(largest, abs=0.05)
    assert largest > 40.0


@pytest.mark.parametrize(
    ("robust", "said", "advised"),
    [
        ("none", "Outliers, kept at full weight in the fit:", True),
        ("huber", "Outliers, given less weight in the fit:", False),
    ],
)
def test_a_robust_fit_is_advised_where_it_is_none(tmp_path, monkeypatch, capsys, robust, said, advised):
    monkeypatch.chdir(tmp_path)
    arm = VirtualArm.paper(seed=2)
    table = arm.measure_table(arm.poses(60))
    table.loc[[11], "x"] += 0.05
    table.to_csv("m.csv", index=False)
    options = ["--model", "constant", "--robust", robust, "-o", "out"]
    assert main(["calibrate", "rv-m2", "m.csv", *options]) == 0
    words = " ".join(capsys.readouterr().out.split())
    assert said in words
    assert ("--robust cauchy gives" in words) == advised


def test_outliers_of_the_training_rows_are_not_forgotten_in_the_fit_to_all():
    errs = Imperfections(length_mm=0.3, angle_deg=0.03, share=0.3, non_geometric="joint", noise_mm=0.0)
    errs = replace(errs, noise_mrad=0.0, repeatability_deg=0.004)
    arm, rng = VirtualArm(ta.Robot.load("ur5"), seed=0, imperfections=errs), np.random.default_rng(5)
    table, off = arm.measure_table(arm.poses(60, seed=1), seed=1), list(range(3, 45, 7))
    for pose in off:
        direction = rng.normal(size=3)
        table.loc[pose, ["x", "y", "z"]] += 1e-3 * direction / np.linalg.norm(direction)
    table = table.loc[table.index.repeat(3)].reset_index(drop=True)
    table[["x", "y", "z"]] += 3e-6 * rng.normal(size=(len(table), 3))
    found = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), threads=1)
    rows = sorted(entry["row"] for entry in found.summary["outliers"])
    assert rows == [3 * pose + shot for pose in off for shot in (1, 2, 3)]
