"""`truearm evaluate` as people run it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm.cli import main
from truearm.simulation import VirtualArm

PROGRAM = str(Path(sys.executable).parent / "truearm")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("evaluate")
    arm = VirtualArm.paper(seed=2)
    ta.calibrate(arm.robot, arm.measure(arm.poses(80)), refit=False).save(place / "arm.calib")
    arm.measure_table(arm.poses(60, seed=1), seed=1).to_csv(place / "other.csv", index=False)
    return place


@pytest.fixture(autouse=True)
def inside(folder, monkeypatch):
    monkeypatch.chdir(folder)


def test_an_evaluation_as_people_run_it():
    command = [PROGRAM, "evaluate", "arm.calib", "other.csv"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "20 rows found frame and tool, 40 rows judged" in done.stdout
    for word in ("nominal", "constant", "variable", "mean", "max"):
        assert word in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80


def test_json_is_all_that_is_printed(capsys):
    assert main(["evaluate", "arm.calib", "other.csv", "--frame-rows", "10", "--seed", "3", "--json"]) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert printed.err == ""
    assert (found["n_frame"], found["n_judged"]) == (10, 50)
    assert list(found["errors"]) == ["nominal", "constant", "variable"]
    assert list(found["errors"]["variable"]) == ["mean_mm", "rms_mm", "p95_mm", "p99_mm", "max_mm"]


def test_a_calibration_that_does_not_help_is_not_suggested_for_programs(folder, capsys):
    other = VirtualArm.paper(seed=7)
    table = other.measure_table(other.poses(40, seed=1), seed=1)
    spoilt = table.copy()
    spoilt[["x", "y", "z"]] = table[["x", "y", "z"]].to_numpy()[::-1]
    spoilt.to_csv(folder / "spoilt.csv", index=False)
    assert main(["evaluate", "arm.calib", "spoilt.csv"]) == 0
    printed = capsys.readouterr()
    assert "The calibration does not help" in printed.err
    assert "truearm compensate" not in printed.out + printed.err
    assert main(["evaluate", "arm.calib", "other.csv"]) == 0
    printed = capsys.readouterr()
    assert "does not help" not in printed.err
    assert "truearm compensate" in printed.out + printed.err


def test_scripts_are_told_by_kinds_what_is_wrong(folder, capsys):
    table = pd.read_csv(folder / "other.csv")
    table["q2"] += 0.01
    table.to_csv(folder / "moved.csv", index=False)
    assert main(["evaluate", "arm.calib", "moved.csv", "--json"]) == 0
    printed = capsys.readouterr()
    notices = json.loads(printed.out)["notices"]
    assert "not_as_calibrated" in {notice["kind"] for notice in notices}
    said = " ".join(printed.err.split())
    assert all(" ".join(notice["message"].split()) in said for notice in notices)


def test_kept_frames_judge_all_rows(capsys):
    assert main(["evaluate", "arm.calib", "other.csv", "--keep-frames"]) == 0
    assert "frame and tool kept, 60 rows judged" in capsys.readouterr().out


def test_a_kept_tool(capsys):
    options = ["--keep-tool", "--frame-rows", "4", "--json"]
    assert main(["evaluate", "arm.calib", "other.csv", *options]) == 0
    assert json.loads(capsys.readouterr().out)["errors"]["variable"]["mean_mm"] < 0.3


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "empty file"), (b"q1,x\n0,0\n", "no calibration file"), (None, "no such file")],
)
def test_a_calibration_that_is_none(content, words, tmp_path, capsys):
    if content is not None:
        (tmp_path / "bad.calib").write_bytes(content)
    assert main(["evaluate", str(tmp_path / "bad.calib"), "other.csv"]) == 1
    printed = capsys.readouterr()
    assert words in printed.err
    assert printed.out == ""


def test_an_altered_and_a_truncated_calibration(folder, tmp_path, capsys):
    content = (folder / "arm.calib").read_bytes()
    altered = bytearray(content)
    altered[-5] ^= 1
    for name, changed, words in (("a", bytes(altered), "altered"), ("t", content[:-9], "cut short")):
        (tmp_path / name).write_bytes(changed)
        assert main(["evaluate", str(tmp_path / name), "other.csv"]) == 1
        assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "status", "words"),
    [
        (["--frame-rows", "0"], 2, "positive"),
        (["--frame-rows", "60"], 1, "3 must be left to judge"),
        (["--frame-rows", "9", "--keep-frames"], 2, "none to find"),
        (["--use", "pose"], 2, "no orientation was measured"),
    ],
)
def test_wrong_usage(options, status, words, capsys):
    assert main(["evaluate", "arm.calib", "other.csv", *options]) == status
    assert words in capsys.readouterr().err


def test_rows_find_the_tool_alone_where_the_world_is_known(capsys):
    arm = VirtualArm.paper(seed=3)
    arm.world_from_base = np.eye(4)
    ta.calibrate(arm.robot, arm.measure(arm.poses(40)), frame="world", model="constant").save("world.calib")
    arm.measure_table(arm.poses(30, seed=1), seed=1).to_csv("world.csv", index=False)
    assert main(["evaluate", "world.calib", "world.csv"]) == 0
    assert "rows found the tool, " in capsys.readouterr().out
    assert main(["evaluate", "world.calib", "world.csv", "--keep-tool"]) == 0
    assert "frame and tool kept, " in capsys.readouterr().out
