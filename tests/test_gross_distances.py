"""Distances that are far off are named, though constants that keep them follow them."""

from typing import Any

import numpy as np
import pytest

import truearm as ta
from truearm.doubts.outliers import Outliers
from truearm.reporting.facts import Facts
from truearm.reporting.verdict import head
from truearm.simulation import Imperfections, VirtualArm

ARM = VirtualArm(ta.Robot.load("ur5e"), seed=4, imperfections=Imperfections(share=0.0, noise_mm=0.02))
POSES = 50
ANCHOR = np.array([1.3, -0.4, 0.5])
TRAINED, HELD = np.split(np.random.default_rng(7).permutation(POSES), [35])
"""Places of the rows that train and are held out."""


def measured(off_m, *, paired=False, poses=POSES):
    """Distances of poses to a fixed point, or of pairs of them, some longer than they are by row."""
    table = ARM.measure_table(ARM.poses(poses))
    points = table[["x", "y", "z"]].to_numpy()
    joints = table[[f"q{k}" for k in range(1, 7)]]
    where: dict[str, Any]
    if paired:
        away = np.linalg.norm(points[::2] - points[1::2], axis=1)
        where = {"pair": [f"p{k // 2}" for k in range(poses)]}
    else:
        away, where = np.linalg.norm(points - points.mean(axis=0) - ANCHOR, axis=1), {"anchor": "box"}
    for row, off in off_m.items():
        away[row] += off
    return ta.Measurements.from_dataframe(joints.assign(distance=np.repeat(away, 1 + paired), **where))


def calibrated(data, **options):
    return ta.calibrate(ARM.robot, data, model="constant", **options)


def named(found):
    """The rows that are outliers, and how far off the farthest is, mm."""
    outliers = found.rows.outliers()
    return {entry["row"] - 1 for entry in outliers}, max(entry["distance_mm"] for entry in outliers)


@pytest.mark.parametrize("robust", ["none", "huber", "cauchy"])
def test_distances_far_off_are_named_whatever_follows_them(robust):
    off = {int(TRAINED[3]): 0.05, int(HELD[2]): -0.008}
    rows, farthest_mm = named(calibrated(measured(off), robust=robust))
    assert rows == set(off)
    assert farthest_mm == pytest.approx(50.0, abs=0.3)


def test_a_calibration_that_one_distance_spoils_says_which():
    found = calibrated(measured({int(TRAINED[3]): 0.15}))
    (told,) = (notice.message for notice in found.notices if notice.kind == "no_help")
    assert f"and --robust cauchy gives hardly any weight: row {TRAINED[3] + 1} (1" in told


def test_errors_are_told_without_distances_that_are_far_off(tmp_path):
    found = calibrated(measured({int(HELD[2]): 0.05}), robust="cauchy")
    found.save(tmp_path / "arm.calib")
    again = ta.Calibration.load(tmp_path / "arm.calib")
    assert again.rows is not None
    assert again.rows.outliers() == found.rows.outliers()
    outliers = Outliers.of(again)
    assert outliers.judged.startswith(f"row {HELD[2] + 1} (49.9")
    assert outliers.means_mm["constant"] < 0.1 < found.validation.holdout["constant"].position.mean
    assert Facts(again).mean_mm() == pytest.approx(outliers.means_mm["constant"])
    said = head(Facts(again), []).verdict.partition("Without the outliers among them, ")[2]
    assert said.startswith(outliers.judged)
    assert f"they are {outliers.means_mm['constant']:.3f} mm" in said


def test_both_rows_of_a_pair_are_named():
    rows, _ = named(calibrated(measured({20: 0.02}, paired=True, poses=120)))
    assert rows == {40, 41}


@pytest.mark.parametrize("poses", [36, 44])
def test_of_distances_that_are_few_for_the_unknowns_none_is_named_that_is_right(poses):
    for seed in range(6):
        order = np.random.default_rng(seed).permutation(POSES)[:poses]
        found = calibrated(measured({}).select(order), robust="cauchy")
        assert found.rows.outliers() == []
