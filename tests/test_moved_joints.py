"""Joints that move with a column of the file, or while they are measured, are told."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm.doubts.at_once import JOINT_MOVED, SCALE_DIFFERS, STEP_KINDS
from truearm.doubts.moved_words import JOINTS_MOVED, LINKS_GREW, UNUSED_COLUMN
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


MANY = 90
"""Rows that leave enough of what grows, which what varies follows in few."""
BY_DAY = np.repeat(["mon", "tue"], MANY // 2)
STEEL = 12e-6
"""Part of their length by which links grow with a kelvin."""


def told(arm, turned, columns, grown=0.0, group=None, stand=0.0, **options):
    """Notices of what moves, of a calibration where joints turned (n, N) from their readings, and the arm,
    with so high a stand, m, grew by parts (n,) of its lengths.
    """
    count = max(np.size(grown), len(np.atleast_2d(turned)), ROWS)
    readings = arm.poses(count)
    features = pd.DataFrame({"humidity": np.random.default_rng(0).normal(50.0, 3.0, count), **columns})
    data = replace(arm.measure(readings + turned), readings=readings, features=features)
    by = (
        (reached(arm, readings) + np.array([0.0, 0.0, stand]))
        * np.reshape(grown, (-1, 1))
        @ arm.world_from_base[:3, :3].T
    )
    data = replace(data, targets=data.targets + by[:, None], group=data.group if group is None else group)
    found = ta.calibrate(arm.robot, data, refit=False, holdout=0.1, **options)
    return {notice.kind: str(notice) for notice in found.notices}, found


def reached(arm, readings):
    """Where the target is at some readings (n, 3), from the arm's base."""
    pose = arm.true_pose(readings)
    return pose[:, :3, :3] @ arm.target_in_flange + pose[:, :3, 3]


def test_the_column_that_errors_go_with_is_named_though_cells_are_empty(arm):
    seen = 20.0 + WARM + np.random.default_rng(2).normal(0.0, 0.3, ROWS)
    seen[::15] = np.nan
    notices, found = told(arm, 1.5 * np.outer(WARM, PER_KELVIN), {"temperature_C": seen})
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


def test_links_that_grow_with_a_temperature_name_its_column(arm):
    """By as much as the places of the target, from their middle, grow from the coldest row to the warmest."""
    swing = 10.0 * np.sin(np.arange(MANY) * 2.0 * np.pi / 15.0)
    grown, places = 2.0 * STEEL * swing, reached(arm, arm.poses(MANY))
    notices, _ = told(arm, 0.0, {"temperature_C": 20.0 + swing}, grown)
    said = notices[UNUSED_COLUMN]
    assert said.startswith("Errors go with temperature_C")
    assert "as of links that grow with it" in said
    mm = 1e3 * np.ptp(grown) * np.linalg.norm(places - places.mean(axis=0), axis=1).mean()
    assert float(said.split("(by ")[1].split(" mm")[0]) == pytest.approx(mm, rel=0.2)
    assert "--features temperature_C" in said
    used, _ = told(arm, 0.0, {"temperature_C": 20.0 + swing}, grown, features=["temperature_C"])
    assert UNUSED_COLUMN not in used


def test_a_joint_and_links_that_move_with_a_temperature_are_told_together_with_their_size(arm):
    """As far as both move the target from the coldest row to the warmest, in the mean over the poses."""
    swing = 10.0 * np.sin(np.arange(MANY) * 2.0 * np.pi / 15.0)
    grown, turned = 2.0 * STEEL * swing, 7e-5 * np.outer(swing, np.eye(6)[1])
    notices, _ = told(arm, turned, {"temperature_C": 20.0 + swing}, grown)
    said = notices[UNUSED_COLUMN]
    assert "as of joints that move and links that grow with it" in said
    readings = arm.poses(MANY)
    places = reached(arm, readings)
    by = reached(arm, readings + np.ptp(swing) * 7e-5 * np.eye(6)[1]) - places
    by += np.ptp(grown) * (places - places.mean(axis=0))
    mm = 1e3 * np.linalg.norm(by, axis=1).mean()
    assert float(said.split("(by ")[1].split(" mm")[0]) == pytest.approx(mm, rel=0.2)


