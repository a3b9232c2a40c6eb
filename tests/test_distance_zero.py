"""The zero of a wire that nobody measured is told with its length; right distances are left alone."""

import re

import numpy as np
import pytest

import truearm as ta
from truearm.cli.calibrate import suggest_next
from truearm.doubts.of_results import helps
from truearm.simulation import VirtualArm

ANCHOR = np.array([0.9, -0.6, 0.2])


def wires(lengths_m, each=30, seed=3):
    """Distances to fixed points, in turn, that are so much longer than they are."""
    arm = VirtualArm(ta.Robot.load("ur5e"), seed=seed)
    table = arm.measure_table(arm.poses(each * len(lengths_m)))
    place = np.arange(len(table)) % len(lengths_m)
    anchors = ANCHOR * np.array([[1, 1, 1], [-1, 1, 2], [1, -1, 3]])[place]
    away = np.linalg.norm(table[["x", "y", "z"]] - table[["x", "y", "z"]].mean() - anchors, axis=1)
    joints = table[[f"q{k}" for k in range(1, 7)]]
    names = np.array(["a", "b", "c"])[place]
    return ta.Measurements.from_dataframe(
        joints.assign(anchor=names, distance=away + np.take(lengths_m, place))
    )


def lengths_told(data):
    """Anchors with the length that is told of them and its standard error, mm."""
    found = ta.calibrate(ta.Robot.load("ur5e"), data, model="constant")
    pattern = r"distances to (.*) seem to be ([\d.]+) mm too (long|short), give or take ([\d.]+) mm"
    told = [re.search(pattern, note.message) for note in found.notices if note.kind == "distance_zero"]
    return [(m[1], float(m[2]) * (1 if m[3] == "long" else -1), float(m[4])) for m in told if m]


def test_a_length_that_several_anchors_share_is_told_once_and_right():
    ((anchors, length, error),) = lengths_told(wires([-0.05] * 3))
    assert anchors == '"a", "b" and "c"'
    assert abs(length + 50.0) < 3.0 * error < 3.0


def test_lengths_that_differ_are_told_each_and_do_not_bend_one_another():
    told = lengths_told(wires([0.08, -0.05, 0.0]))
    assert [anchors for anchors, *_ in told] == ['"a"', '"b"']
    for (_, length, error), true in zip(told, (80.0, -50.0), strict=True):
        assert abs(length - true) < 3.0 * error < 6.0


def test_a_coarse_wire_that_says_so_hides_no_zero_of_a_fine_one():
    """Sixty poses, three wires at each: what the third misses is no doubt of the first."""
    arm, sigma_mm = VirtualArm(ta.Robot.load("ur5e"), seed=3), np.array([0.05, 0.05, 1.0])
    table = arm.measure_table(arm.poses(60))
    points = (table[["x", "y", "z"]] - table[["x", "y", "z"]].mean()).to_numpy()
    anchors = ANCHOR * np.array([[1, 1, 1], [-1, 1, 2], [1, -1, 3]])
    noise = sigma_mm * np.random.default_rng(1).normal(size=(60, 3))
    away = np.linalg.norm(points[:, None] - anchors, axis=2) + 1e-3 * (noise + np.eye(3)[0])
    rows = table[[f"q{k}" for k in range(1, 7)]].loc[np.repeat(np.arange(60), 3)]
    columns = {"anchor": np.tile(["a", "b", "c"], 60), "sigma_mm": np.tile(sigma_mm, 60)}
    data = ta.Measurements.from_dataframe(rows.assign(distance=away.ravel(), **columns))
    ((anchor, length, error),) = lengths_told(data)
    assert anchor == '"a"'
    assert abs(length - 1.0) < 3.0 * error < 0.6


def wire(length_m, count=80, seed=5):
    """Distances to one fixed point that are `length_m` longer than they are."""
    arm = VirtualArm(ta.Robot.load("ur5e"), seed=seed)
    table = arm.measure_table(arm.poses(count))
    away = np.linalg.norm(table[["x", "y", "z"]] - table[["x", "y", "z"]].mean() - ANCHOR, axis=1)
    joints = table[[f"q{k}" for k in range(1, 7)]]
    return ta.Measurements.from_dataframe(joints.assign(anchor="box", distance=away + length_m))


def told(data, kind):
    found = ta.calibrate(ta.Robot.load("ur5e"), data, model="constant")
    return next((notice.message for notice in found.notices if notice.kind == kind), "")


@pytest.mark.parametrize(
    ("length_m", "way_out"),
    [(0.15, r"Subtract 1[45]\d"), (-0.05, r"Add [45]\d"), (0.5, r"Subtract [45]\d\d")],
)
def test_a_wire_with_an_unknown_zero_is_told_with_the_length(length_m, way_out):
    words = told(wire(length_m), "distance_zero")
    assert 'distances to "box" seem to be' in words
    assert re.search(way_out, words), words


def test_right_distances_are_left_alone():
    assert not told(wire(0.0), "distance_zero")


def test_a_calibration_that_changes_next_to_nothing_does_not_help():
    assert not helps(6.376, 6.366)
    assert helps(6.376, 6.0)


def test_what_is_proposed_after_distances_takes_them(tmp_path, capsys):
    suggest_next(ta.calibrate(ta.Robot.load("ur5e"), wire(0.0), model="constant"), tmp_path / "arm.calib")
    said = capsys.readouterr().out + capsys.readouterr().err
    assert "truearm compensate" in said
    assert "truearm export" in said
    assert "evaluate" not in said
