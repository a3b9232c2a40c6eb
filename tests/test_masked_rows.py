"""Rows that are far off are named where they bend constants so far that nothing is far off from these."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from truearm.cli import main
from truearm.simulation import Imperfections, VirtualArm

ROBOT = ta.Robot.load("kuka-kr-6-r900")
VARYING = Imperfections(non_geometric="joint", noise_mm=0.02)
OFF = [4, 11, 23]


def measured(poses, off, length_m, seed=4):
    """Points of an arm on which parameters vary, some of them off by so much in some direction."""
    arm = VirtualArm(ROBOT, seed=seed, imperfections=VARYING)
    table = arm.measure_table(arm.poses(poses))
    directions = np.random.default_rng(seed).normal(size=(len(off), 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    table.loc[off, ["x", "y", "z"]] += length_m * directions
    return table


def calibrated(table, **options):
    return ta.calibrate(ROBOT, ta.Measurements.from_dataframe(table), model="constant", threads=1, **options)


def named(found):
    return {entry["row"] - 1: entry["distance_mm"] for entry in found.rows.outliers()}


@pytest.mark.parametrize("robust", ["none", "huber"])
def test_rows_that_constants_follow_are_named(robust):
    found = calibrated(measured(40, OFF, 5e-3), robust=robust)
    assert sorted(named(found)) == OFF
    assert np.allclose(list(named(found).values()), 5.0, atol=1.0)


def test_what_a_robust_loss_would_leave_is_told():
    table = measured(40, OFF, 5e-3)
    found = calibrated(table)
    (told,) = (notice for notice in found.notices if notice.kind == "bent")
    apart = calibrated(table, robust="cauchy")
    assert sorted(told.rows) == [row + 1 for row in OFF]
    left, lower = (each.constant.noise_m * 1e3 for each in (found, apart))
    assert lower < 0.5 * left
    assert f"{left:.3f} mm per coordinate, and with --robust cauchy {lower:.4f} mm" in told.message
    assert "bent" not in {notice.kind for notice in apart.notices}


def test_noise_is_not_all_that_outliers_leave(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    measured(40, OFF, 5e-3).to_csv("m.csv", index=False)
    assert main(["calibrate", "kuka-kr-6-r900", "m.csv", "--model", "constant", "-o", "out"]) == 0
    words = " ".join(capsys.readouterr().out.split())
    assert "noise, the outliers and, with constants alone, what varies" in words


@pytest.mark.parametrize("poses", [30, 40, 100])
def test_rows_of_arms_that_err_by_what_varies_are_none(poses):
    for seed in range(6):
        found = calibrated(measured(poses, [], 0.0, seed))
        assert not named(found)
        assert "bent" not in {notice.kind for notice in found.notices}


def test_rows_that_are_turned_are_named():
    arm = VirtualArm(ROBOT, seed=4, imperfections=VARYING)
    data = arm.measure(arm.poses(40), orientation=True)
    assert data.orientations is not None
    turned = data.orientations.copy()
    turned[OFF] += [0.0, 5e-3, 0.0, 0.0]
    found = ta.calibrate(ROBOT, replace(data, orientations=turned), model="constant", threads=1)
    assert sorted(named(found)) == OFF


def test_a_set_up_that_is_off_as_a_whole_is_judged_with_the_others():
    few = list(range(7, 17))
    table = measured(70, [], 0.0).assign(group="a")
    table.loc[few, "group"] = "b"
    table.loc[few, "x"] += 0.05 * np.random.default_rng(1).normal(size=len(few))
    assert set(named(calibrated(table))) <= set(few)


def test_few_rows_that_hide_behind_what_varies_are_named():
    arm = VirtualArm(ROBOT, seed=3, imperfections=replace(VARYING, noise_mm=0.08))
    table = arm.measure_table(arm.poses(40))
    table.loc[OFF, ["x", "y", "z"]] += 1e-3 * np.eye(3)
    found = ta.calibrate(ROBOT, ta.Measurements.from_dataframe(table), threads=1)
    assert sorted(named(found)) == OFF
