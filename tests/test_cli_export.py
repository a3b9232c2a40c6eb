"""`truearm export` as people run it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import truearm as ta
from tests.stages import Stages
from truearm.cli import main
from truearm.simulation import VirtualArm

PROGRAM = str(Path(sys.executable).parent / "truearm")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("export")
    arm = VirtualArm(ta.Robot.load("ur10"), seed=2)
    data = arm.measure(arm.poses(45))
    ta.calibrate(arm.robot, data, refit=False).save(place / "arm.calib")
    ta.calibrate(arm.robot, data, model="constant").save(place / "constant.calib")
    return place


@pytest.fixture(autouse=True)
def inside(folder, monkeypatch):
    monkeypatch.chdir(folder)


def test_a_urdf_as_people_write_one():
    command = [PROGRAM, "export", "arm.calib", "--to", "urdf", "-o", "arm.urdf"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "vary over the workspace" in done.stdout
    assert "Read again, its forward kinematics are ours within" in done.stdout
    assert "Written: arm.urdf" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80
    robot = ta.Robot.load("arm.urdf")
    nominal, q = ta.Robot.load("ur10"), np.full(6, 0.5)
    shift = np.linalg.norm(robot.position(q) - nominal.position(q))
    assert 1e-5 < shift < 0.02


@pytest.mark.parametrize("to", ["urdf", "ur-yaml", "dh-toml", "dh-json", "dh-csv"])
def test_json_is_all_that_is_printed(to, capsys):
    assert main(["export", "constant.calib", "--to", to, "-o", f"{to}.out", "--json"]) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert printed.err == ""
    assert found["format"] == to
    assert found["file"] == f"{to}.out"
    assert found["difference_m"] < 1e-9
    assert Path(found["file"]).is_file()


def test_progress_is_told_of(monkeypatch):
    stages = Stages()
    monkeypatch.setattr("truearm.cli.export.told_stages", lambda: stages)
    assert main(["export", "constant.calib", "--to", "dh-csv", "-o", "told.csv"]) == 0
    assert stages.names == ["exporting"]


def test_samples(capsys):
    words = ["export", "arm.calib", "--to", "field-csv", "-o", "field.csv", "--grid", "q2=-90:0:10,q3=0:90:5"]
    assert main(words) == 0
    assert "50 samples." in capsys.readouterr().out
    assert len(Path("field.csv").read_text().splitlines()) > 50


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (["constant.calib", "--to", "field-csv"], 1, "this calibration has no field"),
        (["constant.calib", "--to", "xml"], 2, 'there is no format "xml"'),
        (["constant.calib", "--to", "dh-csv", "--std"], 2, "It belongs to --to field-csv"),
        (["arm.calib", "--to", "field-csv", "--feature", "warm"], 2, "NAME=VALUE"),
        (["arm.calib", "--to", "field-csv", "--feature", "temperature=20"], 2, "features"),
        (["missing.calib", "--to", "urdf"], 1, "missing.calib: there is no such file"),
    ],
)
def test_what_cannot_be_done_is_said(words, status, message, capsys):
    assert main(["export", *words, "-o", "out.txt"]) == status
    printed = capsys.readouterr()
    assert printed.out == ""
    assert message in printed.err
    assert not Path("out.txt").exists()
