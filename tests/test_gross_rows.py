"""Rows of an evaluation that are off: which are named, and that ordinary ones are not."""

import numpy as np
import pytest

import truearm as ta
from truearm.cli import main
from truearm.defaults import SEED
from truearm.frame_share import FRAME_UNCERTAIN
from truearm.rotations import matrix_from_quaternion, quaternion_from_rotation_vector
from truearm.simulation import VirtualArm
from truearm.updating import comparing
from truearm.updating.scene import Scene

COUNT = 90
ORDER = np.random.default_rng(SEED).permutation(COUNT)
XYZ = ["x", "y", "z"]


def elsewhere(arm):
    """The same arm seen by an instrument that stands elsewhere, with the target remounted."""
    other = VirtualArm.paper(seed=arm.seed)
    other.world_from_base = arm.world_from_base.copy()
    turn = matrix_from_quaternion(quaternion_from_rotation_vector([[0.4, -0.2, 1.0]]))[0]
    other.world_from_base[:3, :3] = turn @ arm.world_from_base[:3, :3]
    other.target_in_flange = arm.target_in_flange + np.array([0.03, 0.0, 0.02])
    return other


@pytest.fixture(scope="module")
def known():
    arm = VirtualArm.paper(seed=2)
    return elsewhere(arm), ta.calibrate(arm.robot, arm.measure(arm.poses(150)))


@pytest.fixture(scope="module")
def clean(known):
    other, _ = known
    return other.measure_table(other.poses(COUNT, seed=3), seed=3)


def shifted(table, *shifts):
    """A copy of a table with coordinates moved: row from 0, column, mm."""
    copy = table.copy()
    for row, column, off_mm in shifts:
        copy.loc[row, column] += 1e-3 * off_mm
    return copy


def told(calibration, table, **options):
    """The evaluation of a table."""
    return ta.evaluate(calibration, ta.Measurements.from_dataframe(table), **options)


@pytest.mark.parametrize("off_mm", [1.0, 2.0, 4.0, 8.0])
@pytest.mark.parametrize("frame_rows", [10, 30])
def test_a_frame_row_that_is_off_by_a_millimetre_is_named(known, clean, off_mm, frame_rows):
    table = shifted(clean, (ORDER[2], "y", off_mm))
    (notice,) = told(known[1], table, frame_rows=frame_rows).notices
    assert (notice.kind, notice.rows) == ("far_rows", (ORDER[2] + 1,))
    said = float(notice.message.split(f"row {ORDER[2] + 1} (")[1].split(" mm)")[0])
    assert abs(said - off_mm) < 0.3
    for words in ("9 times the median", "8 times what the calibration expects", "Take them out"):
        assert words in notice.message


def test_a_frame_row_is_named_where_the_tool_is_kept():
    arm = VirtualArm.paper(seed=4)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(80)), model="constant")
    table = arm.measure_table(arm.poses(COUNT, seed=3), seed=3)
    assert not told(calibration, table, frame_rows=8, keep_tool=True).notices
    table = shifted(table, (ORDER[2], "y", 4.0))
    (notice,) = told(calibration, table, frame_rows=8, keep_tool=True).notices
    assert (notice.kind, notice.rows) == ("far_rows", (ORDER[2] + 1,))
    assert "found frame some" in notice.message


def test_several_frame_rows_that_are_off_do_not_hide_each_other(known, clean):
    table = shifted(clean, (ORDER[2], "y", 2.0), (ORDER[5], "x", -2.0), (ORDER[7], "z", -3.0))
    (notice,) = told(known[1], table).notices
    assert set(notice.rows) == set(ORDER[[2, 5, 7]] + 1)


@pytest.mark.parametrize("options", [{}, {"frame_rows": 5}])
def test_gross_judged_rows_are_named_with_the_errors_without_them(known, clean, options):
    table = shifted(clean, (ORDER[60], "x", 12.0), (ORDER[61], "z", -25.0))
    before, found = told(known[1], clean, **options), told(known[1], table, **options)
    notice, *others = found.notices
    assert [other.kind for other in others] == [FRAME_UNCERTAIN] * bool(options)
    assert (notice.kind, notice.rows) == ("outliers", (ORDER[61] + 1, ORDER[60] + 1))
    assert found.errors["variable"].position.max > 24.0
    left_mm = float(notice.message.split("variable ")[1].split(" mm")[0])
    assert abs(left_mm - before.errors["variable"].position.mean) < 0.01
    assert found.errors["variable"].position.mean > left_mm + 0.3


def test_judged_rows_are_named_in_kept_frames_and_by_the_file():
    arm = VirtualArm.paper(seed=4)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(80)), model="constant")
    table = shifted(arm.measure_table(arm.poses(40, seed=3), seed=3), (6, "z", 12.0))
    parts = [
        ta.Measurements.from_dataframe(part, name=name)
        for name, part in (("a", table), ("b", arm.measure_table(arm.poses(40, seed=5), seed=5)))
    ]
    (notice,) = ta.evaluate(calibration, parts[0], keep_frames=True).notices
    assert (notice.kind, notice.rows) == ("outliers", (7,))
    (notice,) = ta.evaluate(calibration, parts).notices
    assert "row 7 of a (1" in notice.message


def test_a_file_without_rows_names_them_too(known, clean):
    table = shifted(clean, (ORDER[2], "y", 4.0), (ORDER[60], "x", 12.0))
    bare = known[1].without_rows()
    assert [notice.rows for notice in told(bare, table).notices] == [(ORDER[2] + 1,), (ORDER[60] + 1,)]


@pytest.fixture
def asked(monkeypatch):
    """States at which it was asked how an unchanged arm may scatter, other causes not counted."""
    states, covariance = [], Scene.covariance

    def counted(scene, state):
        states.append(state)
        return covariance(scene, state)

    monkeypatch.setattr(Scene, "covariance", counted)
    monkeypatch.setattr(comparing, "explained_otherwise", lambda *_: [])
    return states


@pytest.mark.parametrize("seed", range(6))
def test_ordinary_rows_of_a_worse_day_are_not_named(known, asked, seed):
    other, calibration = known
    rng, times = np.random.default_rng(seed), list[int]()
    table = other.measure_table(other.poses(150, seed=seed + 20), seed=seed + 20)
    for scatter in (rng.normal(size=(150, 3)), rng.laplace(size=(150, 3))):
        worse = table.copy()
        worse[XYZ] += 1e-4 * scatter
        for frame_rows in (6, 12, None):
            asked.clear()
            found = told(calibration, worse, frame_rows=frame_rows)
            assert found.errors["variable"].position.mean > 0.15
            assert not [notice for notice in found.notices if notice.rows]
            times.append(len(asked))
    # Rows that are unlike the others are taken out at once, not each with a covariance of its own.
    assert 1 <= max(times) <= 2


def test_outliers_are_told_on_standard_error_alone(known, clean, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shifted(clean, (ORDER[60], "x", 12.0)).to_csv("other.csv", index=False)
    known[1].save("arm.calib")
    assert main(["evaluate", "arm.calib", "other.csv", "--json"]) == 0
    printed = capsys.readouterr()
    assert f"row {ORDER[60] + 1} (1" in " ".join(printed.err.split())
    assert "max_mm" in printed.out
