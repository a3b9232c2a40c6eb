"""Ways past the table: rehearsed as they will be gone, and poses put into an order in which there is one."""

import json
from itertools import pairwise

import numpy as np
import pytest

from tests.cell_support import cell_text, poses_of
from truearm.cell import Cell
from truearm.cell.clearance import Clearance
from truearm.cell.examples import example
from truearm.cell.plan import PlanOptions, plan_poses
from truearm.cell.poses_file import Poses
from truearm.cell.prediction import Prediction
from truearm.cell.reaching import within_reach
from truearm.cell.rehearsal import Walk, rehearse
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


def refused(cell, poses):
    return [each for each in rehearse(cell, poses).refused if each.step.kind == "pose"]


def test_ways_between_poses_are_rehearsed(cell, at_random):
    found = refused(cell, at_random)
    assert found
    assert all(each.problem == f"{BLOCKED}, from the step before" for each in found)


def test_poses_are_put_off_until_there_is_a_way(cell, at_random):
    poses, left = within_reach(cell, at_random)
    assert sorted(map(tuple, poses.readings)) == sorted(map(tuple, at_random.readings))
    assert len(refused(cell, poses)) == len(left) < len(refused(cell, at_random))


def test_what_is_measured_again_comes_behind_its_first_time(cell, at_random):
    twice = Poses(np.repeat(at_random.readings, 2, axis=0), np.tile([1, -1], 30), ("train", "repeat") * 30)
    poses, left = within_reach(cell, twice)
    seen: set[tuple[float, ...]] = set()
    for readings, purpose in zip(poses.readings[: 60 - len(left)], poses.purpose, strict=False):
        assert (purpose == "repeat") == (tuple(readings) in seen)
        seen.add(tuple(readings))


def test_a_plan_has_a_way_to_each_pose(cell, tmp_path, capsys, monkeypatch):
    plan = plan_poses(cell.arm, PlanOptions(count=20), cell=cell)
    assert plan.unreached == []
    assert refused(cell, plan.poses) == []
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.toml").write_text(example("ur"))
    assert main(["plan", "ur5e", "-n", "20", "--cell", "cell.toml", "-o", "poses.csv", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["unreached"] == []
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


def test_no_table_no_problem():
    tracker = Cell.from_toml(cell_text("tracker"))
    walk = Walk(tracker)
    walk.register()
    assert walk.problem_of_way(Step(0, "pose", 0, "", 1, np.zeros(tracker.arm.joint_count))) == ""
    poses = Poses(np.zeros((2, 6)), np.zeros(2, dtype=np.int64), ("", ""))
    assert within_reach(tracker, poses) == (poses, [])
