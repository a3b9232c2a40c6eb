"""Joints that move with a column of the file, or while they are measured, are told."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm.doubts.at_once import JOINT_MOVED
from truearm.doubts.moved_joints import JOINTS_MOVED, UNUSED_COLUMN
from truearm.doubts.row_order import FEWEST_VISITS
from truearm.doubts.visited import MOST_VALUES
from truearm.doubts.whitened import Whitened
from truearm.reporting.report import report
from truearm.simulation import Imperfections, VirtualArm

ROWS = 60
WARM = 15.0 * (1.0 - np.exp(-3.0 * np.linspace(0.0, 1.0, ROWS)))
"""How much warmer an arm is at each row than at the first, K."""
PER_KELVIN = np.array([12.0, -9.0, 7.0, 10.0, -8.0, 6.0]) * 1e-6
"""How far its joints turn from their readings, rad."""


@pytest.fixture(scope="module")
def arm():
    plain = Imperfections(share=0.0, noise_mm=0.02)
    return VirtualArm(ta.Robot.load("ur10"), seed=4, imperfections=plain)


def told(arm, turned, columns, **options):
    """Notices of joints that move, of a calibration where joints turned (n, N) from their readings."""
    readings = arm.poses(ROWS)
    features = pd.DataFrame({"humidity": np.random.default_rng(0).normal(50.0, 3.0, ROWS), **columns})
    data = replace(arm.measure(readings + turned), readings=readings, features=features)
    found = ta.calibrate(arm.robot, data, refit=False, holdout=0.1, **options)
    return {notice.kind: str(notice) for notice in found.notices}, found


def test_the_column_that_errors_go_with_is_named_though_cells_are_empty(arm):
    seen = 20.0 + WARM + np.random.default_rng(2).normal(0.0, 0.3, ROWS)
    seen[::15] = np.nan
    notices, found = told(arm, np.outer(WARM, PER_KELVIN), {"temperature_C": seen})
    said = notices[UNUSED_COLUMN]
    assert "rows have none" in said
    assert "--features temperature_C, if it is known where programs run" in said
    assert "humidity" not in said
    assert JOINTS_MOVED not in notices
    assert said in {advice.words for advice in report(found).advice}


def test_a_column_that_goes_with_the_time_is_not_told_from_it_and_numbers_of_rows_are_none(arm):
    columns = {"id": np.arange(ROWS) + 1.0, "pose": np.arange(ROWS) % 50, "temperature_C": 20.0 + WARM}
    notices, _ = told(arm, np.outer(WARM, PER_KELVIN), columns)
    assert UNUSED_COLUMN not in notices
    assert "temperature_C goes one way meanwhile" in notices[JOINTS_MOVED]
    assert "--features temperature_C" in notices[JOINTS_MOVED]


def test_joints_that_move_while_they_are_measured_are_told(arm):
    turned = np.outer(WARM, PER_KELVIN)
    notices, _ = told(arm, turned, {"id": np.arange(ROWS) + 1.0})
    assert UNUSED_COLUMN not in notices
    assert "--drift none" in notices[JOINTS_MOVED]
    assert JOINTS_MOVED not in told(arm, turned, {}, drift="none")[0]


def test_a_column_that_is_used_is_not_told(arm):
    columns = {"temperature_C": 20.0 + WARM}
    notices, _ = told(arm, np.outer(WARM, PER_KELVIN), columns, features=["temperature_C"])
    assert not {UNUSED_COLUMN, JOINTS_MOVED} & set(notices)


def test_an_arm_that_gives_way_under_loads_names_their_column(arm):
    load = np.tile([0.0, 5.0, 10.0], ROWS // 3)
    lever = arm.robot.joint_jacobian(arm.poses(ROWS))[:, 2]
    notices, _ = told(arm, -3e-5 * lever * load[:, None], {"payload_kg": load})
    assert "--features payload_kg" in notices[UNUSED_COLUMN]


def test_a_column_that_changes_where_a_joint_moves_is_named_with_it(arm):
    load, humidity = np.where(np.arange(ROWS) < 30, 0.0, 8.0), np.tile([40.0, 60.0], ROWS // 2)
    turned = np.outer(load, [0.0, -5e-5, 0.0, 0.0, 0.0, 0.0])
    notices, _ = told(arm, turned, {"payload_kg": load, "humidity": humidity})
    assert "joint 2 moved by -0.02" in notices[JOINT_MOVED]
    assert "But payload_kg changes there as well: if it is what moves" in notices[JOINT_MOVED]
    assert "calibrate with --features payload_kg" in notices[JOINT_MOVED]


def test_an_arm_that_does_not_move_is_not_doubted(arm):
    columns = {"temperature_C": 20.0 + WARM, "load_kg": np.random.default_rng(1).choice([0.0, 5.0], ROWS)}
    notices, _ = told(arm, np.zeros((ROWS, 6)), columns)
    assert not {UNUSED_COLUMN, JOINTS_MOVED} & set(notices)


def test_what_chance_explains_is_as_likely_as_it_is():
    """Residuals of a fit with 40 unknowns; of columns that explain nothing each chance is as frequent."""
    rng = np.random.default_rng(3)
    visits, width = 40, 3
    fitted, _ = np.linalg.qr(rng.normal(size=(visits * width, 40)))
    taken, found = fitted @ fitted.T, []
    for _ in range(200):
        noise = rng.normal(size=visits * width)
        left = (noise - taken @ noise).reshape(visits, width)
        root, shots = np.eye(visits * width), np.ones_like(left)
        nothing = np.zeros((visits, width, 6))
        seen = Whitened(np.arange(visits), left, shots, root, taken, nothing, np.ones_like(left), nothing)
        found.append(seen.explained(rng.normal(size=(visits, width, 6)))[0])
    assert np.quantile(found, [0.1, 0.5, 0.9]) == pytest.approx([0.1, 0.5, 0.9], abs=0.08)


def test_what_columns_do_is_found_with_its_size():
    rng = np.random.default_rng(3)
    columns, by = rng.normal(size=(50, 3, 2)), np.array([0.5, -1.0])
    noise = 0.1 * rng.normal(size=(50, 3))
    root, ones = np.eye(150), np.ones((50, 3))
    left = columns @ by + noise
    seen = Whitened(np.arange(50), left, ones, root, np.zeros((150, 150)), columns, ones, columns)
    chance, found = seen.explained(columns)
    assert chance < 1e-20
    assert found == pytest.approx(by, abs=0.05)


def test_of_many_targets_on_a_tool_enough_visits_are_looked_at():
    plain = Imperfections(share=0.0, noise_mm=0.02)
    several = VirtualArm(ta.Robot.load("ur10"), seed=4, imperfections=plain)
    readings, measured = several.poses(40), []
    for seed, target in enumerate(np.random.default_rng(2).uniform(-0.1, 0.1, (14, 3))):
        several.target_in_flange = target
        measured.append(several.measure(readings, seed=seed))
    data = replace(measured[0], targets=np.concatenate([each.targets for each in measured], axis=1))
    found = ta.calibrate(several.robot, data, model="constant")
    assert found.rows is not None
    seen = Whitened.of(found, found.rows, np.linspace(0.0, 1.0, 40))
    assert seen is not None
    assert len(seen.rows) >= FEWEST_VISITS
    assert seen.left.size <= MOST_VALUES
    assert np.square(seen.left).sum() == pytest.approx(seen.freedom, rel=0.1)
