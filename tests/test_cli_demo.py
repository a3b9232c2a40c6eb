"""`truearm demo` from an empty directory: the paper's cell in small, with a fast clock."""

import json
import subprocess
import sys
from pathlib import Path

import truearm as ta
from truearm.cell.session import Session
from truearm.cli import main

PROGRAM = str(Path(sys.executable).parent / "truearm")
QUICK = ("-n", "16", "--speed", "500")
WRITTEN = ("cell.toml", "poses.csv", "session.db", "measurements.csv", "calibration.calib", "path.csv")


def test_the_demonstration_shows_the_whole_way_and_goes_on_where_it_was(tmp_path, monkeypatch, capsys):
    command = [PROGRAM, "demo", *QUICK]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert "stored, " in done.stderr
    for name in (*WRITTEN, "summary.json", "report.html"):
        assert (tmp_path / "demo" / name).exists()
        assert f"demo/{name}" in done.stdout
    summary = json.loads((tmp_path / "demo" / "summary.json").read_text())
    errors = summary["holdout"]
    assert errors["constant"]["mean_mm"] < 0.5 * errors["nominal"]["mean_mm"]
    with Session(tmp_path / "demo" / "session.db", writing=False) as session:
        before = session.rows("SELECT count(*) FROM readings")
    monkeypatch.chdir(tmp_path)
    assert main(["demo", *QUICK, "--json"]) == 0
    path = json.loads(capsys.readouterr().out)["path_error_mm"]
    assert path["after"]["mean"] < 0.3 * path["before"]["mean"]
    with Session(tmp_path / "demo" / "session.db", writing=False) as session:
        assert session.rows("SELECT count(*) FROM readings") == before
    assert main(["session", "export", "demo/session.db", "-o", "exported.csv"]) == 0
    measured = (tmp_path / "demo" / "measurements.csv").read_text()
    assert measured == (tmp_path / "exported.csv").read_text()
    assert 0 < summary["n_holdout"] == summary["n_planned"] == measured.count("validate")
    lines = done.stdout.splitlines()
    commands = [line.split()[1:] for line in lines if line.startswith("  truearm ")]
    assert [(command[0], main(command)) for command in commands] == [
        ("session", 0),
        ("plan", 0),
        ("compensate", 0),
    ]
    assert ta.Calibration.load("demo/calibration.calib").robot == ta.Robot.load("rv-m2")
    planned = Path("demo/poses.csv").read_bytes()
    assert main(["demo", "-n", "12", "--speed", "500"]) == 1
    assert "demo/session.db" in capsys.readouterr().err
    assert Path("demo/poses.csv").read_bytes() == planned


def test_a_file_in_the_way_is_left_alone(tmp_path, capsys):
    (tmp_path / "demo").write_text("mine")
    assert main(["demo", "-o", str(tmp_path / "demo")]) == 1
    assert (tmp_path / "demo").read_text() == "mine"
    assert "names a directory" in capsys.readouterr().err
