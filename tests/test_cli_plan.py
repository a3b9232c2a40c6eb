"""`truearm plan`: poses that can be measured, determine the arm, and come in a good order."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from tests.cell_support import cell_text
from tests.stages import Stages
from tests.xyzc import xyzc
from truearm.cell import Cell
from truearm.cell.motion import Motion
from truearm.cell.ordering import motion_seconds, paper_order, short_order, there_and_back
from truearm.cell.plan import measurable_pool
from truearm.cell.poses_file import Poses
from truearm.cell.rehearsal import rehearse
from truearm.cli import main
from truearm.planning.accessibility import InBox, lowest
from truearm.robot import Robot
from truearm.simulation import VirtualArm


@pytest.mark.slow
def test_a_plan_for_a_cell_can_be_measured_there(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.toml").write_text(cell_text())
    words = ["plan", "rv-m2", "-n", "20", "--cell", "cell.toml", "--picture", "poses.png", "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["purposes"] == {"train": 20, "validate": 5, "repeat": 6}
    assert told["after"]["log_det"] > told["before"]["log_det"]
    assert told["order"] == "there-and-back"
    assert told["motion_s"]["short"] <= min(told["motion_s"]["paper"], told["motion_s"]["there-and-back"])
    expected = list(told["expected_mm"].values())
    assert expected == sorted(expected, reverse=True)
    assert (tmp_path / "poses.png").stat().st_size > 1000
    cell = Cell.load("cell.toml")
    poses = Poses.read_csv("poses.csv", cell.arm)
    assert set(poses.approach) == {1, -1}
    assert rehearse(cell, poses).refused == []
    table = pd.read_csv("poses.csv")
    assert_repeats(table, [f"q{j}" for j in range(1, 6)])


def test_the_number_of_poses_that_is_asked_for_is_among_those_whose_accuracy_is_told(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert main(["plan", "ur10", "-n", "30", "--json"]) == 0
    expected = json.loads(capsys.readouterr().out)["expected_mm"]
    assert list(expected) == ["20", "30", "40", "60", "100", "200"]
    assert expected["40"] < expected["30"] < expected["20"]


def test_poses_stay_above_a_floor_and_in_a_box(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arm = Robot.load("ur10")
    calibrated = VirtualArm(arm, seed=1)
    known = ta.calibrate(arm, calibrated.measure(calibrated.poses(60)), model="constant")
    known.save(Path("a.calib"))
    room = ["--floor-mm", "50", "--box-mm", "-900,-900,100,900,900,1200", "-o", "poses.csv", "--json"]
    for words in (["plan", "ur10", "-n", "20"], ["plan", "--next", "5", "--from", "a.calib"]):
        assert main([*words, *room]) == 0
        told = json.loads(capsys.readouterr().out)
        readings = Poses.read_csv("poses.csv", arm).readings
        points = arm.position(readings)
        if "--from" in words:
            points = places_of(arm, readings, known.model.setup.targets[0, 0])
        assert (np.abs(points[:, :2]) <= 0.9).all()
        assert ((points[:, 2] >= 0.1) & (points[:, 2] <= 1.2)).all()
        assert told["lowest_mm"] >= 50.0
        low = np.minimum(points[:, 2].min(), lowest(arm, readings, tool=arm.tool))
        assert told["lowest_mm"] == pytest.approx(1e3 * low)


def places_of(arm, readings, point):
    """Points (n, 3) of the nominal arm's flange in its base frame."""
    flanges = arm.flange_chain.pose(readings)
    return flanges[:, :3, 3] + flanges[:, :3, :3] @ point


