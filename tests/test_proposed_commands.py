"""Commands that commands propose: typed as they stand, they work."""

import re
import shlex
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from tests.remastered import remastered_table
from truearm.cli import calibrate, main, session_export
from truearm.cli.again import calibrate_again, calibrate_anew, plan_anew
from truearm.cli.command_words import option_words
from truearm.errors import typed
from truearm.fits.options import CalibrationOptions
from truearm.simulation import VirtualArm


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with blanks in its names of files: an arm of its own, and measurements of it."""
    monkeypatch.chdir(tmp_path)
    robot = ta.Robot.load("rv-m2")
    (tmp_path / "my arm.toml").write_text(robot.to_toml().replace('"RV-M2"', '"Our 5"'))
    arm = VirtualArm(ta.Robot.load("my arm.toml"), seed=1)
    arm.measure_table(arm.poses(40)).to_csv("my data.csv", index=False)
    return arm


def proposed(text, begin):
    """The words of the proposed command that begins so."""
    return shlex.split(
        next(line for line in text.splitlines() if line.strip().startswith(f"truearm {begin}"))
    )


@pytest.mark.parametrize(
    "word", ["a b.csv", "it's.csv", "$x.csv", "#x.csv", "a;b.csv", "C:\\x.csv", "plain.csv", ""]
)
def test_words_are_read_back_by_a_shell(word):
    assert shlex.split(typed(word)) == [word]


def test_the_tip_of_a_urdf_needs_no_quotes():
    assert typed("arm.urdf#base_link,tool0") == "arm.urdf#base_link,tool0"


def test_files_with_blanks_are_proposed_as_one_word(folder, capsys):
    assert main(["calibrate", "my arm.toml", "my data.csv", "-o", "my out", "--model", "constant"]) == 0
    words = proposed(capsys.readouterr().out, "evaluate")
    assert words == ["truearm", "evaluate", "my out/calibration.calib", "OTHER.csv"]
    assert main(["robots", "my arm.toml"]) == 0
    words = proposed(capsys.readouterr().out, "plan")
    assert main(words[1:]) == 0
    assert "'my arm.toml'" in capsys.readouterr().out


def test_commands_for_a_calibration_with_features_name_them(folder, capsys):
    table = pd.read_csv("my data.csv").assign(temperature_C=[20.0 + k / 10 for k in range(40)])
    table.to_csv("warm.csv", index=False)
    words = ["calibrate", "my arm.toml", "warm.csv", "-o", "out", "--features", "temperature_C"]
    assert main([*words, "--no-refit"]) == 0
    assert "--feature temperature_C=NUMBER --dry-run" in capsys.readouterr().out
    assert main(["strip", "out/calibration.calib", "-o", "small.calib"]) == 0
    words = proposed(capsys.readouterr().out, "serve")
    assert words == ["truearm", "serve", "small.calib", "--feature", "temperature_C=NUMBER"]


def test_next_poses_measured_and_calibrated_from_as_proposed_share_the_set_up(folder, capsys):
    assert main(["calibrate", "my arm.toml", "my data.csv", "-o", "out", "--model", "constant"]) == 0
    capsys.readouterr()
    assert main(["plan", "--next", "4", "--from", "out/calibration.calib", "-o", "more.csv"]) == 0
    told = capsys.readouterr().out
    assert "Older rows count only if the arm has not changed since" in told
    words = proposed(told, "calibrate")
    model = ["--model", "constant"]
    assert words[2:] == ["ROBOT", "my data.csv", "MEASUREMENTS.csv", *model, "-o", "result"]
    poses = pd.read_csv("more.csv")
    readings = poses[[f"q{j}" for j in range(1, 6)]].to_numpy()
    found = folder.measure_table(readings, seed=5).join(poses[["approach", "purpose", "group"]])
    found.to_csv("MEASUREMENTS.csv", index=False)
    words[words.index("ROBOT")] = "my arm.toml"
    assert main(words[1:]) == 0
    calibration = ta.Calibration.load("result/calibration.calib")
    assert calibration.groups == ("my data",)
    assert calibration.validation.holdout["constant"].position.max < 2.0


def test_features_that_a_calibration_varies_with_are_asked_for_again(folder, capsys):
    table = pd.read_csv("my data.csv").assign(warmth=[20.0 + k / 10 for k in range(40)])
    table.to_csv("warmth.csv", index=False)
    words = ["calibrate", "my arm.toml", "warmth.csv", "-o", "felt", "--features", "warmth", "--seed", "3"]
    assert main([*words, "--no-refit"]) == 0
    capsys.readouterr()
    assert main(["plan", "--next", "1", "--from", "felt/calibration.calib", "-o", "felt.csv"]) == 0
    told = capsys.readouterr().out
    assert 'Note "warmth" at each pose' in told
    options = ["--seed", "3", "--features", "warmth", "--no-refit"]
    assert proposed(told, "calibrate")[4:] == ["MEASUREMENTS.csv", *options, "-o", "result"]


@pytest.fixture(scope="module")
def measured():
    """An arm, and tables of it: as it was, later, and with joint 2 re-mastered."""
    arm = VirtualArm(ta.Robot.load("rv-m2"), seed=1)
    moved = remastered_table(arm, arm.poses(15, seed=9), [0.0, 0.6, 0.0, 0.0, 0.0], seed=9)
    later = arm.measure_table(arm.poses(15, seed=9), seed=9)
    return arm.robot, arm.measure_table(arm.poses(40)), later, moved


def updated(measured, folder, *, moved=False, group=None, **options):
    """A calibration from old.csv that is taken over with new.csv."""
    robot, old, later, changed = measured
    named = {} if group is None else {"group": group}
    old.assign(**named).to_csv(folder / "old.csv", index=False)
    (changed if moved else later).assign(**named).to_csv(folder / "new.csv", index=False)
    before = ta.calibrate(robot, ta.Measurements.read_csv("old.csv"), model="constant")
    return ta.update(before, ta.Measurements.read_csv("new.csv"), **options).calibration


def files_of(again):
    """The files of a proposed command."""
    return [word for word in shlex.split(again.command) if word.endswith(".csv")]


@pytest.mark.parametrize(
    ("given", "files", "said"),
    [
        ({}, ["old.csv", "new.csv"], None),
        ({"moved": True}, ["new.csv"], "joint 2 moved"),
        ({"group": "cell"}, ["new.csv"], '"cell" would be one set-up'),
        ({"group": "cell", "keep_frame": True, "keep_tool": True}, ["old.csv", "new.csv"], None),
    ],
)
def test_files_before_an_update_are_named_where_their_rows_belong(
    given, files, said, measured, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    again = calibrate_again(updated(measured, tmp_path, **given), "rv-m2", "MORE.csv")
    assert files_of(again) == [*files, "MORE.csv"]
    assert len(again.notes) == (said is not None)
    assert said is None or (said in again.notes[0] and 'before "new.csv"' in again.notes[0])


@pytest.mark.parametrize("verdict", ["moved", "field"])
def test_rows_that_do_not_belong_to_older_ones_update_and_are_too_few_to_calibrate_from(
    verdict, measured, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    known = updated(measured, tmp_path, moved=True)
    assert known.revision is not None
    report = {**known.revision.report, "verdict": verdict}
    replace(known, revision=replace(known.revision, report=report)).save("new.calib")
    assert main(["plan", "--next", "10", "--from", "new.calib", "-o", "more.csv"]) == 0
    told = capsys.readouterr().out
    said = " ".join(told.split())
    assert "learned anew from as many poses as before" in said
    assert "Older rows count" not in said
    assert ("truearm update OLD.calib new.csv MEASUREMENTS.csv -o NEW.calib" in told) == (verdict == "moved")
    assert ("truearm update --roll-back new.calib -o OLD.calib" in told) == (verdict == "moved")
    assert ("when these are measured too" in said) == (verdict == "moved")
    assert proposed(told, "plan")[2:] == ["rv-m2", "-n", "60", "-o", "poses.csv"]


def test_a_second_update_adds_its_file_to_those_before(measured, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    once = updated(measured, tmp_path)
    arm = VirtualArm(once.robot, seed=1)
    arm.measure_table(arm.poses(15, seed=5), seed=5).to_csv("newer.csv", index=False)
    twice = ta.update(once, ta.Measurements.read_csv("newer.csv")).calibration
    twice.save("twice.calib")
    again = calibrate_again(ta.Calibration.load("twice.calib"), None, "MORE.csv")
    assert files_of(again) == ["old.csv", "new.csv", "newer.csv", "MORE.csv"]
    assert files_of(calibrate_again(twice.without_rows(), None, "MORE.csv")) == ["OLD.csv", "MORE.csv"]


KEPT = {"keep_frame": True, "keep_tool": True}


@pytest.mark.parametrize(
    ("later", "words"),
    [
        ({**KEPT, "offset_deg": 2.0}, ["--offset-deg", "2.0", "--keep-frame", "--keep-tool"]),
        (KEPT, ["--keep-frame", "--keep-tool"]),
    ],
)
def test_updates_are_made_again_with_their_options_as_far_as_they_were_made_alike(
    later, words, measured, tmp_path, monkeypatch, capsys
):
    """What was kept tells the first joint: found anew it would be lost."""
    monkeypatch.chdir(tmp_path)
    once = updated(measured, tmp_path, moved=True, group="cell", **KEPT)
    arm = VirtualArm(once.robot, seed=1)
    table = remastered_table(arm, arm.poses(15, seed=5), [0.0, 0.6, 0.0, 0.0, 0.0], seed=5)
    table.assign(group="cell").to_csv("newer.csv", index=False)
    ta.update(once, ta.Measurements.read_csv("newer.csv"), **later).calibration.save("twice.calib")
    assert main(["plan", "--next", "4", "--from", "twice.calib", "-o", "more.csv"]) == 0
    told = capsys.readouterr().out
    alike = later == KEPT
    old, files = ("OLD2.calib", ["new.csv", "newer.csv"]) if alike else ("OLD.calib", ["newer.csv"])
    command = proposed(told, f"update {old}")
    assert command[3:] == [*files, "MEASUREMENTS.csv", *words, "-o", "NEW.calib"]
    assert ("updated from with other options" in " ".join(told.split())) != alike
    found = re.search(r"workspace: ([\d.]+) mm now, ([\d.]+) mm when", " ".join(told.split()))
    assert found is not None
    assert float(found[2]) < float(found[1])
    assert told.count("truearm update --roll-back") == len(files)


def test_proposals_that_make_nothing_surer_are_no_proposals(measured, tmp_path, monkeypatch, capsys):
    """A file of an earlier version does not tell that frame and tool were kept."""
    monkeypatch.chdir(tmp_path)
    known = updated(measured, tmp_path, moved=True, group="cell", **KEPT)
    report = {name: told for name, told in known.revision.report.items() if name != "options"}
    replace(known, revision=replace(known.revision, report=report)).save("old.calib")
    assert main(["plan", "--next", "1", "--from", "old.calib", "-o", "more.csv"]) == 0
    told = capsys.readouterr().out
    assert "no less uncertain than old.calib is" in " ".join(told.split())
    assert "truearm update" not in told


def test_in_the_world_commands_are_of_one_set_up(measured, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arm = VirtualArm(measured[0], seed=1)
    arm.world_from_base = np.eye(4)
    arm.measure_table(arm.poses(40)).to_csv("old.csv", index=False)
    later = arm.measure_table(arm.poses(15, seed=9), seed=9)
    later.to_csv("new.csv", index=False)
    before = ta.calibrate(arm.robot, ta.Measurements.read_csv("old.csv"), model="constant", frame="world")
    found = ta.update(before, ta.Measurements.read_csv("new.csv"), keep_tool=True)
    found.calibration.save("new.calib")
    assert main(["plan", "--next", "3", "--from", "new.calib", "-o", "more.csv"]) == 0
    told = capsys.readouterr().out
    assert 'these are of "old" and "new"' in " ".join(told.split())
    assert "when these are measured too" in " ".join(told.split())
    later.assign(group="new").iloc[::-1].to_csv("MEASUREMENTS.csv", index=False)
    for words in (proposed(told, "update --roll-back"), proposed(told, "update OLD.calib")):
        assert main(words[1:]) == 0
    assert "calibrate rv-m2 MEASUREMENTS.csv" in told


@pytest.mark.parametrize(("times", "planned"), [(1, 60), (2, 80), (9, 200)])
def test_as_many_poses_are_planned_anew_as_an_arm_was_calibrated_from(times, planned, measured, tmp_path):
    robot, old, later, _ = measured
    old.to_csv(tmp_path / "old.csv", index=False)
    made = ta.calibrate(robot, ta.Measurements.read_csv(tmp_path / "old.csv"), model="constant")
    assert made.rows is not None
    rows = made.rows.data.select(np.arange(40 * times) % 40)
    shifted = replace(rows, readings=rows.readings + np.arange(40 * times)[:, None])
    known = replace(made, rows=replace(made.rows, data=shifted))
    assert plan_anew(known) == f"truearm plan rv-m2 -n {planned} -o poses.csv"
    anew = calibrate_anew(ta.update(made, ta.Measurements.from_dataframe(later)).calibration)
    assert anew.command == "truearm calibrate rv-m2 MEASUREMENTS.csv --model constant -o result"


def test_options_that_the_command_lacks_are_named(measured):
    robot, old, _, _ = measured
    made = ta.calibrate(robot, ta.Measurements.from_dataframe(old), model="constant", prior_mm=3.0, rate=0.25)
    again = calibrate_again(made, "rv-m2", "MORE.csv")
    assert again.notes == (
        'The rows of "data" came from no file: write them to "data.csv" first.',
        "The command has no option for prior_mm=3.0, rate=0.25: calibrate from Python to keep that.",
    )
    assert files_of(again) == ["data.csv", "MORE.csv"]
    assert "prior" not in again.command


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"holdout": 0.3},
        {"holdout_range": "q2:high:0.25", "train_size": 20},
        {"model": "fcmac", "scheme_joints": (2, 3), "most_regions": 20, "composition": "product"},
        {"features": ("a", "b"), "split_by": ("group",), "refit": False, "drift": "none", "use": "position"},
    ],
)
def test_options_that_are_named_again_calibrate_alike(given, monkeypatch):
    options, made = CalibrationOptions.of(**given), []

    def calibrated(_arm, _data, chosen, _threads):
        made.append(chosen)
        raise ta.WorkError("enough")

    monkeypatch.setattr(calibrate, "_calibrated", calibrated)
    monkeypatch.setattr(ta.Measurements, "read_files", lambda *_, **__: None)
    assert main(["calibrate", "rv-m2", "m.csv", "-o", "never", *option_words(options)]) == 1
    assert made == [options]


@pytest.mark.parametrize(("name", "word"), [("abb-irb-120", "abb-irb-120"), ("my arm.toml", "ROBOT")])
def test_a_session_s_arm_is_called_as_the_library_knows_it(name, word, folder, monkeypatch, capsys):
    class Session:
        def __init__(self, path, *, writing):
            assert not writing

        def __enter__(self):
            robot = ta.Robot.load(name).to_dict()
            return SimpleNamespace(arm=robot, meta=lambda key: None, rows=lambda *_: [], notices=[])

        def __exit__(self, *_):
            return None

    monkeypatch.setattr("truearm.cell.session.Session", Session)
    monkeypatch.setattr(
        "truearm.cell.accepted.accepted_table",
        lambda _: pd.DataFrame({"step": [1], "pose": [1], "q1": [0.0]}),
    )
    session_export.command(Path("session.db"))
    assert proposed(capsys.readouterr().out, "calibrate")[2] == word


@pytest.mark.parametrize(("decimal", "mark"), [(",", ","), (".", ".")])
def test_a_table_with_other_marks_comes_in_as_proposed(decimal, mark, folder, tmp_path, capsys):
    (tmp_path / "raw files").mkdir()
    table = pd.read_csv("my data.csv").rename(columns={f"q{j}": f"q{j}_rad" for j in range(1, 6)})
    table.to_csv("raw files/a.csv", sep=";", decimal=decimal, index=False)
    assert main(["calibrate", "my arm.toml", "raw files/a.csv", "-o", "out"]) == 1
    words = shlex.split(capsys.readouterr().err.split("Convert it with: ")[1].rstrip(".\n"))
    assert words[-2:] == ["--decimal", mark] or decimal == "."
    assert main([*words[1:], "--joint-unit", "rad", "--length-unit", "m"]) == 0
    assert len(ta.Measurements.read_csv("measurements.csv")) == 40
