"""Fits that end elsewhere, and outliers that hide behind the noise that they make."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from truearm import calibrating
from truearm.doubts.of_results import SURE, constant_is_better
from truearm.doubts.outliers import Outliers
from truearm.fits.fitting import fit_rows
from truearm.fits.models import CONSTANT, NOMINAL, VARIABLE
from truearm.judgement.held_rows import HeldRows
from truearm.judgement.validation import FEW_HELD, RowErrors
from truearm.simulation import VirtualArm

FRESH = 99


def turned(robot, joint, degrees):
    """The robot with another zero of a joint, from 1, in its table."""
    table = robot.table.copy()
    table[joint - 1, 0] += np.radians(degrees)
    return replace(robot, table=table)


def fresh_error_mm(calibration, arm):
    """Mean error on poses that took no part in anything."""
    measured = arm.measure(arm.poses(200, seed=FRESH), seed=FRESH)
    found = calibration.position(measured.readings, group=calibration.groups[0], target=1)
    return 1e3 * float(np.linalg.norm(found - measured.targets[:, 0], axis=1).mean())


@pytest.mark.parametrize(
    ("name", "joint", "degrees", "seed"),
    [("ur10e", 3, 90, 1), ("ur10", 2, 90, 3), ("franka-panda", 4, -90, 1)],
)
def test_a_wrong_zero_that_is_found_in_one_fit_is_found_in_the_other(name, joint, degrees, seed):
    arm = VirtualArm(ta.Robot.load(name), seed=seed)
    data = arm.measure(arm.poses(60, seed=seed), seed=seed)
    calibration = ta.calibrate(turned(arm.robot, joint, degrees), data)
    said = calibration.validation.holdout[VARIABLE].position.mean
    assert said < 0.5
    assert fresh_error_mm(calibration, arm) < 2.0 * said
    assert f"the zero of joint {joint} " in " ".join(map(str, calibration.notices))


def test_a_fit_to_all_rows_that_goes_astray_is_not_kept(monkeypatch):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)

    def astray(task, trained, rows):
        data, _, order = rows
        data = data.select(order)
        return fit_rows(task, replace(data, targets=np.roll(data.targets, 1, axis=0)))

    monkeypatch.setattr(calibrating, "_fit_all", astray)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)))
    told = next(str(notice) for notice in calibration.notices if notice.kind == "refit_astray")
    assert "stays that of the training rows" in told
    assert "42 training rows" in told
    assert calibration.rows is not None
    assert len(calibration.rows.data) == 42
    assert fresh_error_mm(calibration, arm) < 0.5


@pytest.mark.parametrize(("name", "seed"), [("ur10", 2), ("ur10", 3), ("kuka-iiwa-14", 3)])
def test_many_outliers_among_few_rows_are_named(name, seed):
    arm = VirtualArm(ta.Robot.load(name), seed=seed)
    table = arm.measure_table(arm.poses(60, seed=seed), seed=seed)
    random = np.random.default_rng(seed)
    rows = random.choice(60, 6, replace=False)
    shifts = random.normal(size=(6, 3))
    table.loc[rows, ["x", "y", "z"]] += 0.02 * shifts / np.linalg.norm(shifts, axis=1, keepdims=True)
    calibration = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table))
    named = {entry["row"] for entry in calibration.summary["outliers"]}
    assert named == {int(row) + 1 for row in rows}
    assert fresh_error_mm(calibration, arm) < 0.3


def test_constants_are_compared_without_outliers():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)))
    validation, held = replace(calibration.validation, n_holdout_poses=FEW_HELD), calibration.held
    few = calibration.validation
    assert held is not None
    errors = {**held.errors, CONSTANT: held.errors[VARIABLE], VARIABLE: held.errors[CONSTANT]}
    swapped = replace(held, errors=errors)
    bent = {NOMINAL: 2.0, CONSTANT: 0.1, VARIABLE: 0.2}
    entry = {"file": str(held.sources[0]), "row": int(held.rows[0]), "distance_mm": 9.0}

    def said(outliers, rows=swapped, judged=validation):
        return "".join(map(str, constant_is_better(judged, VARIABLE, rows, outliers)))

    told = said(Outliers("row 1", bent, entries=[entry]))
    assert "0.1 mm against 0.2 mm. Give --model constant --robust cauchy, or" in told
    assert "Give --model constant, or" in said(Outliers("row 1", bent))
    unsure = said(Outliers("row 1", bent), judged=few)
    assert "18 held-out poses, outliers left out" in unsure
    assert "So few do not tell" in unsure
    assert "--model" not in unsure
    assert said(Outliers("row 1", bent | {CONSTANT: 0.3})) == ""
    assert said(Outliers("", {})) == ""
    assert said(Outliers("row 1", bent), held) == ""
    assert said(Outliers("row 1", bent), None) == ""


def test_constants_that_are_nearer_by_chance_are_not_called_better():
    """One pose of twenty makes the difference, or every pose does."""
    rows = np.arange(20)
    readings = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 6))
    near = np.full((20, 3), 1e-4)
    chance = near + np.where(rows == 7, 1e-3, 0.0)[:, None]
    sure = near + 3e-5 * (1.0 + 0.5 * np.sin(rows))[:, None]
    found = []
    for far in (chance, sure):
        errors = {CONSTANT: RowErrors(near), VARIABLE: RowErrors(far)}
        held = HeldRows(readings, rows + 1, np.repeat("m.csv", 20), errors)
        found.append(held.lead_mm(CONSTANT, VARIABLE, []))
        assert found[-1][0] == pytest.approx(1e3 * np.sqrt(3.0) * (far - near)[:, 0].mean())
    assert [lead > SURE * error for lead, error in found] == [False, True]
    seven = {"file": "m.csv", "row": 8}
    held = replace(held, errors={CONSTANT: RowErrors(near), VARIABLE: RowErrors(chance)})
    assert held.lead_mm(CONSTANT, VARIABLE, [seven])[0] == pytest.approx(0.0)


def test_shots_of_a_pose_count_once_where_models_are_compared():
    readings = np.repeat(np.random.default_rng(0).uniform(-1.0, 1.0, (2, 6)), (9, 1), axis=0)
    far = np.repeat([[3e-4, 0.0, 0.0], [1e-4, 0.0, 0.0]], (9, 1), axis=0)
    errors = {CONSTANT: RowErrors(np.zeros((10, 3))), VARIABLE: RowErrors(far)}
    held = HeldRows(readings, np.arange(10), np.repeat("m.csv", 10), errors)
    lead, error = held.lead_mm(CONSTANT, VARIABLE, [])
    assert lead == pytest.approx(0.2)
    assert error == pytest.approx(0.1)


def test_a_coupling_of_four_joints_is_no_transform():
    scara = ta.Robot.load("adept-cobra-600")
    coupled = np.eye(4)
    coupled[1, 0] = 1.0
    coupled[2, 3] = 0.003
    assert np.array_equal(replace(scara, coupling=coupled).coupling, coupled)
    assert replace(scara, coupling=np.diag([1.0, -1.0, 1.0, 1.0])).coupling[1, 1] == -1.0