def test_each_target_that_the_calibration_found_stays_in_the_room(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arm = Robot.load("ur10")
    points = np.array([[0.1, 0.0, 0.25], [-0.2, 0.1, 0.05], [0.0, 0.0, 3.0]])
    rng = np.random.default_rng(1)
    readings = rng.uniform(-2.0, 2.0, (60, 6))
    table = pd.DataFrame(readings, columns=[f"q{k}" for k in range(1, 7)])
    for number, point in zip(("", "2", "3"), points, strict=True):
        table[[f"{axis}{number}" for axis in "xyz"]] = places_of(arm, readings, point) + rng.normal(
            0.0, 3e-5, (60, 3)
        )
    table["group"] = np.where(np.arange(60) < 30, "one", "two")
    table.loc[30:, ["x3", "y3", "z3"]] = np.nan
    data = ta.Measurements.from_dataframe(table)
    ta.calibrate(arm, data, model="constant").save(Path("a.calib"))
    room = ["--floor-mm", "50", "--box-mm", "-900,-900,100,900,900,1200", "--json"]
    assert main(["plan", "--acceptance", "5", "--from", "a.calib", "-o", "poses.csv", *room]) == 0
    assert json.loads(capsys.readouterr().out)["lowest_mm"] >= 50.0
    poses = Poses.read_csv("poses.csv", arm).readings
    for point in points[:2]:
        at = places_of(arm, poses, point)
        assert (at >= [-0.901, -0.901, 0.099]).all()
        assert (at <= [0.901, 0.901, 1.201]).all()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--box-mm", "1,2,3"], '--box-mm: "1,2,3". Six numbers'),
        (["--box-mm", "0,0,0,1,1,-1"], "the lowest x, y, z and then the highest"),
        (["--floor-mm", "nan"], "--floor-mm: nan. It must be finite"),
        (["--floor-mm", "9000"], "0 of 20000 random poses can be measured"),
        (["--floor-mm", "9000"], "each rule alone allows: the floor 0, links clear of one another 1"),
    ],
)
def test_a_room_that_is_none_is_told(words, message, tmp_path, capsys):
    assert main(["plan", "ur10", "-n", "20", "-o", str(tmp_path / "poses.csv"), *words]) != 0
    assert message in " ".join(capsys.readouterr().err.split())


def test_rules_are_counted_where_joints_are_held():
    box = InBox((-1.2, -1.2, 0.1), (1.2, 1.2, 0.5))
    motion = Motion.of(ta.Robot.load("ur10"), None, [box], [np.eye(4)], 0.0)
    with pytest.raises(ta.WorkError, match="each rule alone allows: the box 0. "):
        measurable_pool(motion, 400, 0, {2: -np.pi / 2.0, 3: 0.0})


def test_poses_of_another_plan_are_written_over_only_where_their_file_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["plan", "rv-m2", "-n", "8"]) == 0
    first = Path("poses.csv").read_bytes()
    assert main(["plan", "rv-m2", "-n", "8", "--picture", "same.png"]) == 0
    capsys.readouterr()
    assert main(["plan", "rv-m2", "-n", "9", "--picture", "other.png"]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "poses.csv is there already, with other poses. To write over it name it: -o poses.csv" in told
    assert Path("poses.csv").read_bytes() == first
    assert not Path("other.png").exists()
    assert main(["plan", "rv-m2", "-n", "9", "-o", "poses.csv"]) == 0
    assert Path("poses.csv").read_bytes() != first


def assert_repeats(table, joints):
    """Each repeated pose comes at once from the other side, and at the end from its first side."""
    poses = table[joints].apply(tuple, axis=1)
    repeated = table["purpose"] == "repeat"
    for pose in poses[repeated].unique():
        first, again, last = np.flatnonzero(poses == pose)
        assert table["purpose"][first] == "train"
        assert again == first + 1
        assert table["approach"][again] == -table["approach"][first]
        assert table["approach"][last] == table["approach"][first]
        assert repeated[last:].all()


def test_both_orders_go_from_low_to_high_once_through_all():
    rng = np.random.default_rng(0)
    points, readings = rng.uniform(0.0, 0.4, (40, 3)), rng.uniform(-1.0, 1.0, (40, 5))
    for order in (paper_order(points), short_order(points, readings, 1.0)):
        assert sorted(order) == list(range(40))
        assert np.diff(points[order][:, 2]).min() > -0.08
    short = motion_seconds(readings, short_order(points, readings, 1.0), 1.0)
    assert short < 0.8 * motion_seconds(readings, paper_order(points), 1.0)


@pytest.mark.parametrize("count", [1, 2, 40, 41])
def test_there_and_back_once_through_all_height_tells_nothing_of_time(count):
    order = there_and_back(np.arange(count))
    assert sorted(order) == list(range(count))
    assert order[0] == 0
    if count > 2:
        assert abs(np.corrcoef(order, np.arange(count))[0, 1]) < 0.1
        assert np.abs(np.diff(order)).max() == 2


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--criterion", "best"], '"best" is not known'),
        (["--order", "any"], '"any" is not known'),
        (["-n", "0"], "0 poses"),
    ],
)
def test_wrong_options_are_told(words, message, capsys):
    assert main(["plan", "rv-m2", *words]) == 2
    assert message in capsys.readouterr().err


