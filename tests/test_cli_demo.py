"""`truearm demo` from an empty directory."""

import json
import subprocess
import sys
from pathlib import Path

import truearm as ta
from truearm.cli import main

PROGRAM = str(Path(sys.executable).parent / "truearm")


def test_the_demonstration_shows_the_whole_way(tmp_path):
    done = subprocess.run([PROGRAM, "demo"], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 80
    for name in ("measurements.csv", "another_day.csv", "calibration.calib", "summary.json"):
        assert (tmp_path / "demo" / name).exists()
        assert f"demo/{name}" in done.stdout
    errors = json.loads((tmp_path / "demo" / "summary.json").read_text())["holdout"]
    assert errors["variable"]["mean_mm"] < errors["constant"]["mean_mm"] < errors["nominal"]["mean_mm"]


def test_what_it_says_to_try_next_works(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["demo", "-o", "here"]) == 0
    lines = capsys.readouterr().out.splitlines()
    commands = [line.split()[1:] for line in lines if line.startswith("  truearm ")]
    assert {command[0] for command in commands} == {"evaluate", "calibrate"}
    for command in commands:
        assert main(command) == 0
    assert ta.Calibration.load("here/calibration.calib").robot == ta.Robot.load("rv-m2")


def test_a_file_in_the_way_is_left_alone(tmp_path, capsys):
    (tmp_path / "demo").write_text("mine")
    assert main(["demo", "-o", str(tmp_path / "demo")]) == 1
    assert (tmp_path / "demo").read_text() == "mine"
    assert "names a directory" in capsys.readouterr().err
