"""`truearm update` as people run it."""

import json

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from tests.remastered import remastered_table
from tests.report_support import words_of
from truearm.cli import main
from truearm.reporting.report import report
from truearm.simulation import Imperfections, VirtualArm

SHIFT = np.array([0.0, 0.6, 0.0, 0.9, 0.0])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("update")
    arm = VirtualArm.paper(seed=2)
    ta.calibrate(arm.robot, arm.measure(arm.poses(60))).save(place / "old.calib")
    remastered_table(arm, arm.poses(15, seed=9), SHIFT, seed=9).to_csv(place / "moved.csv", index=False)
    arm.measure_table(arm.poses(15, seed=8), seed=8).to_csv(place / "same.csv", index=False)
    return place


@pytest.fixture(autouse=True)
def there(folder, monkeypatch):
    monkeypatch.chdir(folder)


def test_an_update_is_told_written_and_rolled_back(folder, capsys):
    assert main(["update", "old.calib", "moved.csv", "-o", "new.calib"]) == 0
    told = capsys.readouterr().out
    assert "Offsets or tool changed." in told
    assert "confounded with the frame" in told
    assert "truearm update --roll-back new.calib" in told
    assert max(map(len, told.splitlines())) <= 80
    assert main(["update", "--roll-back", "new.calib", "-o", "back.calib"]) == 0
    assert "SHA-256" in capsys.readouterr().out
    assert (folder / "back.calib").read_bytes() == (folder / "old.calib").read_bytes()
    assert main(["update", "old.calib", "moved.csv", "-o", "new.calib"]) == 2
    assert "overwrites nothing" in capsys.readouterr().err
    assert main(["strip", "new.calib", "-o", "small.calib"]) == 0
    capsys.readouterr()
    assert main(["update", "--roll-back", "small.calib", "-o", "never.calib"]) == 1
    assert "left out when the file was stripped" in capsys.readouterr().err
    assert not (folder / "never.calib").exists()


