"""`truearm fleet` as people run it."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import truearm as ta
import truearm.fleet
from truearm.cli import main
from truearm.simulation import VirtualArm

PROGRAM = str(Path(sys.executable).parent / "truearm")
FLEET = """
name = "Hall 3"

[defaults]
robot = "ur10"
measurements = "{arm}.csv"
model = "constant"

[[arm]]
name = "R1"

[[arm]]
name = "R2"
report = false
"""
LONG_S = 60.0
ENDS_WITHIN_S = 10.0
MANY = 50


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("hall")
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1)
    arm.measure_table(arm.poses(60)).to_csv(made / "R1.csv", index=False)
    (made / "fleet.toml").write_text(FLEET)
    return made


def run(folder, *arguments):
    return subprocess.run(
        [PROGRAM, "fleet", *arguments], cwd=folder, capture_output=True, text=True, check=False
    )


def test_a_fleet_as_people_run_it(folder):
    done = run(folder, "fleet.toml", "-o", "out", "--workers", "1")
    assert done.returncode == 1
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert " nominal " in done.stdout
    for words in ("R2: R2.csv: there is no such file.", "1 of 2 arms are good", "out/fleet.html"):
        assert words in done.stdout
    assert "truearm fleet fleet.toml -o out --workers 1" in done.stdout
    made = {path.name for path in (folder / "out" / "R1").iterdir()}
    assert made == {"arm.json", "calibration.calib", "report.html", "summary.json"}
    assert 'href="R1/report.html"' in (folder / "out" / "fleet.html").read_text()
    (folder / "R2.csv").write_bytes((folder / "R1.csv").read_bytes())
    mended = run(folder, "fleet.toml", "-o", "out", "--workers", "1", "--json")
    assert mended.returncode == 0
    printed = json.loads(mended.stdout)
    assert printed == json.loads((folder / "out" / "fleet.json").read_text())
    assert printed["counts"] == {"good": 2, "attention": 0, "failed": 0}
    assert not (folder / "out" / "R2" / "report.html").exists()


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (("bad.toml", "-o", "bad"), 1, 'bad.toml, defaults: unknown key "modell". Did you mean "model"?'),
        (("none.toml", "-o", "bad"), 1, "none.toml: there is no such file."),
        (("fleet.toml", "-o", "fleet.toml"), 1, "-o names a directory"),
        (("fleet.toml", "-o", "bad", "--workers", "0"), 2, "--workers"),
        (("fleet.toml", "-o", "bad", "--scheduler", "here"), 1, "here: no Dask scheduler answers"),
    ],
)
def test_errors_are_told_in_words(folder, monkeypatch, capsys, arguments, status, words):
    monkeypatch.chdir(folder)
    Path("bad.toml").write_text(FLEET.replace("model =", "modell ="))
    assert main(["fleet", *arguments]) == status
    assert words in capsys.readouterr().err
    assert not Path("bad").exists()


def test_a_fleet_that_is_interrupted_before_any_arm_is_finished_says_so(folder, monkeypatch, capsys):
    def interrupted(*_arguments, **_options):
        raise KeyboardInterrupt

    monkeypatch.chdir(folder)
    monkeypatch.setattr(truearm.fleet, "run_fleet", interrupted)
    assert main(["fleet", "fleet.toml", "-o", "none"]) == 130
    said = capsys.readouterr().err
    assert said == "No arm is finished yet; the same command begins anew.\nInterrupted.\n"


def test_an_interrupted_fleet_ends_at_once_and_continues(folder, tmp_path):
    for k in range(MANY):
        (tmp_path / f"B{k}.csv").symlink_to(folder / "R1.csv")
    head = FLEET[: FLEET.index("[[arm]]")].replace('"constant"', '"constant"\nreport = false')
    sections = [f'[[arm]]\nname = "B{k}"\n' for k in range(MANY)]
    (tmp_path / "fleet.toml").write_text(head + "".join(sections))
    command = [PROGRAM, "fleet", "fleet.toml", "-o", "out", "--workers", "1"]
    with subprocess.Popen(
        command, cwd=tmp_path, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    ) as process:
        while not list(tmp_path.glob("out/*/arm.json")):
            assert process.poll() is None
            time.sleep(0.01)
        began = time.monotonic()
        os.killpg(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=LONG_S)
        assert time.monotonic() - began < ENDS_WITHIN_S
    assert process.returncode == 130
    assert said.endswith(
        b"Finished arms are in out; the same command goes on with the others.\nInterrupted.\n"
    )
    assert b"Traceback" not in said
    finished = len(list(tmp_path.glob("out/*/arm.json")))
    assert 0 < finished < MANY
    (tmp_path / "fleet.toml").write_text(head + "".join(sections[: finished + 1]))
    done = run(tmp_path, "fleet.toml", "-o", "out", "--workers", "1")
    assert done.stdout.startswith(f"{finished} of {finished + 1} arms were finished before.")
    assert done.returncode == 0
