"""Joints that stood still in all measured poses are told, wherever the calibration is used."""

import json

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from tests.report_support import words_of
from truearm.cell.proposed import ProposalOptions, kept_still, propose_acceptance
from truearm.cli import main
from truearm.fits.stillness import moved_joints, still_joints, still_warning, still_words
from truearm.reporting.advice import advise
from truearm.reporting.facts import Facts
from truearm.rotations import matrix_from_quaternion
from truearm.simulation import VirtualArm

KINDS = ("revolute", "prismatic", "revolute")


def test_a_joint_within_what_controllers_differ_by_stands_still():
    readings = np.array([[0.5, 0.1, 0.0], [0.503, 0.1002, 0.2], [0.5, 0.1004, -0.2]])
    still = still_joints(readings, KINDS)
    assert list(still) == [1, 2]
    assert still_words(still, KINDS) == "joint 1 at 28.65 deg, joint 2 at 100.2 mm"
    readings[1, 0] = 0.52
    assert list(still_joints(readings, KINDS)) == [2]


def test_only_joints_that_move_from_where_they_stood_count():
    known = np.array([[0.5, 0.1, 0.0], [0.5, 0.1, 0.2]])
    there = np.array([[0.5, 0.2, 1.0], [np.nan, np.nan, np.nan]])
    assert moved_joints(known, there, KINDS) == {2: pytest.approx(100.0)}
    assert moved_joints(known, known, KINDS) == {}


@pytest.fixture(scope="module")
def locked():
    """A UR10 whose sixth joint stood still while it was measured."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4)
    poses = arm.poses(60)
    poses[:, 5] = 0.25
    return ta.calibrate(arm.robot, arm.measure(poses), model="constant")


def test_a_calibration_says_which_joint_stood_still(locked):
    told = [str(notice) for notice in locked.notices if notice.kind == "stood_still"]
    assert len(told) == 1
    assert "joint 6 at 14.32 deg" in told[0]
    assert "Measure poses in which it moves" in told[0]
    first = advise(Facts(locked), None)[0]
    assert first.kind == "joint_stood_still"
    assert "joint 6" in first.words


def test_a_program_that_moves_it_is_warned_of(locked, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    locked.save(tmp_path / "arm.calib")
    q = np.tile([0.1, -1.2, 1.3, -0.5, 0.9, 0.25], (4, 1))
    for name, by in (("still", 0.0), ("moves", 0.3)):
        q[1:, 5] = 0.25 + by
        np.savetxt(
            f"{name}.csv", q, delimiter=",", header="q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad", comments=""
        )
        words = ["compensate", "arm.calib", f"{name}.csv", "--controller", "nominal", "--dry-run"]
        main([*words, "--largest-mm", "50", "--largest-std-mm", "50"])
        told = " ".join(capsys.readouterr().err.split())
        assert ("measured with joint 6 at 14.32 deg alone" in told) == (by > 0.0)
        assert ("corrections move joint 6 by up to" in told) == (by == 0.0)
    main([*words[:2], "still.csv", *words[3:], "--moving", "1,2,3,4,5"])
    assert "move joint 6" not in " ".join(capsys.readouterr().err.split())


def test_one_held_out_row_is_enough_for_a_report(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4)
    arm.measure_table(arm.poses(20)).to_csv("arm.csv", index=False)
    assert main(["calibrate", "ur10", "arm.csv", "-o", "out", "--holdout", "0.05"]) == 0
    page = words_of((tmp_path / "out" / "report.html").read_text(encoding="utf-8"))
    assert "held-out poses have a smaller error" not in page
    assert "% of the held-out coordinates" not in page


def test_readings_that_jitter_where_a_slide_stands_still_are_no_input():
    robot = ta.Robot.load("adept-cobra-600")
    arm, options = VirtualArm(robot, seed=0), ta.CalibrationOptions(refit=False)
    q, elsewhere = arm.poses(25, seed=1), arm.poses(40, seed=7)
    elsewhere[:, 2] = 0.1
    jitter = 2e-6 * np.random.default_rng(3).normal(size=25)

    def uncertain_mm(readings):
        q[:, 2] = readings
        calibration = ta.calibrate(robot, arm.measure(q, seed=1), options)
        return 1e3 * np.linalg.norm(calibration.position_std(elsewhere), axis=1).mean()

    assert uncertain_mm(0.05 + jitter) == pytest.approx(uncertain_mm(0.05), rel=0.2)


def test_joints_that_stood_still_are_several():
    readings = np.column_stack([np.linspace(0.0, 1.0, 5), np.zeros(5), np.ones(5)])
    told = still_warning(readings, ("revolute",) * 3)
    assert "What they change looks like" in told
    assert "poses in which they move" in told


def test_an_outlier_at_the_second_target_is_told_with_its_distance():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4)
    q = arm.poses(50)
    first, second = (arm.measure(q, seed=seed, orientation=True) for seed in (0, 1))
    assert second.orientations is not None
    turned = matrix_from_quaternion(second.orientations) @ np.array([0.1, 0.0, 0.05])
    beside = second.targets[:, 0] + turned
    beside[7, 0] += 0.008
    columns = [*(f"q{k}" for k in range(1, 7)), "x", "y", "z", "x2", "y2", "z2"]
    table = pd.DataFrame(np.hstack([q, first.targets[:, 0], beside]), columns=columns)
    data = ta.Measurements.from_dataframe(table, length_unit="m", angle_unit="rad")
    rows = ta.calibrate(arm.robot, data, use="targets").rows
    assert rows is not None
    (outlier,) = rows.outliers()
    assert outlier["row"] == data.rows[7]
    assert outlier["distance_mm"] == pytest.approx(8.0, abs=1.0)


def test_proposed_poses_keep_a_joint_where_it_stood(locked):
    options = ProposalOptions(4, seed=1)
    assert kept_still(locked) == {6: pytest.approx(np.degrees(0.25))}
    proposed = propose_acceptance(locked, options)
    assert proposed.poses.readings[:, 5] == pytest.approx(0.25)
    assert np.ptp(proposed.poses.readings[:, 0]) > 0.1


def test_a_plan_says_which_joints_it_keeps(locked, tmp_path, capsys):
    locked.save(tmp_path / "arm.calib")
    words = [
        "plan",
        "--acceptance",
        "4",
        "--from",
        str(tmp_path / "arm.calib"),
        "-o",
        str(tmp_path / "p.csv"),
    ]
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["kept"] == {"6": pytest.approx(np.degrees(0.25))}
    assert main(words) == 0
    assert "Kept: joint 6 at 14.32 deg" in " ".join(capsys.readouterr().out.split())