def test_an_arm_that_grows_while_it_is_measured_is_told_beside_the_drift_of_its_points(arm):
    warm = np.interp(np.linspace(0.0, 1.0, MANY), np.linspace(0.0, 1.0, ROWS), WARM)
    grown = 2.0 * STEEL * warm
    notices, _ = told(arm, 0.0, {}, grown, stand=1.0)
    assert "drift" in notices
    assert "an arm that warms up" in notices[LINKS_GREW]
    seen = 20.0 + warm + np.random.default_rng(2).normal(0.0, 0.3, MANY)
    notices, _ = told(arm, 0.0, {"temperature_C": seen}, grown, stand=1.0)
    assert "as of links that grow with it" in notices[UNUSED_COLUMN]


def test_set_ups_of_different_temperature_name_the_column(arm):
    warmer = np.where(BY_DAY == "tue", 20.0, 0.0)
    columns = {"temperature_C": 20.0 + warmer}
    notices, _ = told(arm, 0.0, columns, 2.0 * STEEL * warmer, BY_DAY)
    said = notices[SCALE_DIFFERS]
    assert "But temperature_C changes there as well: if it is what lengthens the links" in said
    assert said.endswith("calibrate with --features temperature_C.")
    assert "humidity" not in said


def test_set_ups_of_different_temperature_are_told_apart_by_it(arm):
    """Three of them: one that differs from the others explains less than the column does."""
    warmer = np.repeat([0.0, 20.0, 10.0], 40)
    columns, days = {"temperature_C": 20.0 + warmer}, np.repeat(["mon", "tue", "wed"], 40)
    notices, _ = told(arm, 0.0, columns, 2.0 * STEEL * warmer, days)
    assert "as of links that grow with it" in notices[UNUSED_COLUMN]
    assert not set(STEP_KINDS) & set(notices)


def test_set_ups_with_different_loads_are_told_by_their_column(arm):
    load = np.where(BY_DAY == "tue", 10.0, 0.0)
    lever = arm.robot.joint_jacobian(arm.poses(MANY))[:, 2]
    columns, turned = {"payload_kg": load}, -5e-5 * lever * load[:, None]
    notices, _ = told(arm, turned, columns, group=BY_DAY)
    assert "payload_kg (by" in notices[UNUSED_COLUMN]
    assert "--features payload_kg" in notices[UNUSED_COLUMN]
    assert UNUSED_COLUMN not in told(arm, turned, columns, group=BY_DAY, features=["payload_kg"])[0]


def test_joints_that_differ_between_set_ups_may_carry_another_load(arm):
    turned = np.outer(BY_DAY == "tue", np.radians([0.0, 0.03, -0.04, 0.05, 0.06, 0.0]))
    said = told(arm, turned, {}, group=BY_DAY)[0][JOINT_MOVED]
    assert "against the other set-ups, joints moved against their readings" in said
    assert "or another load is carried (note it in a column payload_kg)" in said
    assert "calibrate from those of " in said


def test_a_joint_that_differs_between_set_ups_is_told_with_what_differs_there_as_well(arm):
    turned = np.outer(BY_DAY == "tue", np.radians([0.0, 0.03, 0.0, 0.0, 0.0, 0.0]))
    columns = {
        "batch": np.where(BY_DAY == "tue", 7.0, 4.0),
        "oil_C": np.random.default_rng(5).normal(30.0, 2.0, MANY),
    }
    notices, _ = told(arm, turned, columns, group=BY_DAY)
    said = notices[JOINT_MOVED]
    assert "joint 2 moved by" in said
    assert "But batch changes there as well" in said
    assert "oil_C" not in said


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
        seen = Whitened(
            np.arange(visits), left, shots, root, taken, nothing, np.ones_like(left), nothing, left
        )
        found.append(seen.explained(rng.normal(size=(visits, width, 6))).chance)
    assert np.quantile(found, [0.1, 0.5, 0.9]) == pytest.approx([0.1, 0.5, 0.9], abs=0.08)


def test_what_columns_do_is_found_with_its_size():
    rng = np.random.default_rng(3)
    columns, by = rng.normal(size=(50, 3, 2)), np.array([0.5, -1.0])
    noise = 0.1 * rng.normal(size=(50, 3))
    root, ones = np.eye(150), np.ones((50, 3))
    left = columns @ by + noise
    seen = Whitened(np.arange(50), left, ones, root, np.zeros((150, 150)), columns, ones, columns, left)
    found = seen.explained(columns)
    assert found.chance < 1e-20
    assert found.sizes == pytest.approx(by, abs=0.05)


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
