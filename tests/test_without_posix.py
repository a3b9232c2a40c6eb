"""Our code does without what Python has on POSIX systems alone; see without_posix.py for what this shows."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

import truearm as ta
from truearm.simulation import VirtualArm

RUNNER = str(Path(__file__).parent / "without_posix.py")
FLEET = """
[defaults]
model = "constant"
report = false
[[arm]]
name = "first"
robot = "ur5e"
measurements = ["measured.csv"]
[[arm]]
name = "second"
robot = "ur5e"
measurements = ["measured.csv"]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("without_posix")
    arm = VirtualArm(ta.Robot.load("ur5e"), seed=3)
    measured = arm.measure(arm.poses(40))
    arm.measure_table(arm.poses(40)).to_csv(made / "measured.csv", index=False)
    ta.calibrate(arm.robot, measured, model="constant").save(made / "arm.calib")
    (made / "fleet.toml").write_text(FLEET)
    return made


def run(folder, *arguments):
    command = [sys.executable, RUNNER, *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_poses_are_planned(folder):
    done = run(folder, "plan", "--acceptance", "4", "--from", "arm.calib", "-o", "poses.csv")
    assert done.returncode == 0, done.stderr
    assert len(pd.read_csv(folder / "poses.csv")) == 4


def test_the_demonstration_measures_over_tcp_with_devices_that_are_threads(folder):
    done = run(folder, "demo", "-n", "12", "--speed", "500", "-o", "demo", "--json")
    assert done.returncode == 0, done.stderr
    path = json.loads(done.stdout)["path_error_mm"]
    assert path["after"]["mean"] < path["before"]["mean"]


def test_arms_of_a_fleet_are_fitted_side_by_side(folder):
    done = run(folder, "fleet", "fleet.toml", "-o", "fleet", "--workers", "2")
    assert done.returncode == 0, done.stderr
    assert "All 2 arms are good." in done.stdout


def test_a_server_ends_by_ctrl_c(folder):
    command = [sys.executable, RUNNER, "serve", "arm.calib", "--port", "0", "--json"]
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as running:
        assert running.stdout is not None
        assert json.loads(running.stdout.readline())["robot"] == "UR5e"
        running.send_signal(signal.SIGINT)
        assert running.communicate(timeout=30)[1] == ""
    assert running.returncode == 0