@pytest.fixture(scope="module")
def calib(tmp_path_factory):
    path = tmp_path_factory.mktemp("plan") / "arm.calib"
    arm = VirtualArm.paper(seed=2)
    ta.calibrate(arm.robot, arm.measure(arm.poses(40)), model="constant").save(path)
    return str(path)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("asked", "purpose", "said"),
    [
        ("--next", "train", "Expected standard deviation"),
        ("--acceptance", "acceptance", "noticed in 95 of 100 cases"),
    ],
)
def test_poses_are_proposed_from_a_calibration(asked, purpose, said, calib, here, capsys):
    count = 6
    assert main(["plan", asked, str(count), "--from", calib, "-o", "a.csv", "--picture", "a.png"]) == 0
    told = capsys.readouterr().out
    assert said in told
    assert max(len(line) for line in told.splitlines() if calib not in line) <= 80
    poses = Poses.read_csv("a.csv", ta.Robot.load("rv-m2"))
    assert poses.purpose == (purpose,) * count
    assert set(poses.approach) == {1, -1}
    assert (here / "a.png").stat().st_size > 1000
    assert main(["plan", "rv-m2", asked, str(count), "--from", calib, "-o", "b.csv", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["count"] == count
    assert (here / "a.csv").read_bytes() == (here / "b.csv").read_bytes()
    if asked == "--next":
        expected = [found["expected_before_mm"], *found["expected_after_mm"]]
        assert expected == sorted(expected, reverse=True)
    else:
        assert set(found["noticed"]) >= {"joint2", "joint3"}


def test_where_no_number_of_poses_tells_of_a_change_it_is_said_so(here, capsys):
    """What moves of axes X, Y, Z and C is another frame or target."""
    arm = VirtualArm(xyzc(here), seed=1)
    ta.calibrate(arm.robot, arm.measure(arm.poses(40)), model="constant", refit=False).save("arm.calib")
    assert main(["plan", "--acceptance", "12", "--from", "arm.calib", "-o", "a.csv"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "So few poses" not in told
    assert "No number of poses tells here whether a joint moved against its reading" in told
    assert "--keep-frame and --keep-tool tells it" in told


def test_progress_is_told_while_poses_are_proposed(calib, here, monkeypatch):
    stages = Stages()
    monkeypatch.setattr("truearm.cli.plan.told_stages", lambda: stages)
    assert main(["plan", "--next", "2", "--from", calib, "-o", "a.csv"]) == 0
    assert stages.names == ["choosing poses"]


def test_a_picture_that_fails_leaves_the_one_before(calib, here, monkeypatch):
    def torn(_figure, place, **_how):
        (place.write if hasattr(place, "write") else Path(place).write_bytes)(b"torn")
        raise MemoryError

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", torn)
    picture = here / "a.png"
    picture.write_bytes(b"before")
    asked = ["plan", "--next", "2", "--from", calib, "-o", "a.csv", "--picture", str(picture)]
    assert main(asked) == 1
    assert picture.read_bytes() == b"before"


def test_too_few_poses_to_tell_anything_are_named(calib, here, capsys):
    assert main(["plan", "--acceptance", "1", "--from", calib, "-o", "a.csv"]) == 0
    assert "So few poses tell of no change" in capsys.readouterr().out


def test_poses_of_a_cell_are_proposed_that_it_can_measure(calib, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.toml").write_text(cell_text())
    assert main(["plan", "--acceptance", "8", "--from", calib, "--cell", "cell.toml", "-o", "a.csv"]) == 0
    assert "8 poses" in capsys.readouterr().out
    cell = Cell.load("cell.toml")
    assert rehearse(cell, Poses.read_csv("a.csv", cell.arm)).refused == []
    assert main(["plan", "ur10", "--cell", "cell.toml", "-o", "b.csv"]) == 2
    assert "the cell is of" in capsys.readouterr().err
    before = Path("cell.toml").read_bytes()
    assert main(["plan", "--next", "8", "--from", calib, "--cell", "cell.toml", "-o", "cell.toml"]) == 2
    assert "never written over" in capsys.readouterr().err
    assert Path("cell.toml").read_bytes() == before


@pytest.mark.parametrize("option", ["-o", "--picture"])
def test_the_robot_s_file_is_never_written_over(option, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("own.toml").write_text(ta.Robot.load("ur10").to_toml())
    before = Path("own.toml").read_bytes()
    other = ["-o", "poses.csv"] if option != "-o" else []
    assert main(["plan", "own.toml", "-n", "5", option, "own.toml", *other]) == 2
    assert "never written over" in capsys.readouterr().err
    assert Path("own.toml").read_bytes() == before
    assert main(["plan", "own.toml", "-n", "5", "-o", "same.svg", "--picture", "./same.svg"]) == 2
    assert "is the output already" in capsys.readouterr().err
    assert not Path("same.svg").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["rv-m2", "--next", "5"], "--from CALIB"),
        (["--from", "CALIB"], "--next N --from CALIB"),
        (["--next", "5", "--acceptance", "5", "--from", "CALIB"], "--next N --from CALIB"),
        (["--next", "0", "--from", "CALIB"], "0 poses"),
        (["--acceptance", "3000", "--from", "CALIB"], "At most 200 are proposed"),
        (["ur10", "--next", "5", "--from", "CALIB"], "the calibration is of RV-M2"),
        (["--next", "5", "--from", "CALIB", "--group", "x"], 'no set-up "x"'),
        ([], "no robot is named"),
        (["rv-m2", "--picture", "poses.bmp"], 'ends in ".png", ".svg" or ".pdf"'),
        (["rv-m2", "--seed", "-1"], "greater than or equal to 0"),
    ],
)
def test_wrong_proposals_are_told(words, message, calib, capsys):
    assert main(["plan", *[calib if word == "CALIB" else word for word in words]]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (["ur10", "-n", "7"], 1, "7 poses have 21 measured values. 25 unknowns .* Choose 9 poses or more"),
        (["ur10", "-n", "20", "--sigma-mm", "0"], 2, "sigma_mm: 0. It must be positive"),
        (["ur10", "-n", "20", "--sigma-mm", "1e-300"], 2, "sigma_mm: 1e-300. At least 1e-06 and at most"),
        (["ur10", "-n", "20", "--sigma-mm", "nan"], 2, "sigma_mm: nan. It must be positive"),
        (["-n", "9", "--next", "5", "--from", "arm.calib"], 2, "--next or --acceptance says how many"),
        (["--next", "5", "--acceptance", "5", "--from", "arm.calib"], 2, "one at a time"),
    ],
)
def test_what_cannot_be_planned_is_said(words, status, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["plan", *words, "-o", "p.csv"]) == status
    assert re.search(message, " ".join(capsys.readouterr().err.split()))
    assert not (tmp_path / "p.csv").exists()