def test_the_two_tests_are_said_to_share_the_level(capsys):
    assert main(["update", "old.calib", "moved.csv", "--level", "0.03"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "each counts below 0.015, half the level of 0.03 that the two share." in told
    assert main(["update", "old.calib", "moved.csv", "--level", "0.03", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (printed["level"], printed["threshold"]) == (0.03, 0.015)
    found = ta.update(ta.Calibration.load("old.calib"), ta.Measurements.read_csv("moved.csv"), level=0.03)
    page = words_of(report(found.calibration).html)
    assert "share the level of significance, 3 %: each counts where p is below 0.015." in page


def test_a_p_between_half_the_level_and_the_level_does_not_count(folder):
    calibration, table = ta.Calibration.load("old.calib"), pd.read_csv("same.csv")
    axes = ["x", "y", "z"]
    table[axes] += np.random.default_rng(3).normal(scale=3e-5, size=(len(table), 3))
    data = ta.Measurements.from_dataframe(table)
    p = ta.update(calibration, data).rest.p
    assert 1e-6 < p < 0.3
    assert ta.update(calibration, data, level=1.5 * p).verdict == "holds"
    assert ta.update(calibration, data, level=2.5 * p).verdict == "field"


def test_coarse_rows_of_an_arm_that_did_not_change_do_not_replace_its_calibration(folder, capsys):
    table, axes = pd.read_csv("same.csv"), ["x", "y", "z"]
    table[axes] += np.random.default_rng(3).normal(scale=1.5e-4, size=(len(table), 3))
    table.assign(sigma_mm=0.15).to_csv("coarse.csv", index=False)
    assert main(["update", "old.calib", "coarse.csv", "-o", "coarse.calib"]) == 0
    out, err = (" ".join(said.split()) for said in capsys.readouterr())
    assert "The calibration still holds" in out
    assert "Nothing moved, and the calibration as it was is the more certain" in err
    assert "The old calibration is the more certain: keep old.calib." in out
    assert "--roll-back" not in out
    revision = ta.Calibration.load("coarse.calib").revision
    assert revision is not None
    report = revision.report
    assert 1.1 * report["expected_before_mm"] < report["expected_after_mm"] < 1.0
    assert any("is the more certain" in notice["message"] for notice in report["notices"])
    assert main(["update", "old.calib", "moved.csv", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["expected_before_mm"], told["expected_after_mm"]) == (None, None)


def test_without_output_nothing_is_written(folder, capsys):
    before = sorted(folder.iterdir())
    assert main(["update", "old.calib", "same.csv"]) == 0
    told = capsys.readouterr().out
    assert "The calibration still holds" in told
    assert "truearm compensate old.calib PROGRAM --dry-run" in told
    assert sorted(folder.iterdir()) == before


def test_a_calibration_that_no_longer_fits_is_made_anew_from_new_rows_alone(folder, capsys):
    arm = VirtualArm.paper(seed=2, imperfections=Imperfections(share=0.5))
    arm.measure_table(arm.poses(15, seed=9), seed=9).to_csv("bent.csv", index=False)
    assert main(["update", "old.calib", "bent.csv"]) == 0
    told = capsys.readouterr().out
    assert max(map(len, told.splitlines())) <= 80
    words = " ".join(told.split())
    assert "The calibration itself no longer fits" in words
    assert "Check that these are measurements of this arm." in words
    assert "The old rows are of the arm as it was: calibrate from new ones alone." in words
    assert "truearm plan rv-m2 -n 60 -o poses.csv" in words
    assert "truearm calibrate rv-m2 MEASUREMENTS.csv -o result" in words
    assert "--next" not in words


def test_coupled_joints_that_one_motor_changed_are_told(tmp_path, capsys):
    arm = VirtualArm(ta.Robot.load("fanuc-lr-mate-200id"), seed=2)
    data = arm.measure(arm.poses(60))
    ta.calibrate(arm.robot, data, model="constant").save(tmp_path / "fanuc.calib")
    moved = remastered_table(arm, arm.poses(15, seed=9), [0.0, 0.05, -0.05, 0.0, 0.0, 0.0], seed=9)
    moved.to_csv(tmp_path / "later.csv", index=False)
    assert main(["update", str(tmp_path / "fanuc.calib"), str(tmp_path / "later.csv")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "one motor was re-mastered or slipped, that of joint 2." in told


def test_what_is_kept_is_not_said_to_be_found(capsys):
    assert main(["update", "old.calib", "moved.csv", "--keep-frame", "--keep-tool"]) == 0
    told = capsys.readouterr().out
    assert "Frame of moved: kept as it was." in told
    assert "Tool of moved: kept as it was." in told
    assert "Offsets changed." in told
    assert "anew" not in told


def test_joints_that_were_not_tested_are_named_with_the_options_that_tell_them(capsys):
    assert main(["update", "old.calib", "same.csv"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "no significant change was found. Joints 1 and 5 were not tested." in told
    assert "if the device stands where it stood, --keep-frame tells it." in told
    assert "if the target sits where it sat, --keep-tool tells it." in told
    assert main(["update", "old.calib", "same.csv", "--new-tool"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "--keep-tool" not in told
    assert main(["update", "old.calib", "same.csv", "--keep-frame", "--keep-tool"]) == 0
    assert "not tested" not in capsys.readouterr().out


def test_options_are_proposed_where_the_calibration_knows_all_set_ups(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arm = VirtualArm.paper(seed=2)
    data = arm.measure_table(arm.poses(40)).assign(group=["near"] * 20 + ["far"] * 20)
    data.to_csv("known.csv", index=False)
    calibration = ta.calibrate(arm.robot, ta.Measurements.read_csv("known.csv"), model="constant")
    calibration.save("two.calib")
    table = arm.measure_table(arm.poses(30, seed=8), seed=8)
    for second, proposed in (("far", True), ("elsewhere", False)):
        table.assign(group=["near"] * 15 + [second] * 15).to_csv("later.csv", index=False)
        assert main(["update", "two.calib", "later.csv", "-o", f"{second}.calib"]) == 0
        told = " ".join(capsys.readouterr().out.split())
        assert "not tested" in told
        words = words_of(report(ta.Calibration.load(f"{second}.calib")).html)
        for option in ("--keep-frame", "--keep-tool"):
            assert (option in told, option in words) == (proposed, proposed)


def test_what_was_not_written_is_proposed_with_the_same_options(folder, capsys):
    assert main(["update", "old.calib", "moved.csv", "--keep-frame", "--level", "0.02"]) == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if "-o NEW.calib" in line)
    assert line.split()[2:-2] == ["old.calib", "moved.csv", "--keep-frame", "--level", "0.02"]
    assert main([*line.split()[1:-1], "again.calib"]) == 0
    assert (folder / "again.calib").exists()


def test_nothing_is_written_over_or_into_a_file(folder, capsys):
    before = (folder / "same.csv").read_bytes()
    assert main(["update", "old.calib", "same.csv", "-o", "same.csv"]) == 2
    assert "this is a file. -o names a .calib file or a directory." in capsys.readouterr().err
    assert (folder / "same.csv").read_bytes() == before
    (folder / "kept").mkdir()
    (folder / "kept" / "update.json").write_text("mine")
    assert main(["update", "old.calib", "same.csv", "-o", "kept"]) == 2
    assert "update.json: there is a file already" in capsys.readouterr().err


def test_json_says_it_to_programs(folder, capsys):
    assert main(["update", "old.calib", "moved.csv", "-o", "result", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"] == "moved"
    assert told["calibration"] == "result/calibration.calib"
    assert [entry["moved"] for entry in told["offsets"]] == [False, True, False, True, False]
    assert json.loads((folder / "result" / "update.json").read_text())["verdict"] == "moved"
    assert main(["update", "result/calibration.calib", "--roll-back", "-o", "b.calib", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == {"calibration", "sha256"}


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (["old.calib"], 2, "no measurements were given"),
        (["old.calib", "--roll-back"], 2, "-o is missing"),
        (["old.calib", "same.csv", "--roll-back", "-o", "x.calib"], 2, "measurements were given"),
        (["old.calib", "--roll-back", "-o", "x.calib"], 2, "was not updated"),
        (["same.csv", "same.csv"], 1, "no calibration file"),
        (["none.calib", "same.csv"], 1, "no such file"),
        (["old.calib", "same.csv", "--keep-tool", "--new-tool"], 2, "Give one of"),
        (["old.calib", "same.csv", "--level", "2"], 2, "Between 0 and 1"),
    ],
)
def test_wrong_use_is_told(words, status, message, capsys):
    assert main(["update", *words]) == status
    assert message in capsys.readouterr().err
