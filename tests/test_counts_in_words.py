"""One row is "1 row", wherever rows, poses and points are counted for people."""

import re
from pathlib import Path

import pytest

import truearm as ta
from truearm.cli import main
from truearm.errors import count_of
from truearm.simulation import VirtualArm


@pytest.mark.parametrize(("count", "words"), [(0, "0 rows"), (1, "1 row"), (2, "2 rows")])
def test_counts_agree_with_their_nouns(count, words):
    assert count_of(count, "row") == words


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arm = VirtualArm(ta.Robot.load("rv-m2"), seed=1)
    for count in (1, 30):
        arm.measure_table(arm.poses(count)).to_csv(f"m{count}.csv", index=False)
    ta.calibrate(arm.robot, ta.Measurements.read_csv("m30.csv"), model="constant").save("arm.calib")


@pytest.mark.parametrize(
    "words",
    [
        ["calibrate", "rv-m2", "m1.csv", "-o", "out"],
        ["calibrate", "rv-m2", "m30.csv", "-o", "out", "--judge-target", "2"],
        ["evaluate", "arm.calib", "m1.csv"],
        ["evaluate", "arm.calib", "m30.csv", "--frame-rows", "1"],
        ["update", "arm.calib", "m1.csv"],
        ["import", "m1.csv", "-o", "i.csv", "--joint-unit", "rad", "--length-unit", "m"],
        ["plan", "--next", "1", "--from", "arm.calib", "-o", "p.csv"],
        ["frame", "arm.calib", "m1.csv", "--object", "table", "-o", "f.toml"],
    ],
    ids=lambda words: " ".join(words[:3]),
)
def test_one_of_a_thing_is_told_in_the_singular(words, folder, capsys):
    main(words)
    told = capsys.readouterr()
    assert re.search(r"\b1 (\w+ )?(row|pose|target|point)\b", told.out + told.err)
    assert not re.search(r"\b1 (\w+ )?(rows|poses|targets|points|others)\b", told.out + told.err)
    assert not Path("out").exists()
