"""Fits that end elsewhere, and outliers that hide behind the noise that they make."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from truearm import calibrating
from truearm.doubts import Outliers, constant_is_better
from truearm.fitting import fit_rows
from truearm.models import CONSTANT, NOMINAL, VARIABLE
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
    [("ur10e", 3, 90, 1), ("ur10e", 3, 90, 3), ("ur10", 2, 90, 3), ("franka-panda", 4, -90, 1)],
)
def test_a_wrong_zero_that_is_found_in_one_fit_is_found_in_the_other(name, joint, degrees, seed):
    arm = VirtualArm(ta.Robot.load(name), seed=seed)
    data = arm.measure(arm.poses(60, seed=seed), seed=seed)
    calibration = ta.calibrate(turned(arm.robot, joint, degrees), data)
    said = calibration.validation.holdout[VARIABLE].position.mean
    assert said < 0.5
    assert fresh_error_mm(calibration, arm) < 2.0 * said
    assert f"theta{joint}" in " ".join(map(str, calibration.notices))


def test_a_fit_to_all_rows_that_goes_astray_is_not_kept(monkeypatch):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)

    def astray(task, trained, rows):
        return fit_rows(task, replace(rows, targets=np.roll(rows.targets, 1, axis=0)))

    monkeypatch.setattr(calibrating, "_fit_all", astray)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)))
    told = next(str(notice) for notice in calibration.notices if notice.kind == "refit_astray")
    assert "stays that of the training rows" in told
    assert "42 training rows" in told
    assert calibration.rows is not None
    assert len(calibration.rows.data) == 42
    assert fresh_error_mm(calibration, arm) < 0.5


@pytest.mark.parametrize("name", ["ur10", "kuka-iiwa-14"])
@pytest.mark.parametrize("seed", [2, 3])
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
    validation = ta.calibrate(arm.robot, arm.measure(arm.poses(60))).validation
    bent = {NOMINAL: 2.0, CONSTANT: 0.1, VARIABLE: 0.2}
    assert "0.1 mm against 0.2 mm" in str(
        constant_is_better(validation, VARIABLE, Outliers("row 1", bent))[0]
    )
    assert constant_is_better(validation, VARIABLE, Outliers("row 1", bent | {CONSTANT: 0.3})) == []
    assert constant_is_better(validation, VARIABLE, Outliers("", {})) == []


def test_a_coupling_of_four_joints_is_no_transform():
    scara = ta.Robot.load("adept-cobra-600")
    coupled = np.eye(4)
    coupled[1, 0] = 1.0
    coupled[2, 3] = 0.003
    assert np.array_equal(replace(scara, coupling=coupled).coupling, coupled)
    assert replace(scara, coupling=np.diag([1.0, -1.0, 1.0, 1.0])).coupling[1, 1] == -1.0
