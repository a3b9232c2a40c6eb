"""`truearm frame` as people run it."""

import json
import subprocess
import sys
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from truearm.cli import main
from truearm.errors import UsageError, WorkError
from truearm.exporting import constant_robot
from truearm.files import write_whole
from truearm.framing import write_frame
from truearm.framing.identified_frame import IdentifiedFrame
from truearm.inverse import Inverse
from truearm.locks import held
from truearm.programs.frames import Frames
from truearm.simulation import VirtualArm

PROGRAM = str(Path(sys.executable).parent / "truearm")
TIP = np.array([0.02, -0.05, 0.18])
PLACES = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0.3, 0.2, 0.05]], dtype=float)
ORIGIN = np.array([0.5, 0.2, 0.1])


def touches_of(robot, points, seed):
    turns = Rotation.from_rotvec(np.random.default_rng(seed).uniform(-0.5, 0.5, (len(points), 3)))
    poses = np.tile(np.eye(4), (len(points), 1, 1))
    poses[:, :3, :3] = (turns * Rotation.from_euler("x", 180.0, degrees=True)).as_matrix()
    poses[:, :3, 3] = points - poses[:, :3, :3] @ TIP
    q = Inverse(robot).near(poses, np.radians([0.0, -90.0, 90.0, -90.0, -90.0, 0.0]))
    return pd.DataFrame({f"q{j + 1}_deg": np.degrees(q[:, j]) for j in range(6)})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("frame")
    arm = VirtualArm(ta.Robot.load("ur10"), seed=2)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), model="constant")
    calibration.save(place / "arm.calib")
    robot = constant_robot(calibration)
    touches_of(robot, np.tile([0.6, 0.1, 0.2], (6, 1)), 0).round(3).to_csv(place / "touches.csv", index=False)
    mm = dict(zip(["x_mm", "y_mm", "z_mm"], 1e3 * PLACES.T, strict=True))
    touches_of(robot, PLACES + ORIGIN, 1).assign(**mm).to_csv(place / "points.csv", index=False)
    return place


