"""Ways between planned poses: what holds at poses holds on the way to them, as far as it is said to."""

import json

import numpy as np
import pandas as pd
import pytest

from tests.cell_support import cell_text
from truearm.cell import Cell
from truearm.cell.cell_file import ProcessSection
from truearm.cell.motion import Motion
from truearm.cell.plan import PlanOptions, measurable_pool, plan_poses
from truearm.cell.poses_file import Poses
from truearm.cell.reaching import within_reach
from truearm.cell.rehearsal import rehearse
from truearm.cli import main
from truearm.description.library import library_names
from truearm.errors import UsageError
from truearm.planning import AboveFloor, ClearOfItself, InBox, accessible
from truearm.planning.accessibility import Places, lowest
from truearm.planning.joint_ways import JointWays, stepped
from truearm.robot import Robot

UR10 = Robot.load("ur10")
FLOOR_M = 0.05
ROOM = (AboveFloor(FLOOR_M), InBox([-0.9, -0.9, 0.1], [0.9, 0.9, 1.2]))


def on_the_way(arm, poses, count=200):
    """Readings on the ways through poses and the places beside them."""
    away = np.where(np.array(arm.joints) == "revolute", np.radians(3.0), 3e-3)
    beside = poses.readings - poses.approach[:, None] * away
    stops = np.stack([beside, poses.readings], axis=1).reshape(-1, arm.joint_count)
    shares = np.linspace(0.0, 1.0, count)[:, None, None]
    return (stops[:-1] + shares * np.diff(stops, axis=0)).reshape(-1, arm.joint_count)


