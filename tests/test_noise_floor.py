"""What is said of noise: beyond the sigma that rows state, with it, and what mean error it alone leaves."""

import json
from pathlib import Path

import numpy as np
import pytest

import truearm as ta
from tests.report_support import words_of
from truearm.cli import main
from truearm.reporting.report import report
from truearm.simulation import Imperfections, VirtualArm

STATED_MM = 0.05


@pytest.fixture
def said(tmp_path, monkeypatch, capsys):
    """What `truearm calibrate` prints of rows with the noise that they state, or that state none."""

    def calibrated(*, stated):
        monkeypatch.chdir(tmp_path)
        arm = VirtualArm.paper(seed=2, imperfections=Imperfections(share=0.0, noise_mm=STATED_MM))
        table = arm.measure_table(arm.poses(100)).drop(columns="sigma_mm", errors="ignore")
        (table.assign(sigma_mm=STATED_MM) if stated else table).to_csv("m.csv", index=False)
        assert main(["calibrate", "rv-m2", "m.csv", "--model", "constant", "-o", "out"]) == 0
        return " ".join(capsys.readouterr().out.split())

    return calibrated


@pytest.mark.parametrize("stated", [True, False])
def test_what_is_not_explained_is_beyond_a_stated_sigma_and_the_floor_holds_both(said, stated):
    printed = said(stated=stated)
    summary = json.loads(Path("out/summary.json").read_text())
    noise, floor = summary["noise_mm"], summary["noise_floor_mm"]
    whole = float(np.hypot(noise, STATED_MM)) if stated else noise
    assert floor == pytest.approx(np.sqrt(8.0 / np.pi) * whole)
    assert floor == pytest.approx(np.sqrt(8.0 / np.pi) * STATED_MM, rel=0.3)
    assert (
        f"does not explain{', beyond the stated sigma' * stated}: {noise:.3f} mm per coordinate." in printed
    )
    it = "With that sigma it" if stated else "It"
    assert f"coordinate. {it} makes a mean error of {floor:.3f} mm: noise and, with constants" in printed
    assert "noise alone" not in printed
    text = words_of(report(ta.Calibration.load("out/calibration.calib")).html)
    related = f"mm per coordinate beyond what rows state as their sigma, {whole:.3f} mm with it; alone"
    assert (related in text) == stated


@pytest.mark.parametrize("with_column", [True, False])
def test_what_is_taken_for_noise_is_not_told_as_its_floor(tmp_path, monkeypatch, capsys, with_column):
    """Joint 2 turns as the arm warms up: without a column of its temperature it does so with the time."""
    monkeypatch.chdir(tmp_path)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4, imperfections=Imperfections(share=0.0, noise_mm=0.02))
    readings, warmth = arm.poses(90), np.linspace(0.0, 1.0, 90)
    if with_column:
        warmth = np.random.default_rng(2).permutation(warmth)
    table = arm.measure_table(readings + 5e-4 * np.outer(warmth, np.eye(6)[1]))
    table[[f"q{joint}" for joint in range(1, 7)]] = readings
    (table.assign(temperature_c=20.0 + 10.0 * warmth) if with_column else table).to_csv("m.csv", index=False)
    assert main(["calibrate", "ur10", "m.csv", "--no-refit", "-o", "out"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "noise, and what is taken for it, as a warning says." in printed
    made = report(ta.Calibration.load("out/calibration.calib"))
    kinds = {advice.kind for advice in made.advice}
    assert ("unused_column" if with_column else "joints_moved") in kinds
    assert not {"noise_floor", "more_poses"} & kinds
    text = words_of(made.html)
    assert "mean error of what the model does not explain" in text
    assert "noise alone would leave" not in text


def test_a_sigma_that_is_stated_too_large_is_no_noise(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3, imperfections=Imperfections(share=0.0, noise_mm=0.05))
    table = arm.measure_table(arm.poses(80)).assign(sigma_mm=1.5)
    table.to_csv("m.csv", index=False)
    assert main(["calibrate", "ur10", "m.csv", "--no-refit", "-o", "out"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "noise, and what is taken for it, as a warning says." in printed
    found = ta.Calibration.load("out/calibration.calib")
    assert "stated_too_large" in {notice.kind for notice in found.notices}
    assert "noise alone would leave" not in words_of(report(found).html)


@pytest.mark.parametrize(
    ("robot", "poses", "unsure"),
    [("rv-m2", 60, True), ("ur10", 110, True), ("ur10", 300, False), ("kuka-iiwa-7", 90, True)],
)
def test_poses_that_hardly_tell_noise_are_said_to_be_few(robot, poses, unsure):
    true_mm = 0.04
    arm = VirtualArm(ta.Robot.load(robot), seed=1, imperfections=Imperfections(share=0.3, noise_mm=true_mm))
    found = ta.calibrate(arm.robot, arm.measure(arm.poses(poses, seed=1), seed=1), refit=False)
    assert (found.summary["noise_mm"] < 0.6 * true_mm) == unsure
    told = {advice.kind: advice.words for advice in report(found).advice}["more_poses"]
    assert (", though so few poses hardly tell noise from what the model misses." in told) == unsure
