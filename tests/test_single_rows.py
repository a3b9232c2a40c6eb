"""Single rows that are far off are named, and decide nothing that is said of all others."""

import re
from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.remastered import remastered_table
from truearm.doubts import as_calibrated
from truearm.fleet.attention import reasons
from truearm.fleet.fleet_file import LimitsSection
from truearm.fleet.rows import row_of_made
from truearm.fleet.task import ArmTask, calibrate_arm
from truearm.reporting.facts import Facts
from truearm.reporting.other_data import other_data
from truearm.reporting.repeats import repeats
from truearm.reporting.verdict import verdict
from truearm.rotations import matrix_from_quaternion, quaternion_from_rotation_vector
from truearm.simulation import Imperfections, VirtualArm

POSES = 60
TRAINED, HELD = np.split(np.random.default_rng(7).permutation(POSES), [42])
"""Places of the rows that train and are held out."""
CONSTANT = Imperfections(share=0.0, noise_mm=0.02)
EXACT = Imperfections(length_mm=0.0, angle_deg=0.0, share=0.0, noise_mm=0.02)
SHIFT_DEG = np.array([0.0, 0.15, 0.0, 0.1, 0.0])
STILL = np.zeros(5)
HUBER = {"model": "constant", "robust": "huber"}
QUATERNION = ["qw", "qx", "qy", "qz"]


def off(table, rows, shift_m):
    """The table with the points of some rows moved along all axes."""
    spoilt = table.copy()
    spoilt.loc[list(rows), ["x", "y", "z"]] += shift_m
    return spoilt


def told(found, kind):
    """The one notice of a kind; empty where there is none."""
    return next((str(notice) for notice in found.notices if notice.kind == kind), "")


def kinds(found):
    return [notice.kind for notice in found.notices]


def calibrated(arm, table, **options):
    return ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), **options)


@pytest.fixture(scope="module")
def spoilt():
    """An arm of which constants are all there is, and its calibration with gross rows on both sides."""
    arm = VirtualArm.paper(seed=2, imperfections=CONSTANT)
    table = off(arm.measure_table(arm.poses(POSES)), [TRAINED[3], HELD[5]], 0.03)
    return arm, calibrated(arm, table, **HUBER)


def later(arm, shift_deg, *, elsewhere=False):
    """What the arm measures on another day, the instrument in its place or elsewhere."""
    before = arm.world_from_base
    if elsewhere:
        turn = np.eye(4)
        turn[:3, :3] = matrix_from_quaternion(quaternion_from_rotation_vector([[0.4, -0.2, 1.0]]))[0]
        turn[:3, 3] = 0.3, -0.5, 0.2
        arm.world_from_base = turn @ before
    table = remastered_table(arm, arm.poses(40, seed=3), shift_deg, seed=3)
    arm.world_from_base = before
    return table


def test_an_arm_that_changed_is_told_whatever_rows_its_calibration_was_judged_on(spoilt):
    arm, calibration = spoilt
    assert calibration.validation.holdout["constant"].position.mean > 1.0
    data = ta.Measurements.from_dataframe(later(arm, SHIFT_DEG))
    found = ta.evaluate(calibration, data)
    assert kinds(found) == ["not_as_calibrated"]
    own_mm = float(re.findall(r"([\d.]+) mm on the calibration's own", told(found, "not_as_calibrated"))[0])
    assert own_mm < 0.1
    assert "own held-out rows without outliers" in told(found, "not_as_calibrated")
    (table, *_) = other_data(Facts(calibration, found, ("later.csv",))).parts
    assert re.search(r"and 0\.0\d+ mm on the held-out poses of its own data without the outliers", str(table))
    assert kinds(ta.evaluate(calibration, ta.Measurements.from_dataframe(later(arm, STILL)))) == []


def test_one_gross_row_of_another_day_is_no_change_of_the_arm(spoilt, monkeypatch):
    """Where intervals are too narrow for most rows, the mean error decides: that of the others."""
    arm, _ = spoilt
    calibration = calibrated(arm, arm.measure_table(arm.poses(POSES)), model="constant")
    monkeypatch.setattr(as_calibrated, "_share_beyond", lambda *_: 0.9)
    gross = ta.Measurements.from_dataframe(off(later(arm, STILL), [7], 0.05))
    assert kinds(ta.evaluate(calibration, gross, keep_frames=True)) == ["outliers"]


def test_a_set_up_that_moved_is_told_with_the_arm_that_changed_as_well(spoilt):
    arm, calibration = spoilt
    both = ta.Measurements.from_dataframe(later(arm, SHIFT_DEG, elsewhere=True))
    found = ta.evaluate(calibration, both, keep_frames=True)
    assert kinds(found) == ["setup_moved", "not_as_calibrated"]
    assert told(found, "setup_moved").endswith(
        "elsewhere than then, or a joint does. If nobody moved these, truearm update --keep-frame "
        "--keep-tool tells which joint it is. Otherwise leave --keep-frames out."
    )
    assert "found anew: the arm, its tool or the set-up" in told(found, "not_as_calibrated")
    alone = ta.Measurements.from_dataframe(later(arm, STILL, elsewhere=True))
    (notice,) = ta.evaluate(calibration, alone, keep_frames=True).notices
    assert "and the calibration itself fits" in str(notice)


