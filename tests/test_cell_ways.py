"""Ways past the table: rehearsed as they will be gone, and poses put into an order in which there is one."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.cell_support import cell_text, poses_of
from truearm.cell import Cell, RefusedError
from truearm.cell.clearance import Clearance
from truearm.cell.examples import example
from truearm.cell.motion import Motion
from truearm.cell.plan import PlanOptions, measurable_pool, plan_poses
from truearm.cell.poses_file import Poses
from truearm.cell.prediction import Prediction
from truearm.cell.reaching import within_reach
from truearm.cell.rehearsal import Walk, problem_of, rehearse
from truearm.cell.session import Step
from truearm.cell.table_panel import TablePanel
from truearm.cell.ways import Ways
from truearm.cli import main

BLOCKED = "link or tool would meet the table on every way there"


@pytest.fixture(scope="module")
def cell():
    return Cell.from_toml(example("ur"))


@pytest.fixture(scope="module")
def at_random(cell):
    """Poses each of which the table can measure, whatever lies between them."""
    return poses_of(cell, 30, seed=1)


def motion_of(cell, *rules):
    return Motion(cell.arm, cell, rules, [cell.flange_from_target])


def refused(cell, poses):
    return [each for each in rehearse(cell, poses).refused if each.step.kind == "pose"]


def test_ways_between_poses_are_rehearsed(cell, at_random):
    found = refused(cell, at_random)
    assert found
    assert all(each.problem == f"{BLOCKED}, from the step before" for each in found)


def test_poses_are_put_off_until_there_is_a_way(cell, at_random):
    poses, left = within_reach(motion_of(cell), at_random)
    assert sorted(map(tuple, poses.readings)) == sorted(map(tuple, at_random.readings))
    assert len(refused(cell, poses)) == len(left) < len(refused(cell, at_random))


def test_what_is_measured_again_comes_behind_its_first_time(cell, at_random):
    twice = Poses(np.repeat(at_random.readings, 2, axis=0), np.tile([1, -1], 30), ("train", "repeat") * 30)
    poses, left = within_reach(motion_of(cell), twice)
    seen: set[tuple[float, ...]] = set()
    for readings, purpose in zip(poses.readings[: 60 - len(left)], poses.purpose, strict=False):
        assert (purpose == "repeat") == (tuple(readings) in seen)
        seen.add(tuple(readings))


def test_a_plan_has_a_way_to_each_pose(cell, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.toml").write_text(example("ur"))
    assert main(["plan", "ur5e", "-n", "20", "--cell", "cell.toml", "-o", "poses.csv", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["unreached"] == []
    assert refused(cell, Poses.read_csv("poses.csv", cell.arm)) == []
    monkeypatch.setattr("truearm.cell.plan.within_reach", lambda _, poses: (poses, [len(poses) - 1]))
    assert main(["plan", "ur5e", "-n", "20", "--cell", "cell.toml", "-o", "poses.csv"]) == 0
    assert BLOCKED in capsys.readouterr().err


def test_times_are_those_of_the_poses_that_are_written(cell):
    plan = plan_poses(cell.arm, PlanOptions(count=12))
    seconds = sum(float(np.abs(b - a).max()) for a, b in pairwise(plan.poses.readings))
    assert plan.seconds["there-and-back"] == pytest.approx(seconds)


def test_a_table_that_stands_too_near_may_leave():
    cell = Cell.from_toml(cell_text())
    table, prediction = cell.sensor, Prediction(cell)
    assert isinstance(table, TablePanel)
    here, there = poses_of(cell, 2, seed=1).readings
    expected = [prediction.expected(Step(0, "pose", 0, "", 0, place)) for place in (here, there)]
    near = table.carriage_for(expected[0]) + 0.015 * table.panel.normal
    frame = prediction.world_from_base
    assert frame is not None
    clearance = Clearance(cell.arm, cell.flange_from_target, table.panel, cell.file.clearance)
    assert clearance.margin(here[None], near[None], frame) < expected[1].radius_m
    found = Ways(cell, table).to(
        [there], expected[1], here=here, carriage=near, refuge=here, world_from_base=frame
    )
    assert found.over is not None
    assert found.over[0][2] < near[2]


def legs(found, here, start, end):
    """What moves one after another: from and to of the arm, from and to of the carriage."""
    arm, before = [here, *found.arm], [start, *found.over, *([end] if found.waits else [])]
    return (
        [(here, here, a, b) for a, b in pairwise(before)]
        + [(a, b, before[-1], before[-1]) for a, b in pairwise(arm)]
        + [(arm[-1], arm[-1], before[-1], end)]
    )


def least_gaps(clearance, frame, moves):
    """Least gap between link and column, and between tool and plate, as all of the moves are made."""
    share = np.linspace(0.0, 1.0, 41)[:, None]
    gaps = [clearance.gaps(a + share * (b - a), c + share * (d - c), frame) for a, b, c, d in moves]
    return np.concatenate(gaps).min(axis=0)


def test_the_arm_goes_first_where_it_rises_and_the_table_where_it_comes_down():
    cell = Cell.from_toml(cell_text())
    table, prediction = cell.sensor, Prediction(cell)
    assert isinstance(table, TablePanel)
    frame = prediction.world_from_base
    assert frame is not None
    prediction.register(frame, 0.0)
    clearance = Clearance(cell.arm, cell.flange_from_target, table.panel, cell.file.clearance)
    rng, radius, ways = np.random.default_rng(0), prediction.radius_m, []
    for here in poses_of(cell, 40, seed=1).readings:
        there = here + np.radians(rng.uniform(-2.0, 2.0, 5))
        steps = [Step(0, "pose", 0, "", 0, readings) for readings in (here, there)]
        if problem_of(cell, prediction, steps[1]):
            continue
        places = [prediction.expected(step) for step in steps]
        start, end = (table.carriage_for(each) for each in places)
        found = Ways(cell, table).to(
            [there], places[1], here=here, carriage=start, refuge=here, world_from_base=frame
        )
        rises = places[1].point_in_world[2] > places[0].point_in_world[2]
        ways.append("together" if found.over is None else "around" if found.over else (rises, found.waits))
        if found.over is not None:
            links, tool = least_gaps(clearance, frame, legs(found, here, start, end))
            assert links > 1e-3 * cell.file.clearance.margin_mm + radius
            assert tool > radius
    assert ways.count((True, False)) > 5
    assert ways.count((False, True)) > 5
    assert ways.count("around") + ways.count((True, True)) + ways.count((False, False)) < 5


def test_planned_pins_meet_the_panel_wherever_the_base_may_stand():
    cell = Cell.from_toml(example("rv-m2"))
    pool = measurable_pool(motion_of(cell), 400, 0)
    flanges = cell.arm.flange_chain.pose(cell.arm.joints_from_readings(pool))
    along = flanges[:, :3, :3] @ cell.flange_from_target[:3, 3]
    along /= np.linalg.norm(along, axis=1)[:, None]
    assert cell.file.world is not None
    angles = []
    for direction in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
        turn = np.radians(0.5) * np.array([np.cos(direction), np.sin(direction), 0.0])
        off = cell.file.world.transform()[:3, :3] @ Rotation.from_rotvec(turn).as_matrix()
        # The panel faces up: how far the pin comes from above.
        angles.append(np.degrees(np.arcsin(-(along @ off.T)[:, 2])))
    assert np.min(angles) >= 15.0
    assert np.min(angles) < 17.0


def test_a_pin_that_may_be_turned_too_far_is_refused_until_the_frame_is_known():
    cell = Cell.from_toml(example("rv-m2"))
    prediction, table = Prediction(cell), cell.sensor
    assert isinstance(table, TablePanel)
    expected = replace(
        prediction.expected(Step(0, "pose", 0, "", 0, np.array([0.0, 0.9, -1.9, 0.0, 0.0]))),
        pointing_in_world=np.array([np.cos(np.radians(15.3)), 0.0, -np.sin(np.radians(15.3))]),
        point_in_world=np.array([0.3, 0.2, 0.3]),
    )
    with pytest.raises(
        RefusedError, match=r"at 15\.3 deg. At least 15 deg are needed, and it may be turned by 0\.5"
    ):
        table.carriage_for(expected)
    assert prediction.world_from_base is not None
    prediction.register(prediction.world_from_base, 0.001)
    known = prediction.expected(Step(0, "pose", 0, "", 0, expected.readings))
    table.carriage_for(replace(expected, turned_rad=known.turned_rad))


def test_no_table_no_problem():
    tracker = Cell.from_toml(cell_text("tracker"))
    walk = Walk(tracker)
    walk.register()
    assert walk.problem_of_way(Step(0, "pose", 0, "", 1, np.zeros(tracker.arm.joint_count))) == ""
    poses = Poses(np.zeros((2, 6)), np.zeros(2, dtype=np.int64), ("", ""))
    kept, left = within_reach(motion_of(tracker), poses)
    np.testing.assert_array_equal(kept.readings, poses.readings)
    assert left == []