@pytest.fixture(autouse=True)
def inside(folder, monkeypatch, tmp_path):
    for name in ("arm.calib", "touches.csv", "points.csv"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    monkeypatch.chdir(tmp_path)


def test_a_tool_and_then_an_object_as_people_teach_them():
    words = ["frame", "arm.calib", "touches.csv", "--tool", "tGripper", "--orientation", "0,0,0"]
    done = subprocess.run([PROGRAM, *words, "-o", "cell.toml"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert 'Tool "tGripper" of UR10, from 6 touches of one point.' in done.stdout
    assert "mm RMS" in done.stdout
    told = [line for line in done.stdout.splitlines() if not line.startswith("  truearm ")]
    assert max(map(len, told)) <= 80
    words = ["frame", "arm.calib", "points.csv", "--object", "wTable", "--with-tool", "tgripper"]
    done = subprocess.run([PROGRAM, *words, "-o", "cell.toml"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    frames = Frames.load(Path("cell.toml"))
    assert np.abs(frames.tool("tGripper").true[:3, 3] - TIP).max() < 1e-4
    assert np.abs(frames.work_object("wTable").true[:3, 3] - ORIGIN).max() < 1e-4
    entries = tomllib.loads(Path("cell.toml").read_text())
    known = entries["tool"]["tGripper"]["identified"]
    assert np.shape(known["covariance"]) == (6, 6)
    assert known["calibration"] == ta.Calibration.load("arm.calib").data_hash
    # The touches were rounded to a thousandth of a degree; the tool's covariance is in the object's.
    assert min(entries["object"]["wTable"]["identified"]["std_mm"]) > 0.5 * min(known["std_mm"])


def test_comments_and_layout_of_the_file_stay():
    head = "# our cell\nformat = 1\n\n[tool.tGripper]  # the old one\nxyz = [20, -50, 179]\n\n"
    held = f"{head}# a wall\n[object.wWall]\nxyz = [1, 2, 3]  # by hand\n"
    Path("cell.toml").write_text(held)
    words = ["touches.csv", "--tool", "tGripper", "--orientation", "0,0,0", "-o", "cell.toml"]
    assert main(["frame", "arm.calib", *words]) == 0
    text = Path("cell.toml").read_text()
    for kept in ("# our cell", "[tool.tGripper]  # the old one", "# a wall", "xyz = [1, 2, 3]  # by hand"):
        assert kept in text
    frames = Frames.load(Path("cell.toml"))
    assert np.abs(frames.tool("tGripper").true[:3, 3] - TIP).max() < 1e-4
    assert frames.tool("tGripper").controller[:3, 3] == pytest.approx([0.02, -0.05, 0.179])


@pytest.mark.parametrize(
    "held",
    [
        "[tool]\ntGripper.xyz = [20, -50, 179]\ntGripper.quaternion_wxyz = [1, 0, 0, 0]\n",
        "tool.tGripper.xyz = [20, -50, 179]\n",
        "[tool.tGripper]\nxyz = [20, -50, 179]\n[object.t]\nxyz = [1, 2, 3]\n"
        "[tool.tGripper.controller]\nxyz = [20, -50, 178]\n",
    ],
)
def test_tables_in_pieces_are_put_together(held):
    Path("cell.toml").write_text(held)
    words = ["touches.csv", "--tool", "tGripper", "--orientation", "0,0,0", "-o", "cell.toml"]
    assert main(["frame", "arm.calib", *words]) == 0
    frames = Frames.load(Path("cell.toml"))
    assert np.abs(frames.tool("tGripper").true[:3, 3] - TIP).max() < 1e-4
    assert 0.1779 < frames.tool("tGripper").controller[2, 3] < 0.1791


def test_what_the_file_held_becomes_what_the_controller_has(capsys):
    former = '[tool."tGripper"]\nxyz = [20, -50, 179]\neuler_zyx_deg = [10, 0, 0]\npayload_kg = 2.5\n'
    other = "[object.wWall]\nxyz = [1, 2, 3]\n"
    Path("cell.toml").write_text(former + other)
    assert main(["frame", "arm.calib", "touches.csv", "--tool", "TGRIPPER", "-o", "cell.toml"]) == 0
    assert "Take it out when the new numbers are in the controller" in capsys.readouterr().err
    frames = Frames.load(Path("cell.toml"))
    tool = frames.tool("tGripper")
    assert np.abs(tool.true[:3, 3] - TIP).max() < 1e-4
    assert np.allclose(tool.controller[:3, 3], [0.02, -0.05, 0.179])
    assert np.allclose(tool.true[:3, :3], tool.controller[:3, :3], atol=1e-9)
    assert frames.payloads_kg == {"tgripper": 2.5}
    assert np.allclose(frames.work_object("wWall").true[:3, 3], [1e-3, 2e-3, 3e-3])
    assert main(["frame", "arm.calib", "touches.csv", "--tool", "tGripper", "-o", "cell.toml"]) == 0
    again = Frames.load(Path("cell.toml")).tool("tGripper")
    assert np.allclose(again.controller[:3, 3], [0.02, -0.05, 0.179]), "the controller still has the first"


def test_what_was_found_before_is_not_taken_for_what_the_controller_has(capsys):
    words = ["frame", "arm.calib", "touches.csv", "--tool", "tGripper", "-o", "cell.toml"]
    assert main([*words, "--orientation", "0,0,0"]) == 0
    first = Frames.load(Path("cell.toml")).tool("tGripper").true
    capsys.readouterr()
    assert main([*words, "--orientation", "10,0,0"]) == 0
    told = " ".join(capsys.readouterr().err.split())
    assert 'held tool "tGripper" as it was found before, xyz = [' in told
    assert "the new numbers replace that" in told
    assert "stands under" not in told
    entry = tomllib.loads(Path("cell.toml").read_text())["tool"]["tGripper"]
    assert "controller" not in entry
    tool = Frames.load(Path("cell.toml")).tool("tGripper")
    assert np.array_equal(tool.controller, tool.true)
    assert not np.allclose(tool.true, first)
    held = "[tool.tGripper]\nxyz = [20, -50, 179]\n[tool.tGripper.controller]\nxyz = [20, -50, 178]\n"
    Path("cell.toml").write_text(held)
    assert main([*words, "--orientation", "0,0,0"]) == 0
    assert "stands under" not in capsys.readouterr().err
    assert Frames.load(Path("cell.toml")).tool("tGripper").controller[2, 3] == pytest.approx(0.178)


def test_the_proposed_command_declares_a_controller_where_one_is_needed(capsys):
    words = ["--tool", "tGripper", "--orientation", "0,0,0", "-o", "my cell.toml"]
    assert main(["frame", "arm.calib", "touches.csv", *words]) == 0
    proposed = "truearm compensate arm.calib PROGRAM --controller MODEL --frames 'my cell.toml' --dry-run"
    assert proposed in capsys.readouterr().out


@pytest.mark.parametrize("world", ["$WORLD", "wobj0"])
def test_an_object_is_written_in_the_world_that_the_file_has(world, capsys):
    """As the controller holds it, so that programs find it where it was touched."""
    turned = "xyz = [10, 20, -100]\neuler_zyx_deg = [30, 0, 5]\n"
    Path("cell.toml").write_text(f'[object."{world}"]\n{turned}')
    words = ["points.csv", "--object", "2", "--with-tool=20,-50,180"]
    assert main(["frame", "arm.calib", *words, "-o", "cell.toml"]) == 0
    told = " ".join(capsys.readouterr().err.split())
    assert f'the controller\'s world, object "{world}": object "2" is written in it' in told
    assert main(["frame", "arm.calib", *words, "-o", "plain.toml"]) == 0
    held, plain = (Frames.load(name).objects["2"] for name in ("cell.toml", "plain.toml"))
    stated = Frames.load("cell.toml").world()
    assert stated is not None
    placed = stated.then(held)
    assert np.abs(placed.true - plain.true).max() < 1e-12
    assert np.allclose(np.array(placed.covariance), np.array(plain.covariance), atol=1e-18)
    assert np.linalg.norm(plain.true[:3, 3] - ORIGIN) < 1e-4
    axes = tomllib.loads(Path("cell.toml").read_text())["object"]["2"]["identified"]["covariance_of"]
    assert axes.endswith(f"along the axes of the world, {world}")


def test_the_world_itself_is_written_in_the_base(capsys):
    Path("cell.toml").write_text("[object.wobj0]\nxyz = [0, 0, -100]\n")
    words = ["points.csv", "--object", "WOBJ0", "--with-tool=20,-50,180"]
    assert main(["frame", "arm.calib", *words, "-o", "cell.toml"]) == 0
    assert "is written in it" not in capsys.readouterr().err
    assert np.linalg.norm(Frames.load("cell.toml").objects["wobj0"].true[:3, 3] - ORIGIN) < 1e-4


def test_worlds_of_two_controllers_leave_open_which_an_object_is_in(capsys):
    held = '[object.wobj0]\nxyz = [0, 0, -100]\n[object."$WORLD"]\nxyz = [0, 0, 0]\n'
    Path("cell.toml").write_text(held)
    words = ["points.csv", "--object", "2", "--with-tool=20,-50,180", "-o", "cell.toml"]
    assert main(["frame", "arm.calib", *words]) == 1
    assert "cell.toml: it has two worlds, $WORLD and wobj0" in capsys.readouterr().err
    assert Path("cell.toml").read_text() == held


def test_json_is_all_that_is_printed(capsys):
    words = ["points.csv", "--object", "wTable", "--with-tool=20,-50,180", "-o", "cell.toml", "--json"]
    assert main(["frame", "arm.calib", *words]) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert printed.err == ""
    assert np.allclose(found["xyz_mm"], 1e3 * ORIGIN, atol=1e-6)
    assert len(found["residuals_mm"]) == 4
    assert found["rows"] == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (["touches.csv"], 2, "give --tool NAME or --object NAME"),
        (["touches.csv", "--tool", "a", "--object", "b"], 2, "One frame is found at a time"),
        (["touches.csv", "--tool", "a"], 2, "Give --orientation Z,Y,X"),
        (["touches.csv", "--tool", "a", "--orientation", "1,2"], 1, "It must be Z,Y,X in deg"),
        (["touches.csv", "--tool", "a", "--with-tool", "b"], 2, "It belongs to --object"),
        (["points.csv", "--object", "a", "--orientation", "0,0,0"], 2, "It belongs to --tool"),
        (["points.csv", "--object", "a", "--with-tool", "b"], 1, "a tool of cell.toml, or X,Y,Z in mm"),
        (["touches.csv", "--object", "a"], 1, "no place x, y, z of every touched point"),
        (["missing.csv", "--tool", "a", "--orientation", "0,0,0"], 1, "missing.csv: there is no such file"),
    ],
)
def test_what_cannot_be_done_is_said(words, status, message, capsys):
    assert main(["frame", "arm.calib", *words, "-o", "cell.toml"]) == status
    printed = capsys.readouterr()
    assert printed.out == ""
    assert message in printed.err
    assert not Path("cell.toml").exists()


def test_a_frames_file_that_is_none_stays_as_it_is(capsys):
    Path("cell.toml").write_text("[tool.a]\nxyz = [1, 2]\n")
    words = ["touches.csv", "--tool", "a", "--orientation", "0,0,0", "-o", "cell.toml"]
    assert main(["frame", "arm.calib", *words]) == 1
    assert '"tool.a.xyz' in capsys.readouterr().err
    assert Path("cell.toml").read_text() == "[tool.a]\nxyz = [1, 2]\n"


def test_a_frame_without_a_name_is_not_written(tmp_path):
    found = cast(IdentifiedFrame, SimpleNamespace(kind="object"))
    with pytest.raises(UsageError, match="Programs call it by a name"):
        write_frame(tmp_path / "frames.toml", " ", found, "")
    assert not (tmp_path / "frames.toml").exists()


def test_frames_that_are_found_at_once_are_all_in_the_file(tmp_path, monkeypatch):
    def written_late(path, text):
        time.sleep(0.05)
        write_whole(path, text)

    monkeypatch.setattr("truearm.framing.frames_toml.write_whole", written_late)
    rows, nothing = np.arange(3), np.zeros((6, 6))
    found = IdentifiedFrame("tool", np.eye(4), nothing, np.zeros((3, 3)), rows, 1e-5, 3, "a test")
    names = [f"T{k}" for k in range(6)]
    link = tmp_path / "link.toml"
    link.symlink_to("frames.toml")
    with ThreadPoolExecutor() as pool:
        list(pool.map(write_frame, [tmp_path / "frames.toml", link] * 3, names, [found] * 6, [""] * 6))
    assert sorted(tomllib.loads((tmp_path / "frames.toml").read_text())["tool"]) == names


def test_a_file_into_which_another_process_writes_on_and_on_stays_as_it_is(tmp_path, monkeypatch):
    monkeypatch.setattr("truearm.framing.frames_toml.WAIT_S", 0.0)
    path = tmp_path / "frames.toml"
    lock = held(str(path.resolve()), "", where="")
    found = cast(IdentifiedFrame, SimpleNamespace(kind="tool"))
    with pytest.raises(WorkError, match=r"frames\.toml: another process writes into this file"):
        write_frame(path, "T0", found, "")
    lock.release()
    assert not path.exists()
