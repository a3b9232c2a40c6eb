"""Waves of gears, encoders and screws: found in measurements, told in summary and report, kept in files."""

import dataclasses

import numpy as np
import pytest

import truearm as ta
from truearm.errors import TruearmError
from truearm.exporting.field_grid import grid_axes, grid_table, grid_text
from truearm.reporting.facts import Facts
from truearm.reporting.parts import Figure
from truearm.reporting.varying import varying
from truearm.simulation import VirtualArm
from truearm.simulation.imperfections import Harmonic, Imperfections, JointError

JOINT, CYCLES, AMPLITUDE_DEG = 2, 202, 0.01


def calibrated(amplitude_deg):
    """A UR10 whose second drive leaves a wave, by 168 poses."""
    errors = (JointError(JOINT, harmonics=(Harmonic(CYCLES, amplitude_deg, 50.0),)),)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1, imperfections=Imperfections(joint_errors=errors))
    return ta.calibrate(arm.robot, arm.measure(arm.poses(240)), use="position", refit=False)


@pytest.fixture(scope="module")
def found():
    return calibrated(AMPLITUDE_DEG)


def waves_of(calibration):
    return blocks_of(calibration, "wave")


def blocks_of(calibration, name):
    return [block for block in calibration.summary["blocks"] if block["name"] == name]


def test_a_wave_is_found_and_taken_away(found):
    plain = calibrated(0.0)
    assert waves_of(plain) == []
    (wave,) = waves_of(found)
    assert wave["joints"] == [JOINT]
    assert wave["cycles"] == CYCLES
    assert wave["amplitudes"]["theta_mrad"] == pytest.approx(1e3 * np.radians(AMPLITUDE_DEG), rel=0.15)
    mean, free = (one.validation.holdout["variable"].position.mean for one in (found, plain))
    assert mean < 1.15 * free, "an arm with a wave is as good as one without"
    assert 0.9 < found.summary["coverage_95"] < 0.99


def test_what_the_arm_does_over_a_cycle_is_predicted(found):
    q = np.repeat([[0.3, -1.2, 0.9, 0.2, 0.7, 0.1]], 60, axis=0)
    q[:, JOINT - 1] += np.linspace(0.0, 2.0 * np.pi / CYCLES, 60)
    slow = Facts(found).without_waves.parameters(q)
    wave = (found.parameters(q) - slow)[:, JOINT - 1, 0]
    assert 0.5 * np.ptp(wave) == pytest.approx(np.radians(AMPLITUDE_DEG), rel=0.15)
    assert abs(wave[0] - wave[-1]) < 1e-9


def test_a_file_keeps_the_wave_and_its_standard_deviation(found, tmp_path):
    found.save(tmp_path / "arm.calib")
    again = ta.Calibration.load(tmp_path / "arm.calib")
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    assert np.array_equal(again.parameters(q), found.parameters(q))
    assert np.allclose(again.position_std(q), found.position_std(q), rtol=1e-9)
    assert waves_of(again) == waves_of(found)


def test_reports_name_waves_and_draw_curves_without_them(found):
    facts = Facts(found)
    figures = {part.title: part for part in varying(facts).parts if isinstance(part, Figure)}
    assert "Not drawn: waves with 202 cycles a turn" in figures[f"Variation along joint {JOINT}"].says
    assert "Not drawn" not in figures["Variation along joint 1"].says
    q = np.repeat([[0.3, -1.2, 0.9, 0.2, 0.7, 0.1]], 2, axis=0)
    q[1, JOINT - 1] += np.pi / CYCLES
    drawn = np.ptp(facts.without_waves.parameters(q)[:, JOINT - 1, 0])
    assert drawn < 0.2 * np.ptp(found.parameters(q)[:, JOINT - 1, 0])


def test_a_table_says_which_waves_it_cannot_follow(found):
    axes = grid_axes(found, "q1=-30:30:2")
    text = grid_text(grid_table(found, axes), found, axes)
    assert "# Samples hold waves of joint 2 with 202 cycles a turn, lost between them." in text


def test_corrections_reach_their_targets_where_a_wave_is_steep(found):
    limits = ta.Limits(largest_mm=20.0, largest_joint_deg=10.0, largest_std_mm=None)
    q = np.linspace([0.3, -1.2, 1.5, -0.8, 1.1, 0.4], [0.8, -1.0, 1.3, -0.9, 1.2, 0.2], 60)
    corrected = ta.Compensator(found, limits=limits).joints(q)
    assert corrected.refusals == ()
    assert np.abs(found.pose(corrected.q) - found.robot.pose(q)).max() < 1e-9


def test_the_pitch_of_a_screw_is_found():
    robot, pitch_mm, amplitude_mm = ta.Robot.load("adept-cobra-600"), 5.0, 0.06
    arm = VirtualArm(robot, seed=2, imperfections=Imperfections(noise_mm=0.02))
    q = arm.poses(300)
    table = arm.measure_table(q)
    table["q3"] = q[:, 2] + 1e-3 * amplitude_mm * np.sin(2.0 * np.pi * q[:, 2] / (1e-3 * pitch_mm))
    calibration = ta.calibrate(robot, ta.Measurements.from_dataframe(table), refit=False)
    (wave,) = waves_of(calibration)
    assert wave["joints"] == [3]
    assert wave["period_mm"] == pytest.approx(pitch_mm, rel=0.02)
    assert wave["amplitudes"]["lengths_mm"] == pytest.approx(amplitude_mm, rel=0.15)
    own = {tuple(block["joints"]): block["amplitudes"] for block in blocks_of(calibration, "own")}
    assert set(own[3,]) == {"lengths_mm"}
    assert set(own[1,]) == {"theta_mrad"}
    assert calibration.validation.holdout["variable"].position.mean < 0.05
    says = [part.says for part in varying(Facts(calibration)).parts if isinstance(part, Figure)]
    assert any("waves with a period of" in words for words in says)


@pytest.mark.parametrize(
    ("waves", "reason"),
    [
        ([2.0, 202.0], "three values a wave"),
        ([9.0, 202.0, 1e-4], "that the arm has not"),
        ([-1.0, 202.0, 1e-4], "joint -1"),
        ([1.0, 0.0, 1e-4], "no cycles of any drive"),
        ([1.0, 202.0, float("inf")], "no amplitude"),
        ([1.0, 202.0, 1e-4] * 200, "more waves than an arm has drives"),
    ],
)
def test_waves_of_no_arm_end_in_an_error(found, waves, reason, tmp_path):
    found.save(tmp_path / "arm.calib")
    kept = ta.Calibration.load(tmp_path / "arm.calib")
    forged = dataclasses.replace(found.variable, hyper={**found.variable.hyper, "waves": waves})
    calibration = dataclasses.replace(kept, variable=forged)
    with pytest.raises(TruearmError, match=reason):
        calibration.position_std(np.zeros((3, 6)))