def test_the_floor_holds_on_the_ways(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    room = ["--floor-mm", "50", "--box-mm", "-900,-900,100,900,900,1200"]
    assert main(["plan", "ur10", "-n", "20", *room, "-o", "poses.csv", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    low = lowest(UR10, on_the_way(UR10, Poses.read_csv("poses.csv", UR10)), tool=UR10.tool)
    assert low == pytest.approx(1e-3 * told["lowest_way_mm"], abs=5e-4)
    assert 1e-3 * told["lowest_mm"] >= low >= FLOOR_M - 5e-4
    assert told["unreached"] == []


def test_how_low_the_arm_gets_on_the_ways_is_told_without_a_floor(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["plan", "rv-m2", "-n", "20", "-o", "poses.csv"]) == 0
    arm, said = Robot.load("rv-m2"), " ".join(capsys.readouterr().out.split())
    low = 1e3 * lowest(arm, on_the_way(arm, Poses.read_csv("poses.csv", arm)), tool=arm.tool)
    told = float(said.partition("mm at the poses, and at ")[2].partition(" mm")[0])
    assert told == pytest.approx(low, abs=1.0)


@pytest.mark.parametrize("name", ["ur10", "ur3e", "fanuc-lr-mate-200id"])
def test_a_plan_is_clear_of_itself(name):
    arm = Robot.load(name)
    plan, loose = (plan_poses(arm, PlanOptions(20, link_radius_mm=size)) for size in (None, 0.0))
    assert plan.passage.unreached == []
    rule = ClearOfItself(0.04)
    for readings in (plan.poses.readings, stepped(arm, on_the_way(arm, plan.poses, 2))):
        assert accessible(arm, readings, [rule]).all()
    assert not accessible(arm, loose.poses.readings, [rule]).all()
    # An index of 0.9 is ten poses more in a hundred.
    assert plan.choice.after["o1"] > 0.9 * loose.choice.after["o1"]


@pytest.mark.parametrize("name", library_names())
def test_most_poses_of_each_arm_are_clear_of_itself(name):
    arm = Robot.load(name)
    low, high = np.clip(arm.limits.T, -np.pi, np.pi)
    drawn = np.random.default_rng(0).uniform(low, high, (400, arm.joint_count))
    assert accessible(arm, drawn, [ClearOfItself(0.04)]).mean() > 0.7


def test_links_are_as_far_apart_as_their_nearest_points():
    drawn = np.random.default_rng(1).uniform(-np.pi, np.pi, (60, 6))
    corners, share = Places(UR10, drawn, UR10.tool).corners, np.linspace(0.0, 1.0, 60)[:, None]
    pieces = [
        corners[:, k, None] + share * np.diff(corners[:, k : k + 2], axis=1)
        for k in range(corners.shape[1] - 1)
    ]
    lengths = np.linalg.norm(np.diff(corners, axis=1), axis=2)
    radius, least = 0.06, np.full(len(drawn), np.inf)
    for k in range(len(pieces)):
        for m in range(k + 2, len(pieces)):
            gaps = np.linalg.norm(pieces[k][:, :, None] - pieces[m][:, None], axis=3).min(axis=(1, 2))
            apart = lengths[:, k + 1 : m].sum(axis=1) > 4.0 * radius
            least = np.where(apart & (lengths[:, [k, m]].min(axis=1) > 1e-6), np.minimum(least, gaps), least)
    sure = np.abs(least - 2.0 * radius) > 2e-3
    clear = accessible(UR10, drawn, [ClearOfItself(radius)])
    np.testing.assert_array_equal(clear[sure], (least >= 2.0 * radius)[sure])
    assert 5 < np.count_nonzero(~clear) < 55


class OverTheWall:
    """A rule that parts readings into two halves, between which there is a way high up alone."""

    holds_on_ways = True

    def __call__(self, places):
        return (np.abs(places.readings[:, 0]) > 0.3) | (places.readings[:, 1] > 1.0)


def test_a_pose_without_a_way_goes_where_there_is_one():
    left, over, right = ([x, y, 0.0, 0.0, 0.0, 0.0] for x, y in ((-1.0, 0.0), (0.0, 3.0), (1.0, 0.0)))
    readings = np.array([left, right, left, over, over])
    poses = Poses(readings, np.array([1, 1, -1, 1, -1]), ("train", "train", "repeat", "train", "repeat"))
    found, none = within_reach(Motion(UR10, None, [OverTheWall()], [UR10.tool]), poses)
    assert none == []
    assert found.readings[:, 0].tolist() == [-1.0, -1.0, 0.0, 0.0, 1.0]
    assert found.purpose == ("train", "repeat", "train", "repeat", "train")
    alone, none = within_reach(
        Motion(UR10, None, [OverTheWall()], [UR10.tool]), Poses(readings[:2], np.array([1, 1]), ("", ""))
    )
    assert none == [1]
    np.testing.assert_array_equal(alone.readings, readings[:2])


def test_poses_without_a_way_are_named(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("truearm.cell.plan.within_reach", lambda _, poses: (poses, [len(poses) - 1]))
    assert main(["plan", "rv-m2", "-n", "12"]) == 0
    assert "pose 23: on every straight way there" in " ".join(capsys.readouterr().err.split())


def test_candidates_leave_room_for_coming_from_one_side(tmp_path):
    for arm in (Robot.load("rv-m2"), Robot.load("adept-cobra-600")):
        motion = Motion.of(arm, None, (), [arm.tool], None)
        pool = measurable_pool(motion, 300, 0)
        away = ProcessSection().run_up(arm).away
        for side in (1, -1):
            np.testing.assert_allclose(
                side * (pool - motion.run_up.beside(pool, side)), np.tile(away, (300, 1))
            )
    low, high = UR10.limits.T
    narrow = low + 0.01
    near = ProcessSection().run_up(UR10)
    assert all((a <= b).all() for a, b in [near.room(low, narrow), near.room(low, high)])


def cell_with_floor(**changes):
    process = {"registration_poses": 4, "check_every": 0}
    return cell_text("tracker", process=process, **changes)


def test_ways_below_the_floor_of_a_cell_are_rehearsed(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = cell_with_floor(clearance={"floor_mm": 50})
    cell = Cell.from_toml(text)
    (tmp_path / "cell.toml").write_text(text)
    assert main(["plan", cell.file.arm, "-n", "12", "--cell", "cell.toml", "-o", "poses.csv"]) == 0
    poses = Poses.read_csv("poses.csv", cell.arm)
    measured = [each for each in rehearse(cell, poses).steps if each.step.kind == "pose"]
    assert all((each.lowest_m or 0.0) >= FLOOR_M - 5e-4 for each in measured[1:])
    down = cell.arm.limits.mean(axis=1) + np.radians([0.0, 60.0, 0.0, 0.0, 0.0, 0.0])
    table = pd.DataFrame(np.vstack([poses.readings[:5], down]), columns=[f"q{k}" for k in range(1, 7)])
    table.to_csv("low.csv", index=False)
    capsys.readouterr()
    assert main(["measure", "cell.toml", "low.csv", "--dry-run"]) == 0
    said = capsys.readouterr()
    assert "below the floor on the way, z = " in said.out
    assert "goes below the floor of the cell file" in " ".join(said.err.split())


def test_joints_near_their_limits_are_named(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cell = Cell.from_toml(cell_with_floor())
    (tmp_path / "cell.toml").write_text(cell_with_floor())
    low, high = cell.arm.limits.T
    readings = np.random.default_rng(0).uniform(-0.5, 0.5, (6, 6))
    readings[1, 0], readings[3, 2], readings[4, 2] = high[0] - np.radians(1.0), high[2], low[2]
    table = pd.DataFrame(readings, columns=[f"q{k}" for k in range(1, 7)])
    table.assign(approach=[1, -1, 1, -1, -1, 0]).to_csv("poses.csv", index=False)
    poses = Poses.read_csv("poses.csv", cell.arm)
    assert poses.approach.tolist() == [1, -1, 1, 0, -1, 0]
    assert poses.at_limits == (3,)
    assert main(["measure", "cell.toml", "poses.csv", "--dry-run"]) == 0
    said = capsys.readouterr()
    assert "nearer, since a limit is in the way, joint 1 at pose 2" in " ".join(said.out.split())
    assert "pose 4: a joint is at its limit on the side from which it is to come" in " ".join(
        said.err.split()
    )


def test_a_radius_below_zero_is_refused():
    with pytest.raises(UsageError, match="link_radius_mm"):
        PlanOptions(link_radius_mm=-1.0)


def test_a_way_is_looked_at_in_steps_of_a_degree():
    stops = np.zeros((2, 6))
    stops[1, 2] = 1.0
    places = stepped(UR10, stops)
    assert len(places) == 59
    np.testing.assert_array_equal(places[[0, -1]], stops)
    ways = JointWays(UR10, [AboveFloor(0.0)], [UR10.tool])
    clear = [ways.clear(np.array([begin, stops[0]])) for begin in stops]
    assert ways.seem_clear(stops, stops[0]).tolist() == clear
