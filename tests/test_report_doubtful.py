"""The report of a calibration that is wrong, or whose errors are those of a few rows."""

import re

import numpy as np
import pytest

import truearm as ta
from tests.report_support import words_of
from truearm.exporting import export
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import short
from truearm.reporting.report import report
from truearm.rotations import matrix_from_quaternion, matrix_from_rotation_vector, quaternion_from_matrix
from truearm.simulation import VirtualArm
from truearm.tables.columns import QUATERNION


@pytest.fixture(scope="module")
def shifted(tmp_path_factory):
    """A calibration whose points belong to the readings of other rows, from its file."""
    arm = VirtualArm.paper(seed=4)
    table = arm.measure_table(arm.poses(60))
    points = [name for name in table.columns if name[0] in "xyz"]
    table[points] = np.roll(table[points].to_numpy(), 1, axis=0)
    path = tmp_path_factory.mktemp("shifted") / "arm.calib"
    ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table)).save(path)
    return ta.Calibration.load(path)


@pytest.fixture(scope="module")
def with_an_outlier():
    """A good calibration with one gross row among those that were held out, and the number of that row."""
    arm = VirtualArm.paper(seed=2)
    table = arm.measure_table(arm.poses(90))
    held = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant").held
    assert held is not None
    row = int(held.rows[3])
    table["x"] += np.where(table.index == row - 1, 0.02, 0.0)
    return ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table)), row


def test_where_nothing_fits_the_advice_is_what_to_check_and_nothing_else(shifted):
    made = report(shifted)
    assert "The calibration does not help" in made.verdict
    assert [advice.kind for advice in made.advice] == ["would_fit", "find_the_reason"]
    (shifting,) = (str(notice) for notice in shifted.notices if notice.kind == "rows_shifted")
    assert made.advice[0].words == shifting
    assert "row by row" in made.advice[1].words
    text = words_of(made.html)
    for of_no_meaning in ("noise alone would leave", "within their 95 % intervals", "Without the outliers"):
        assert of_no_meaning not in text


def test_a_stripped_calibration_that_does_not_help_says_what_to_check(shifted):
    kinds = [advice.kind for advice in report(shifted.without_rows()).advice]
    assert kinds == ["would_fit", "find_the_reason"]


def test_errors_without_held_out_outliers_stand_beside_those_with_them(with_an_outlier):
    calibration, row = with_an_outlier
    entry = next(entry for entry in calibration.summary["outliers"] if entry["row"] == row)
    means = calibration.held.means_without_mm([entry])
    made = report(calibration)
    mean = f"{means['variable']:.3f} mm"
    largest = f"{calibration.validation.holdout['variable'].position.max:.2f} mm"
    assert f"Without the outliers among them, row {row} ({largest})" in made.verdict
    assert entry["distance_mm"] != pytest.approx(calibration.validation.holdout["variable"].position.max)
    (advised,) = (advice.words for advice in made.advice if advice.kind == "outliers")
    worst = calibration.held.errors["variable"].distance_m.max()
    assert f"up to {short(1e3 * worst)[0]} mm off" in advised
    assert mean in made.verdict.partition("Without")[2]
    assert "mean error without the outliers among them; with the nominal model" in words_of(made.html)
    in_space = next(says for title, says in made.figures if title.startswith("Errors in space"))
    assert in_space.startswith("The mean error without the outliers is ")
    vectors = calibration.held.errors["variable"].position[calibration.held.without([entry])]
    assert f"error vectors is {1e3 * np.linalg.norm(vectors.mean(axis=0)):.3f} mm long" in in_space
    told = [advice.words for advice in made.advice if advice.kind in ("noise_floor", "more_poses")]
    assert told
    assert all(words.startswith(f"The mean error without the outliers is {mean}") for words in told)


def test_orientations_are_told_without_the_outlier_too():
    """One flange that was noted turned hides what a calibration gains."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    table = arm.measure_table(arm.poses(50), orientation=True)
    held = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant").held
    assert held is not None
    row = int(held.rows[2]) - 1
    turned = matrix_from_quaternion(table.loc[[row], [*QUATERNION]].to_numpy())
    turned = turned @ matrix_from_rotation_vector(np.array([0.0, 0.0, 0.1]))
    table.loc[row, [*QUATERNION]] = quaternion_from_matrix(turned)[0]
    found = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")
    turns = Facts(found).outliers.means_mrad
    mean, former = short(turns["constant"], turns["nominal"])
    with_it = found.validation.holdout["constant"].orientation
    assert with_it is not None
    assert turns["constant"] < 0.3 * with_it.mean
    made = report(found)
    assert f"orientation error without them is {mean} mrad, with the nominal model {former}" in made.verdict
    assert "mean orientation error without the outliers among them" in words_of(made.html)
    says = next(says for title, says in made.figures if "orientation errors" in title)
    assert found.held is not None
    kept = found.held.without(found.summary["outliers"])
    turn = 1e3 * found.held.errors["constant"].turn_rad[kept]
    (bound,) = re.findall(r"without the outliers below .* and (\S+) mrad \(constant\)", says)
    assert float(bound) == pytest.approx(np.quantile(turn, 0.95), rel=0.05)


def test_an_export_says_what_it_loses_without_the_outliers_too(with_an_outlier):
    calibration, row = with_an_outlier
    note = export(calibration, "dh-csv").notes[0]
    means = calibration.held.means_without_mm(calibration.summary["outliers"])
    without = note.partition("without the outliers among them, ")[2]
    assert without.startswith(f"row {row} (")
    assert f"{means['constant']:.3f} and {means['variable']:.3f} mm" in without


def test_without_outliers_nothing_is_said_of_them():
    arm = VirtualArm.paper(seed=2)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), refit=False)
    assert calibration.summary["outliers"] == []
    assert "outliers" not in report(calibration).verdict + export(calibration, "dh-csv").notes[0]
