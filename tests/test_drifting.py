"""Set-ups that move while they are measured."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.report_support import words_of
from truearm.cli import main
from truearm.drifting import Drift
from truearm.reporting.report import report
from truearm.simulation import VirtualArm

FAR = np.array([0.12, -0.05, 0.16]) / 1e3
ROWS = 150


def warming(count):
    """How far a set-up that warms up has moved at each of so many rows (n, 3), m."""
    return (1.0 - np.exp(-np.linspace(0.0, 5.0, count)))[:, None] * FAR


def moved(data, by):
    """Measurements of a set-up that moved."""
    return replace(data, targets=data.targets + by[:, None])


@pytest.fixture(scope="module")
def measured():
    """An arm whose measuring instrument warmed up, and what would have been measured without."""
    arm = VirtualArm.paper(seed=4)
    steady = arm.measure(arm.poses(ROWS))
    return arm, steady, moved(steady, warming(ROWS))


@pytest.fixture(scope="module")
def settled(measured):
    arm, _, data = measured
    return ta.calibrate(arm.robot, data)


def rows_of(calibration):
    """The rows of a calibration that has them."""
    assert calibration.rows is not None
    return calibration.rows


def drift_of(calibration):
    """What a calibration says that was taken out, where something was."""
    assert calibration.validation.drift is not None
    return calibration.validation.drift


def held_mean(calibration):
    return calibration.validation.holdout["variable"].position.mean


def test_what_a_set_up_moved_is_found_and_taken_out(measured, settled):
    arm, steady, data = measured
    rows = rows_of(settled)
    order = np.argsort(rows.data.rows)
    truth = warming(ROWS)
    left = rows.moved[order] - (truth - truth.mean(axis=0))
    left -= left.mean(axis=0)
    assert np.sqrt(np.square(left).mean()) < 0.5 * np.sqrt(np.square(truth - truth.mean(axis=0)).mean())
    left_in, alone = ta.calibrate(arm.robot, data, drift="none"), ta.calibrate(arm.robot, steady)
    assert held_mean(settled) < 0.5 * (held_mean(left_in) + held_mean(alone))
    assert left_in.validation.drift is None
    assert rows_of(left_in).moved is None


def test_it_is_told_with_what_it_would_do_if_left_in(settled):
    drift = drift_of(settled)
    (span,) = drift.moved_mm.values()
    assert 0.5 < span / (1e3 * np.linalg.norm(FAR)) < 1.2
    assert drift.left_in_mean_mm["variable"] > 1.05 * held_mean(settled)
    (notice,) = [notice for notice in settled.notices if notice.kind == "drift"]
    assert f"{drift.left_in_mean_mm['variable']:.4g} mm" in str(notice)
    assert "--drift none" in str(notice)
    assert settled.summary["drift"] == drift.to_dict()


def test_the_rows_stay_as_they_were_measured(measured, settled, tmp_path):
    _, _, data = measured
    rows = rows_of(settled)
    assert np.array_equal(rows.data.targets, data.targets[rows.data.rows - 1])
    assert ta.evaluate(settled, data, keep_frames=True).notices[0].kind == "known_rows"
    settled.save(tmp_path / "a.calib")
    again = ta.Calibration.load(tmp_path / "a.calib")
    assert np.array_equal(rows_of(again).moved, rows.moved)
    assert again.validation.drift == settled.validation.drift


def test_rows_in_any_order_give_the_same_drift(measured, settled):
    """Their numbers say when they were measured."""
    arm, _, data = measured
    order = np.random.default_rng(5).permutation(ROWS)
    other = ta.calibrate(arm.robot, data.select(order))
    spans = [np.ptp(rows_of(calibration).moved, axis=0) for calibration in (other, settled)]
    assert spans[0] == pytest.approx(spans[1], abs=4e-5)


def test_nothing_moves_where_nothing_moved():
    for seed in range(6):
        arm = VirtualArm.paper(seed=seed)
        calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60 + 30 * seed)), refit=False)
        assert calibration.validation.drift is None
        assert not [notice for notice in calibration.notices if notice.kind == "drift"]


def test_a_set_up_that_moved_leaves_the_others_where_they_are():
    arm = VirtualArm.paper(seed=6)
    both = arm.measure(arm.poses(240))
    first, second = both.select(np.arange(120)), both.select(np.arange(120, 240))
    still = replace(first, group=np.full(120, "still"), sources=np.full(120, "still.csv"))
    warm = replace(moved(second, warming(120)), group=np.full(120, "warm"), sources=np.full(120, "warm.csv"))
    calibration = ta.calibrate(arm.robot, [still, warm])
    assert list(drift_of(calibration).moved_mm) == ["warm"]
    rows = rows_of(calibration)
    assert not rows.moved[rows.data.group == "still"].any()


def test_the_constant_model_sees_what_exceeds_its_own_residuals():
    arm = VirtualArm.paper(seed=7)
    steady = arm.measure(arm.poses(90))
    far = ta.calibrate(arm.robot, moved(steady, 20.0 * warming(90)), model="constant")
    near = ta.calibrate(arm.robot, steady, model="constant")
    mean = [calibration.validation.holdout["constant"].position.mean for calibration in (far, near)]
    assert far.validation.drift is not None
    assert mean[0] < 1.5 * mean[1]


def test_no_drift_takes_nothing_out(measured):
    _, steady, _ = measured
    assert Drift.none(ROWS).taken_out(steady) is steady
    assert not Drift.none(ROWS).spans(steady)


def test_the_command_line_finds_it_or_leaves_it_in(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arm = VirtualArm.paper(seed=4)
    table = arm.measure_table(arm.poses(ROWS))
    table[["x", "y", "z"]] += warming(ROWS)
    table.to_csv("m.csv", index=False)

    def calibrated(*more):
        status = main(["calibrate", "rv-m2", "m.csv", "-o", "out", *more])
        out, err = capsys.readouterr()
        return status, out, " ".join(err.split())

    status, out, err = calibrated("--json")
    assert status == 0
    assert json.loads(out)["drift"]["moved_mm"]["m"] > 0.1
    assert "The set-up moved while it was measured" in err
    status, out, err = calibrated("--json", "--drift", "none")
    assert status == 0
    assert json.loads(out)["drift"] is None
    assert "moved while" not in err
    status, _, err = calibrated("--drift", "some")
    assert status == 2
    assert 'drift: "some" is not known. Either auto or none' in err


def test_the_report_shows_how_the_set_up_moved(settled):
    made = report(settled)
    told = {advice.kind: advice.words for advice in made.advice}
    assert "moved by 0.1" in told["warm_up"]
    (says,) = [says for title, says in made.figures if title.startswith("How the set-up moved")]
    first = int(re.findall(r"within the first (\d+) of 150 rows", says)[0])
    assert 10 < first < 50, "half of it took an eighth of the session"
    assert drift_of(settled).words in words_of(made.html)
    without = report(settled.without_rows())
    assert not [title for title, _ in without.figures if title.startswith("How the set-up moved")]
    assert "warm_up" in {advice.kind for advice in without.advice}
