"""Distances: what a file keeps of them, and what they count for beside points."""

import copy
import re

import numpy as np
import pytest

import truearm as ta
from tests.calibration_file_support import read_calibration_file, write_calibration_file
from truearm.cli import main
from truearm.doubts.points_together import points_together
from truearm.reporting.report import report
from truearm.simulation import VirtualArm
from truearm.storage.calibration_file import NO_DIGEST

IRB = ta.Robot.load("abb-irb-120")
PAIRS = 100


@pytest.fixture(scope="module")
def pairs():
    """A table of distances between two poses each, the second half of the rows the others' partners."""
    arm = VirtualArm(IRB, seed=3)
    table = arm.measure_table(arm.poses(2 * PAIRS))
    points = table[["x", "y", "z"]].to_numpy()
    apart = np.linalg.norm(points[:PAIRS] - points[PAIRS:], axis=1)
    names = [f"p{k % PAIRS}" for k in range(2 * PAIRS)]
    return table[[f"q{k}" for k in range(1, 7)]].assign(distance=np.tile(apart, 2), pair=names)


@pytest.fixture(scope="module")
def from_pairs(pairs):
    return ta.calibrate(IRB, ta.Measurements.from_dataframe(pairs), model="constant")


def rows_of(calibration):
    """The rows of a calibration that has them."""
    assert calibration.rows is not None
    return calibration.rows


def test_a_calibration_from_pairs_comes_back(from_pairs, tmp_path):
    from_pairs.save(tmp_path / "arm.calib")
    for again in (ta.Calibration.load(tmp_path / "arm.calib"), copy.deepcopy(from_pairs)):
        assert np.array_equal(rows_of(again).residual, rows_of(from_pairs).residual)
        assert rows_of(again).residual.shape == (PAIRS, 1)
        assert np.array_equal(rows_of(again).distance_m, rows_of(from_pairs).distance_m)
        assert again.validation == from_pairs.validation
        assert again.to_bytes() == from_pairs.to_bytes()


def test_distances_of_pairs_are_counted_and_those_of_files_that_do_not_say_are_counted_by_rows(
    from_pairs, tmp_path
):
    path, judged = tmp_path / "arm.calib", from_pairs.validation
    assert (judged.n_holdout_distances, judged.poses_judged) == (26, "26 held-out distances")
    assert "held-out distances" in repr(judged)
    assert judged.n_holdout_poses == 2 * 26
    assert judged.few == "The errors above come from 26 held-out distances: another split would give others."
    for calibration, told in (
        (from_pairs, "26 held-out distances"),
        (from_pairs.without_rows(), "52 held-out poses"),
    ):
        calibration.save(path)
        arrays, content = read_calibration_file(path)
        del content["validation"]["n_holdout_distances"]
        content["sha256"] = NO_DIGEST
        write_calibration_file(path, arrays, content)
        assert ta.Calibration.load(path).validation.poses_judged.startswith(told)


def test_a_file_with_a_distance_of_a_point_for_each_pair_is_read(from_pairs, tmp_path):
    path = tmp_path / "arm.calib"
    from_pairs.save(path)
    arrays, content = read_calibration_file(path)
    content["sha256"] = NO_DIGEST
    write_calibration_file(path, arrays | {"outcome.distance_m": np.zeros(PAIRS)}, content)
    assert np.array_equal(rows_of(ta.Calibration.load(path)).distance_m, np.zeros(2 * PAIRS))
    write_calibration_file(path, arrays | {"outcome.residual": np.zeros((PAIRS + 1, 1))}, content)
    with pytest.raises(ta.InputError, match=re.escape(f"It must be ({PAIRS}, 1)")):
        ta.Calibration.load(path)


def test_distances_of_pairs_are_counted_once(pairs, tmp_path, capsys):
    pairs.to_csv(tmp_path / "pairs.csv", index=False)
    words = ["calibrate", "abb-irb-120", str(tmp_path / "pairs.csv"), "-o", str(tmp_path / "out")]
    assert main([*words, "--model", "constant"]) == 0
    told = re.search(r"Distance error, mm, (\d+) held-out distances", capsys.readouterr().out)
    held = ta.Calibration.load(tmp_path / "out" / "calibration.calib").held
    assert held is not None
    assert told is not None
    assert 2 * int(told[1]) == len(held)


def test_distances_beside_points_change_nothing_and_are_told():
    arm = VirtualArm(IRB, seed=3)
    table = arm.measure_table(np.repeat(arm.poses(40), 2, axis=0))
    second = np.arange(80) % 2 == 1
    for axis in "xyz":
        table[f"{axis}2"] = np.where(second, table[axis] + 0.1, np.nan)
        table[axis] = np.where(second, np.nan, table[axis])
    made = {}
    for name, more in (
        ("without", {}),
        ("empty", {"distance": np.nan}),
        (
            "full",
            {"distance": np.tile(np.linspace(0.8, 1.2, 40), 2), "pair": [f"p{k % 40}" for k in range(80)]},
        ),
    ):
        data = ta.Measurements.from_dataframe(table.assign(**more))
        made[name] = points_together(data)[0], [notice.kind for notice in data.notices]
    assert [len(data) for data, _ in made.values()] == [40, 40, 40]
    assert made["empty"][0].hash() == made["without"][0].hash()
    assert [told for _, told in made.values()] == [[], [], ["distances_left_out"]]


def test_what_moves_the_whole_arm_is_no_matter_of_poses_to_pairs(from_pairs):
    """theta1 and d1 change no distance between two points of the arm, whatever the poses."""
    told = dict(zip(from_pairs.identifiability.undetermined, from_pairs.identifiability.words, strict=True))
    for name in ("theta1", "d1"):
        assert told[name] == f"{name} cannot be distinguished from the place of the base."
    assert "unseen_parameters" not in [advice.kind for advice in report(from_pairs).advice]


def test_pairs_of_poses_that_hardly_differ_ask_for_larger_motions(pairs):
    """A joint that stands still is told from nothing else, and that poses would cure."""
    arm = VirtualArm(IRB, seed=3)
    q = arm.poses(2 * PAIRS)
    q[:, 3] = 0.4
    points = arm.measure_table(q)[["x", "y", "z"]].to_numpy()
    apart = np.tile(np.linalg.norm(points[:PAIRS] - points[PAIRS:], axis=1), 2)
    still = pairs.assign(distance=apart, **{f"q{k + 1}": q[:, k] for k in range(6)})
    found = ta.calibrate(IRB, ta.Measurements.from_dataframe(still), model="constant", refit=False)
    (told,) = [each.words for each in report(found).advice if each.kind == "unseen_parameters"]
    assert "theta1" not in told
    assert "theta6" not in told