def test_an_arm_of_a_fleet_is_compared_without_outliers(spoilt):
    arm, calibration = spoilt
    data = ta.Measurements.from_dataframe(off(arm.measure_table(arm.poses(POSES)), HELD[:1], 0.03))
    previous, options = calibration.to_bytes(), ta.CalibrationOptions.of(**HUBER)
    made = calibrate_arm(ArmTask(arm.robot.to_dict(), data, options, previous, "last.calib", False, False))
    row = row_of_made("R1", made)
    assert row["mean_mm"] > 1.0
    assert row["without_outliers_mm"] < 0.1
    assert row["drift"]["previous_mean_mm"] < 0.1
    fleet = [row, *({**row, "mean_mm": 0.05, "without_outliers_mm": 0.05} for _ in range(3))]
    assert not {"worse", "stands_out"} & {reason.kind for reason in reasons(row, fleet, LimitsSection())}
    exact = {**row, "nominal_without_outliers_mm": 0.03}
    (no_gain,) = (each.words for each in reasons(exact, [exact], LimitsSection()) if each.kind == "no_gain")
    assert no_gain.startswith("The calibration gains nothing: its mean error is 0.0")


def test_where_there_is_nothing_to_gain_gross_rows_are_no_wrong_data():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3, imperfections=EXACT)
    found = calibrated(arm, off(arm.measure_table(arm.poses(POSES)), [TRAINED[3], HELD[5]], 0.02), **HUBER)
    said = told(found, "no_gain")
    assert told(found, "no_help") == ""
    assert said.startswith("There is nothing to gain: the mean error on held-out rows without the outliers")
    assert f"or leave them out: row {HELD[5] + 1} (" in said
    assert "There is nothing to gain" in verdict(Facts(found))


def test_points_that_a_controller_computed_are_known_beside_gross_rows():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    exact = np.round(arm.robot.position(arm.poses(POSES)), 6)
    table = arm.measure_table(arm.poses(POSES)).assign(**dict(zip("xyz", exact.T, strict=True)))
    found = calibrated(arm, off(table, HELD[:2], 2e-3), **HUBER)
    assert "what a controller computes" in told(found, "computed")
    assert f"but for row {min(HELD[:2]) + 1} (" in told(
        found, "computed"
    ) or f"row {max(HELD[:2]) + 1} (" in (told(found, "computed"))


@pytest.mark.parametrize("part", [False, True])
def test_a_sigma_that_is_too_large_is_told_beside_a_gross_row(part):
    arm, coarse = VirtualArm(ta.Robot.load("ur10"), seed=3, imperfections=CONSTANT), np.arange(POSES) % 5 < 2
    table = arm.measure_table(arm.poses(POSES))
    row = next(int(row) for row in HELD if coarse[row])
    stated = np.where(coarse, 1.0, 0.02) if part else np.full(POSES, 1.0)
    found = calibrated(arm, off(table, [row], 0.3).assign(sigma_mm=stated), **HUBER)
    assert "state a sigma of 1 mm" in told(found, "stated_too_large") or not part
    assert "typically says 1 mm" in told(found, "stated_too_large") or part


@pytest.mark.parametrize(
    ("robust", "more", "kind"), [("huber", 1, "single_rows"), ("none", 4, "orientation_misfit")]
)
def test_a_few_wrong_quaternions_are_no_wrong_convention(robust, more, kind):
    arm = VirtualArm.paper(seed=2, imperfections=CONSTANT)
    table = arm.measure_table(arm.poses(POSES), orientation=True)
    wrong = [*TRAINED[:more].tolist(), *HELD[:2].tolist()]
    table.loc[wrong, QUATERNION] = table.loc[[int(TRAINED[7])], QUATERNION].to_numpy()
    found = calibrated(arm, table, model="constant", robust=robust)
    assert {"single_rows", "orientation_misfit"} & set(kinds(found)) == {kind}
    assert re.search(rf"row ({'|'.join(str(row + 1) for row in wrong)}) \(", told(found, kind))
    assert ("--robust cauchy" in told(found, kind)) == (robust == "none")


def test_how_poses_repeat_is_compared_with_errors_without_outliers():
    arm = VirtualArm.paper(seed=2, imperfections=CONSTANT)
    readings = arm.poses(POSES)
    readings[TRAINED[:8]] = readings[TRAINED[8:16]]
    table = arm.measure_table(readings)
    times = []
    for each in (table, off(table, HELD[:1], 0.3)):
        words = str(repeats(Facts(calibrated(arm, each, **HUBER))))
        times.append(float(re.findall(r"held-out poses is ([\d.]+) times that", words)[0]))
    assert times[1] < 1.5 * times[0]


def test_a_gross_row_is_no_noise_of_a_scheme():
    arm = VirtualArm.paper(seed=2)
    found = calibrated(arm, arm.measure_table(arm.poses(POSES)), model="regions")
    rows, held = found.rows, found.held
    assert rows is not None
    assert held is not None
    place = next(k for k, name in enumerate(rows.data.rows) if name == held.rows[0])
    errors = held.errors["regions"].position.copy()
    errors[0] += 0.5
    bent = replace(held, errors={**held.errors, "regions": replace(held.errors["regions"], position=errors)})
    with_outlier = replace(rows, score=np.where(np.arange(len(rows.data)) == place, 9.0, 0.0))
    errors_of = {name: each.statistics() for name, each in bent.errors.items()}
    judged = replace(found.validation, holdout=errors_of)
    known = replace(found, held=bent, rows=with_outlier, validation=judged)
    assert known.summary["noise_mm"] == pytest.approx(found.summary["noise_mm"], rel=0.5)
