"""What else may be at work when an arm is measured again: another common scale, or another load."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.remastered import check_offset
from tests.report_support import words_of
from truearm.cli import main
from truearm.fits.parameters import A, D
from truearm.programs.notices import update_notices
from truearm.reporting.report import report
from truearm.simulation import Conditions, Deflection, Imperfections, Mass, Thermal, VirtualArm

STEEL = 12e-6
COLD, WARM = Conditions(temperature_c=20.0), Conditions(temperature_c=32.0)
GROWN_PPM = 144.0
LOADED = Conditions(temperature_c=20.0, payload_kg=20.0)
REST = np.zeros(6)
UNNOTED = ["temperature_c", "payload_kg"]


@pytest.fixture(scope="module")
def arm():
    compliant = Deflection(
        compliance=(0.0, 1e-6, 1.5e-6, 3e-6, 4e-6, 4e-6),
        masses=(Mass(2, 8.0), Mass(3, 4.0)),
        payload_at_m=(0.0, 0.0, 0.1),
    )
    imperfections = Imperfections(
        noise_mm=0.03, share=0.02, deflection=compliant, thermal=Thermal(growth_per_k=STEEL)
    )
    return VirtualArm(ta.Robot.load("ur10"), seed=5, imperfections=imperfections)


@pytest.fixture(scope="module")
def calibrations(arm):
    data = rows(arm, COLD, count=100, seed=1)
    return {model: ta.calibrate(arm.robot, data, model=model) for model in ("constant", "variable")}


@pytest.fixture
def known(calibrations):
    return calibrations["variable"]


@pytest.fixture
def constant(calibrations):
    return calibrations["constant"]


def table(arm, met, *, count=20, seed=9, shift_deg=REST):
    """What is measured under conditions that nobody noted, each joint `shift_deg` (N,) beyond its reading."""
    readings = arm.poses(count, seed=seed)
    found = arm.measure_table(readings + np.radians(shift_deg), seed=seed, conditions=met)
    for joint, column in enumerate(readings.T, start=1):
        found[f"q{joint}"] = column
    return found.drop(columns=UNNOTED, errors="ignore")


def measured(arm, met, readings):
    """What is measured at readings (n, N)."""
    found = arm.measure_table(readings, seed=9, conditions=met)
    return ta.Measurements.from_dataframe(found.drop(columns=UNNOTED, errors="ignore"))


def rows(arm, met, **more):
    return ta.Measurements.from_dataframe(table(arm, met, **more))


def error_mm(calibration, arm, met):
    """Mean error at fresh poses, frame and tool found anew."""
    found = ta.evaluate(calibration, rows(arm, met, count=60, seed=77))
    return found.errors[calibration.model_name].position.mean


def kinds(found):
    return [notice.kind for notice in found.notices]


def cause_of(found):
    """The cause that an update found, as JSON values."""
    assert found.cause is not None
    return found.cause.to_dict()


def check_ppm(found, ppm, *, largest_std=20.0):
    """A scale is found within some standard errors, which are small."""
    cause = cause_of(found)
    assert abs(cause["ppm"] - ppm) < 3.0 * cause["std_ppm"]
    assert cause["std_ppm"] < largest_std


def check_scale(found, ppm):
    assert found.verdict == "scale"
    assert cause_of(found)["name"] == "scale"
    check_ppm(found, ppm)
    assert found.outliers == ()
    assert not any(offset.moved for offset in found.offsets)
    assert kinds(found) == ["other_scale"]


@pytest.mark.parametrize("model", ["constant", "variable"])
def test_an_arm_that_is_warmer_has_another_scale_and_keeps_its_calibration(model, arm, calibrations):
    known = calibrations[model]
    found = ta.update(known, rows(arm, WARM))
    check_scale(found, GROWN_PPM)
    assert f"an arm that is {cause_of(found)['ppm'] / 12.0:.0f} K warmer (steel;" in str(found.notices[0])
    assert error_mm(found.calibration, arm, COLD) < 1.2 * error_mm(known, arm, COLD)
    assert found.after.position.mean < 0.75 * found.before.position.mean
    (notice,) = update_notices(found.calibration)
    assert "All lengths are 1" in str(notice)
    assert "All lengths are 1" in words_of(report(found.calibration).html)


def test_a_scale_that_stays_is_taken_along(arm, known):
    found = ta.update(known, rows(arm, WARM), take_scale=True)
    check_scale(found, GROWN_PPM)
    assert cause_of(found)["taken"]
    assert update_notices(found.calibration) == []
    before, after = (each.parameters(REST[None])[0] for each in (known, found.calibration))
    lengths = np.abs(arm.robot.table[:, [D, A]])
    grown = np.abs((after - before)[:, [D, A]])
    assert grown == pytest.approx(1e-6 * cause_of(found)["ppm"] * lengths, abs=1e-9)
    assert error_mm(found.calibration, arm, WARM) < 1.2 * error_mm(known, arm, COLD)
    again = ta.update(found.calibration, rows(arm, WARM, seed=10))
    assert again.verdict == "holds"


def test_an_instrument_of_another_scale_shows_the_same(arm, constant):
    data = rows(arm, COLD)
    smaller = replace(data, targets=data.targets * (1.0 - 2e-4))
    found = ta.update(constant, smaller)
    check_scale(found, -200.0)
    assert "smaller" in str(found.notices[0])
    assert "K cooler" in str(found.notices[0])


def test_a_joint_that_was_mastered_anew_is_found_beside_a_scale(arm, known):
    shift_deg = np.array([0.0, 0.05, 0.0, 0.1, 0.0, 0.0])
    found = ta.update(known, rows(arm, WARM, shift_deg=shift_deg))
    assert found.verdict == "scale"
    assert [offset.joint for offset in found.offsets if offset.moved] == [2, 4]
    for offset, truth in zip(found.offsets[1:5], shift_deg[1:5], strict=True):
        check_offset(offset, truth)
    assert error_mm(found.calibration, arm, COLD) > 0.2
    check_ppm(found, GROWN_PPM)


def bent_mm(arm, met):
    """How far the target of the rows of `table` is from where it is without load, on average."""
    quiet = replace(arm.imperfections, noise_mm=0.0)
    still = VirtualArm(arm.robot, seed=5, imperfections=quiet)
    loaded, free = (table(still, each)[["x", "y", "z"]].to_numpy() for each in (met, COLD))
    return 1e3 * np.linalg.norm(loaded - free, axis=1).mean()


def test_another_weight_at_the_flange_is_told_and_leaves_out_no_true_row(arm, known):
    found = ta.update(known, rows(arm, LOADED))
    assert found.verdict == "load"
    assert cause_of(found)["name"] == "load"
    assert found.outliers == ()
    assert not any(offset.moved for offset in found.offsets)
    assert cause_of(found)["bent_mrad"][0] == 0.0
    assert min(cause_of(found)["bent_mrad"][1:3]) > 0.05
    assert cause_of(found)["mean_mm"] == pytest.approx(bent_mm(arm, LOADED), rel=0.2)
    (notice,) = found.notices
    assert notice.kind == "other_load"
    assert "give way more than when the arm was calibrated" in str(notice)
    assert "a heavier one: joint 2 by up to" in str(notice)
    assert error_mm(found.calibration, arm, COLD) < 1.2 * error_mm(known, arm, COLD)


def test_poses_of_one_lever_do_not_tell_a_load_from_offsets_and_say_so(arm, known):
    pool = arm.poses(600, seed=9)
    stretched = pool[np.argsort(arm.robot.joint_jacobian(pool)[:, 2, 1])[:20]]
    found = ta.update(known, measured(arm, LOADED, stretched))
    assert found.verdict == "moved"
    assert "may_be_otherwise" in kinds(found)
    assert "from another weight at the flange: if that was otherwise" in str(found.notices[-1])


def test_a_gross_row_is_left_out_beside_a_load(arm, known):
    spoilt = table(arm, LOADED)
    spoilt.loc[3, "x"] += 5e-3
    found = ta.update(known, ta.Measurements.from_dataframe(spoilt))
    assert found.verdict == "load"
    assert found.outliers == (4,)


@pytest.mark.parametrize(("met", "kind"), [(WARM, "other_scale"), (LOADED, "other_load")])
def test_an_evaluation_names_what_else_is_at_work(met, kind, arm, known):
    found = ta.evaluate(known, rows(arm, met, count=60))
    assert kinds(found) == ["not_as_calibrated", kind]


def test_constants_alone_do_not_tell_a_load_from_the_weight_of_the_links(arm, constant):
    assert ta.update(constant, rows(arm, LOADED)).cause is None


def test_arms_that_did_not_change_hold_whatever_is_asked(arm, known):
    found = [ta.update(known, rows(arm, COLD, seed=20 + k)) for k in range(6)]
    assert [each.verdict for each in found].count("holds") >= 5
    assert all(each.cause is None for each in found)


def test_what_a_rail_slides_is_part_of_a_scale_that_no_constants_hold():
    exact = Imperfections(noise_mm=0.01, share=0.0)
    arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=4, imperfections=exact)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), model="constant")
    data = arm.measure(arm.poses(20, seed=9), seed=9)
    found = ta.update(calibration, replace(data, targets=data.targets * 1.0005))
    assert found.verdict == "scale"
    check_ppm(found, 500.0, largest_std=50.0)
    assert "calibrate anew, since rails cannot be scaled" in str(found.notices[0])
    with pytest.raises(ta.UsageError, match="a joint of this arm slides"):
        ta.update(calibration, data, take_scale=True)


def test_the_command_says_it_and_how_to_take_it_along(arm, known, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    known.save("old.calib")
    table(arm, WARM).to_csv("warm.csv", index=False)
    table(arm, LOADED).to_csv("loaded.csv", index=False)
    assert main(["update", "old.calib", "warm.csv"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "ppm larger than when the arm was calibrated, or the measuring device's scale differs." in told
    assert "It is right" not in told
    assert "truearm update old.calib warm.csv --take-scale -o NEW.calib" in told
    assert main(["update", "old.calib", "warm.csv", "--take-scale", "-o", "new.calib"]) == 0
    assert "The updated calibration is with it." in " ".join(capsys.readouterr().out.split())
    assert main(["update", "old.calib", "loaded.csv"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "The joints give way more than when the arm was calibrated, as under a heavier weight." in told
    assert "--take-scale" not in told
