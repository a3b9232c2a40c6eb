"""Arms that are not as they were calibrated, on measurements of another day."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.remastered import remastered_table
from truearm.cli import main
from truearm.doubts.as_calibrated import NOT_AS_CALIBRATED, can_be_updated
from truearm.doubts.of_results import NO_HELP
from truearm.frame_share import FRAME_UNCERTAIN
from truearm.reporting.report import report
from truearm.simulation import VirtualArm

SHIFT_DEG = np.array([0.0, 0.15, 0.0, 0.1, 0.0])
STILL = np.zeros(5)


@pytest.fixture(scope="module")
def known():
    arm = VirtualArm.paper(seed=2)
    return arm, ta.calibrate(arm.robot, arm.measure(arm.poses(60)))


def kinds(found):
    return [notice.kind for notice in found.notices]


def later(arm, shift_deg, **more):
    return remastered_table(arm, arm.poses(60, seed=3), shift_deg, seed=3, **more)


@pytest.mark.parametrize(
    ("shift_deg", "options", "expected"),
    [
        (SHIFT_DEG, {}, [NOT_AS_CALIBRATED]),
        (SHIFT_DEG, {"keep_frames": True}, [NOT_AS_CALIBRATED]),
        (STILL, {}, []),
        (STILL, {"keep_frames": True}, []),
        (STILL, {"frame_rows": 4}, [FRAME_UNCERTAIN]),
    ],
)
def test_an_arm_that_was_mastered_anew_is_told_from_one_as_it_was(shift_deg, options, expected, known):
    arm, calibration = known
    found = ta.evaluate(calibration, ta.Measurements.from_dataframe(later(arm, shift_deg)), **options)
    assert kinds(found) == expected
    assert found.errors["variable"].position.mean < found.errors["nominal"].position.mean


def test_a_target_that_slipped_is_told_as_before_where_it_was_kept(known):
    arm, calibration = known
    data = ta.Measurements.from_dataframe(later(arm, STILL, tool_mm=(0.8, 0.0, 0.4)))
    assert kinds(ta.evaluate(calibration, data, keep_tool=True)) == ["setup_moved"]


def test_an_instrument_that_states_how_it_scatters_is_no_change_of_the_arm(known):
    arm, calibration = known
    table = later(arm, STILL)
    table[["x", "y", "z"]] += np.random.default_rng(1).normal(scale=5e-4, size=(len(table), 3))
    assert kinds(ta.evaluate(calibration, ta.Measurements.from_dataframe(table))) == [NOT_AS_CALIBRATED]
    stated = ta.Measurements.from_dataframe(table.assign(sigma_mm=0.5))
    assert kinds(ta.evaluate(calibration, stated)) == []


def test_without_measurements_bounds_tell_and_an_update_is_not_proposed(known):
    arm, calibration = known
    far = ta.Measurements.from_dataframe(later(arm, 4.0 * SHIFT_DEG))
    stripped = calibration.without_rows()
    assert kinds(ta.evaluate(stripped, far)) == [NOT_AS_CALIBRATED]
    assert can_be_updated(calibration)
    assert not can_be_updated(stripped)


def test_an_update_is_proposed_in_place_of_compensation(known, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arm, calibration = known
    calibration.save("arm.calib")
    table = later(arm, SHIFT_DEG)
    table.to_csv("later.csv", index=False)
    assert main(["evaluate", "arm.calib", "later.csv", "--frame-rows", "20", "--use", "position"]) == 0
    told = capsys.readouterr()
    assert "The arm, its tool or the set-up is not as it was calibrated" in told.err
    assert "truearm update arm.calib later.csv --use position\n" in told.out
    assert "truearm compensate" not in told.out
    line = next(line for line in told.out.splitlines() if "truearm update" in line)
    assert main(line.split()[1:]) == 0
    assert "Offsets or tool changed." in capsys.readouterr().out


def test_an_arm_whose_calibration_was_good_is_changed_also_where_it_is_of_no_use_now(known):
    arm, calibration = known
    far = ta.Measurements.from_dataframe(later(arm, 24.0 * SHIFT_DEG))
    (said,) = ta.evaluate(calibration, far).notices
    assert said.kind == NOT_AS_CALIBRATED
    assert "Do not use it as it is" in str(said)
    assert "truearm update" in str(said)
    holdout = {**calibration.validation.holdout, "nominal": calibration.validation.holdout["variable"]}
    unproven = replace(calibration, validation=replace(calibration.validation, holdout=holdout))
    assert kinds(ta.evaluate(unproven, far)) == [NO_HELP]


def test_a_gross_row_that_was_held_out_hides_no_change(known):
    arm, calibration = known
    data, held = arm.measure(arm.poses(60)), calibration.held
    assert held is not None
    targets = data.targets.copy()
    targets[held.rows[0] - 1] = 0.0
    spoilt = ta.calibrate(arm.robot, replace(data, targets=targets))
    found = ta.evaluate(spoilt, ta.Measurements.from_dataframe(later(arm, SHIFT_DEG)))
    assert kinds(found) == [NOT_AS_CALIBRATED]


def test_a_report_does_not_begin_with_what_was_reached_on_another_day(known):
    arm, calibration = known
    names = {}
    for name, shift_deg in (("moved", SHIFT_DEG), ("still", STILL)):
        data = ta.Measurements.from_dataframe(later(arm, shift_deg))
        made = report(calibration, ta.evaluate(calibration, data), other_names=("later.csv",))
        names[name] = made.advice[0].name
        words = "The arm, its tool or the set-up is not as it was calibrated."
        assert (words in made.html) == (name == "moved")
    assert names["moved"] == "Look at the other measurements first."
    assert names["still"] != names["moved"]
