"""`truearm calibrate` as people run it."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm.cli import main
from truearm.cli.calibrate import print_results
from truearm.errors import WorkError
from truearm.reporting.report import report
from truearm.simulation import VirtualArm

PROGRAM = str(Path(sys.executable).parent / "truearm")
STATISTICS = ["mean_mm", "rms_mm", "p95_mm", "p99_mm", "max_mm"]
SUMMARY = [
    "robot",
    "n_train",
    "n_train_poses",
    "n_holdout",
    "n_holdout_poses",
    "n_holdout_distances",
    "holdout",
    "train",
    "coverage_95",
    "left_out",
    "n_planned",
    "drift",
]
SUMMARY += ["identifiability", "noise_mm", "noise_floor_mm"]


@pytest.fixture(scope="module")
def table():
    arm = VirtualArm.paper(seed=2)
    return arm.measure_table(arm.poses(80))


@pytest.fixture
def folder(table, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    table.to_csv("arm.csv", index=False)
    return tmp_path


def run(*arguments, **more):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False, **more)


def files(folder):
    return sorted(path.name for path in folder.rglob("*") if path.suffix in (".calib", ".json"))


def test_a_calibration_as_people_run_it(folder):
    done = run("calibrate", "rv-m2", "arm.csv", "-o", "result", "--train-size", "50")
    assert done.returncode == 0, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 80
    for word in ("nominal", "constant", "variable", "mean", "RMS", "95 %", "99 %", "max", "mm"):
        assert word in done.stdout
    assert "14 of 20 parameters" in done.stdout
    assert "cannot be distinguished from" in done.stdout
    assert "truearm evaluate result/calibration.calib" in done.stdout
    assert files(folder) == ["calibration.calib", "summary.json"]
    calibration = ta.Calibration.load("result/calibration.calib")
    assert calibration.validation.n_train == 50
    assert calibration.summary["n_fitted"] == 80


def test_planned_poses_are_held_out_and_a_stated_share_comes_first(folder, capsys):
    table = pd.read_csv("arm.csv")
    table["purpose"] = ["validate" if row % 8 == 0 else "train" for row in range(len(table))]
    table.to_csv("planned.csv", index=False)
    words = ["calibrate", "rv-m2", "planned.csv", "-o", "planned", "--model", "constant"]
    assert main(words) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "judged on 10 others, planned to validate (--holdout draws others)" in printed
    few = "The errors above come from 10 held-out poses: another split would give others."
    assert few in printed
    told = report(ta.Calibration.load("planned/calibration.calib")).advice
    assert [advice.words for advice in told if advice.kind == "few_held_out"] == [few]
    assert json.loads(Path("planned/summary.json").read_text())["n_planned"] == 10
    assert ta.Calibration.load("planned/calibration.calib").validation.n_planned == 10
    assert main([*words, "--holdout", "0.3"]) == 0
    assert "judged on 24 others." in capsys.readouterr().out
    assert main([*words, "--holdout", "0.4"]) == 0
    assert "another split" not in capsys.readouterr().out


def test_where_a_range_is_held_out_its_share_is_named_and_no_other_split(folder, capsys):
    words = ["calibrate", "rv-m2", "arm.csv", "-o", "range", "--model", "constant"]
    assert main([*words, "--holdout-range", "q2:high:0.2"]) == 0
    few = "which --holdout-range q2:high:0.2 holds out: a larger share would judge it on more."
    printed = " ".join(capsys.readouterr().out.split())
    assert few in printed
    assert "another split" not in printed
    told = {advice.kind: advice for advice in report(ta.Calibration.load("range/calibration.calib")).advice}
    assert told["few_held_out"].name == "Hold out a larger share."
    assert few in told["few_held_out"].words


def test_one_epoch_is_one(folder, capsys):
    data = ta.Measurements.from_dataframe(pd.read_csv("arm.csv"))
    print_results(ta.calibrate(ta.Robot.load("rv-m2"), data, model="fcmac", epochs=1))
    assert "Training, 1 epoch, " in " ".join(capsys.readouterr().out.split())


def test_the_summary_on_disk_and_on_stdout_is_one(folder, capsys):
    assert main(["calibrate", "rv-m2", "arm.csv", "-o", "result", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((folder / "result" / "summary.json").read_text())
    assert list(printed)[: len(SUMMARY)] == SUMMARY
    assert (printed["robot"], printed["n_train"], printed["n_holdout"]) == ("RV-M2", 56, 24)
    for side in ("holdout", "train"):
        assert list(printed[side]) == ["nominal", "constant", "variable"]
        for errors in printed[side].values():
            assert list(errors) == STATISTICS
    assert set(printed["seconds"]) == {"constant", "variable"}
    assert 0.8 < printed["coverage_95"] <= 1.0
    assert printed["identifiability"]["rank"] == len(printed["identifiability"]["determined"])
    kinds = [block["name"] for block in printed["blocks"]]
    assert kinds.count("own") == 5
    assert {"smooth", "sag"} <= set(kinds)
    for block in printed["blocks"]:
        inputs = len(block["joints"]) + len(block["features"])
        assert len(block["lengths"]) == (0 if block["name"] == "sag" else inputs)
        assert block["cells"] > 0
        assert block["amplitudes"]


def test_the_figures_are_those_of_the_split(folder, table):
    assert main(["calibrate", "rv-m2", "arm.csv", "-o", "out", "--no-refit", "--seed", "3"]) == 0
    calibration = ta.Calibration.load("out/calibration.calib")
    held = np.random.default_rng(3).permutation(80)[56:]
    q = table[[f"q{j}" for j in range(1, 6)]].to_numpy()[held]
    seen = table[["x", "y", "z"]].to_numpy()[held]
    missed = 1e3 * np.linalg.norm(calibration.position(q, group="arm") - seen, axis=1)
    errors = calibration.validation.holdout["variable"].position
    assert errors.mean == pytest.approx(missed.mean(), rel=1e-9)
    assert errors.p95 == pytest.approx(np.quantile(missed, 0.95), rel=1e-9)
    assert errors.max == pytest.approx(missed.max(), rel=1e-9)


def test_constant_alone_has_no_variable_column(folder, capsys):
    assert main(["calibrate", "rv-m2", "arm.csv", "-o", "out", "--model", "constant", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert list(printed["holdout"]) == ["nominal", "constant"]
    assert list(printed["seconds"]) == ["constant"]
    assert printed["blocks"] == []


def test_orientation_has_a_table_of_its_own(folder, capsys):
    arm = VirtualArm.paper(seed=2)
    arm.measure_table(arm.poses(60), orientation=True).to_csv("pose.csv", index=False)
    assert main(["calibrate", "rv-m2", "pose.csv", "-o", "out", "--model", "constant"]) == 0
    printed = capsys.readouterr().out
    assert "Orientation error, mrad" in printed
    assert max(map(len, printed.splitlines())) <= 80
    assert main(["calibrate", "rv-m2", "pose.csv", "-o", "out", "--model", "constant", "--json"]) == 0
    errors = json.loads(capsys.readouterr().out)["holdout"]["constant"]
    assert "p95_mrad" in errors


def test_files_are_set_ups_of_their_own(folder, capsys):
    arm = VirtualArm.paper(seed=9)
    arm.measure_table(arm.poses(50)).to_csv("other.csv", index=False)
    options = ["--train-size", "20", "--model", "constant", "--json"]
    assert main(["calibrate", "rv-m2", "arm.csv", "other.csv", "-o", "out", *options]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (printed["n_train"], printed["n_holdout"]) == (40, 24 + 15)
    assert ta.Calibration.load("out/calibration.calib").groups == ("arm", "other")


def test_progress_of_what_takes_longer_goes_to_stderr(folder, capsys, monkeypatch):
    monkeypatch.setattr("truearm.cli.display.PATIENCE_S", 0.001)
    assert main(["calibrate", "rv-m2", "arm.csv", "-o", "out", "--no-refit", "--json"]) == 0
    printed = capsys.readouterr()
    json.loads(printed.out)
    assert "Fitting what varies ... " in printed.err


def test_warnings_go_to_stderr(folder, table, capsys):
    table.iloc[[*range(80), 4]].to_csv("twice.csv", index=False)
    assert main(["calibrate", "rv-m2", "twice.csv", "-o", "out", "--model", "constant", "--json"]) == 0
    printed = capsys.readouterr()
    assert "Warning: Identical to an earlier row in everything, counted once: row 81." in printed.err
    (notice,) = json.loads(printed.out)["notices"]
    assert notice["kind"] == "identical_rows"
    assert "row 81" in notice["message"]


def test_limits_warn(folder, table, capsys):
    beyond = table.copy()
    beyond.loc[3, "q2"] = np.radians(110.0)
    beyond.to_csv("beyond.csv", index=False)
    assert main(["calibrate", "rv-m2", "beyond.csv", "-o", "out", "--model", "constant"]) == 0
    assert "Joint 2 is outside its limits (-30 to 100 deg) in row 4" in capsys.readouterr().err


def changed(table, **changes):
    copy = table.copy()
    for name, value in changes.items():
        copy[name] = value
    return copy


def with_cell(table, row, column, value):
    copy = table.astype(object)
    copy.loc[row, column] = value
    return copy


BAD_INPUT = {
    "wrong column names": (lambda t: t.rename(columns={"q1": "joint1"}), "q1"),
    "no positions": (lambda t: t[["q1", "q2", "q3", "q4", "q5"]], "position"),
    "millimetres as metres": (lambda t: changed(t, **{a: 1e3 * t[a] for a in "xyz"}), "millimetres"),
    "not a number": (lambda t: with_cell(t, 6, "q2", "nan"), "row 7"),
    "infinite": (lambda t: with_cell(t, 6, "x", "inf"), "row 7"),
    "text": (lambda t: with_cell(t, 6, "x", "far"), "row 7"),
    "too few": (lambda t: t.head(7), "unknowns"),
    "one row": (lambda t: t.head(1), "row"),
    "all alike": (lambda t: t.iloc[[0] * 20].assign(x=np.arange(20.0) * 1e-5), "alike"),
    "degrees as radians": (
        lambda t: changed(t, **{f"q{j}": np.degrees(t[f"q{j}"]) for j in range(1, 6)}),
        "deg",
    ),
    "another robot": (lambda t: t.assign(q6=0.0), "6 joint columns"),
    "no rows": (lambda t: t.head(0), "no data rows"),
}


@pytest.mark.parametrize("name", BAD_INPUT)
def test_bad_input_is_refused_and_nothing_is_written(name, folder, table, capsys):
    make, words = BAD_INPUT[name]
    make(table).to_csv("bad.csv", index=False)
    assert main(["calibrate", "rv-m2", "bad.csv", "-o", "out"]) in (1, 2)
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("Error: ")
    assert "bad.csv" in printed.err
    assert words in printed.err
    assert not (folder / "out").exists()


@pytest.mark.parametrize("content", [b"", b"\x89PNG\r\n\x1a\n" + bytes(50), b"PK\x03\x04" + bytes(50)])
def test_files_that_are_no_table_are_refused(content, folder, capsys):
    (folder / "bad.csv").write_bytes(content)
    assert main(["calibrate", "rv-m2", "bad.csv", "-o", "out"]) == 1
    assert "bad.csv" in capsys.readouterr().err
    assert not (folder / "out").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--train-size", "70"], "at most 56 can train"),
        (["--holdout", "1.5"], "between 0 and 1"),
        (["--holdout-range", "q9:high:0.3"], "joint 9"),
        (["--holdout-range", "tail"], "qJ:low:SHARE"),
        (["--split-by", "place"], 'no column "place"'),
        (["--holdout", "0.2", "--holdout-range", "q1:low:0.2"], "Give one of them"),
        (["--split-by", "group", "--holdout-range", "q1:low:0.2"], "not both"),
        (["--use", "targets"], "one point was measured"),
        (["--use", "all"], "Either position or pose or targets"),
        (["--model", "best"], "Either variable or constant"),
        (["--robust", "strong"], "Either none or huber or cauchy"),
        (["--frame", "base"], "Either free or world"),
        (["--judge-target", "4"], "no target 4"),
    ],
)
def test_wrong_usage_has_status_2(options, words, folder, capsys):
    assert main(["calibrate", "rv-m2", "arm.csv", "-o", "out", *options]) == 2
    assert words in capsys.readouterr().err
    assert not (folder / "out").exists()


def test_an_unknown_robot_or_file_is_said(folder, capsys):
    assert main(["calibrate", "rv-m3", "arm.csv", "-o", "out"]) == 1
    assert "rv-m2" in capsys.readouterr().err
    assert main(["calibrate", "rv-m2", "nowhere.csv", "-o", "out"]) == 1
    assert "nowhere.csv: there is no such file" in capsys.readouterr().err
    (folder / "taken").write_text("")
    assert main(["calibrate", "rv-m2", "arm.csv", "-o", "taken"]) == 1
    assert "-o names a directory" in capsys.readouterr().err
    assert main(["calibrate", "rv-m2", "arm.csv", "-o", "taken/below"]) == 1
    assert "taken: this is a file" in capsys.readouterr().err


def test_an_open_set_up_is_warned_of(folder, capsys):
    arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=2)
    arm.measure_table(arm.poses(60)).to_csv("scara.csv", index=False)
    assert main(["calibrate", "adept-cobra-600", "scara.csv", "-o", "out", "--model", "constant"]) == 0
    assert "Warning: The poses determine 8 of 9 unknowns of frame and target" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("after_s", [1.5, 4.0])
def test_ctrl_c_ends_within_a_second_and_leaves_nothing(after_s, tmp_path):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=2)
    arm.measure_table(arm.poses(3000), orientation=True).to_csv(tmp_path / "arm.csv", index=False)
    command = [PROGRAM, "calibrate", "ur10", "arm.csv", "-o", "out"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        time.sleep(after_s)
        began = time.monotonic()
        os.kill(process.pid, signal.SIGINT)
        _, told = process.communicate(timeout=30)
        took = time.monotonic() - began
    assert process.returncode == 130
    assert took < 1.5
    assert told.endswith("Interrupted.\n")
    assert files(tmp_path) == []


@pytest.mark.parametrize("name", ["summary.json", "report.html", "calibration.calib"])
def test_measurements_are_not_written_over(name, folder, capsys):
    (folder / "arm.csv").rename(folder / name)
    before = (folder / name).read_bytes()
    assert main(["calibrate", "rv-m2", name, "-o", "."]) == 2
    assert "never written over" in capsys.readouterr().err
    assert (folder / name).read_bytes() == before


def test_no_report_of_another_calibration_is_left_beside_one(folder, monkeypatch):
    def stopped(*_):
        raise WorkError("stopped here")

    command = ["calibrate", "rv-m2", "arm.csv", "-o", "out", "--model", "constant"]
    assert main(command) == 0
    assert (folder / "out/report.html").exists()
    monkeypatch.setattr("truearm.cli.calibrate.make_report", stopped)
    assert main([*command, "--seed", "3"]) == 1
    assert (folder / "out/calibration.calib").exists()
    assert not (folder / "out/report.html").exists()


def test_another_calibration_that_is_there_is_kept(folder, capsys):
    command = ["calibrate", "rv-m2", "arm.csv", "-o", "out", "--model", "constant"]
    assert main(command) == 0
    first = (folder / "out/calibration.calib").read_bytes()
    capsys.readouterr()
    assert main(command) == 0
    assert "is kept" not in capsys.readouterr().err
    assert not (folder / "out/calibration.previous.calib").exists()
    assert main([*command, "--seed", "3"]) == 0
    assert "was there is kept as out/calibration.previous.calib" in capsys.readouterr().err
    assert (folder / "out/calibration.previous.calib").read_bytes() == first
    assert (folder / "out/calibration.calib").read_bytes() != first
