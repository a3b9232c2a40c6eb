"""Curves of drives that turn two joints through a parallel link go with readings, others with D-H angles."""

import numpy as np
import pytest

import truearm as ta
from tests.parallel_link import calibrated, of_drives
from truearm.reporting.report import report

MOST_MM = 0.05
"""Constants alone leave three times as much, and curves of the other kind twice."""


def own_blocks(calibration):
    return [block for block in calibration.summary["blocks"] if block["name"] == "own"]


@pytest.mark.parametrize("behind_a_link", [True, False])
def test_the_evidence_tells_what_curves_go_with(behind_a_link):
    calibration = calibrated(behind_a_link)
    over = {block["joints"][0]: block.get("over_reading", False) for block in own_blocks(calibration)}
    assert over == {joint: behind_a_link and joint in {2, 3} for joint in range(1, 7)}
    _, fresh = of_drives(behind_a_link, 300, seed=9, noise_m=0.0)
    errors = ta.evaluate(calibration, fresh).errors
    assert errors["variable"].position.mean < MOST_MM
    assert errors["constant"].position.mean > 2.0 * MOST_MM


def test_a_file_holds_what_is_over_readings(tmp_path):
    calibration = calibrated(True)
    calibration.save(tmp_path / "arm.calib")
    again = ta.Calibration.load(tmp_path / "arm.calib")
    q = np.random.default_rng(3).uniform(-1.0, 1.0, (20, 6))
    assert np.array_equal(again.position(q), calibration.position(q))
    assert again.position_std(q) == pytest.approx(calibration.position_std(q), rel=1e-9)
    assert again.summary["blocks"] == calibration.summary["blocks"]


def test_commands_reach_what_they_are_meant_for():
    calibration = calibrated(True)
    q = np.random.default_rng(4).uniform(-0.8, 0.8, (50, 6))
    found = ta.Compensator(calibration).joints(q)
    assert not found.refusals
    assert found.residual_mm.max() < 1e-6
    reached = calibration.position(found.q)
    assert reached == pytest.approx(calibration.robot.position(q), abs=1e-9)


@pytest.mark.parametrize("behind_a_link", [True, False])
def test_what_is_not_explained_is_what_the_posterior_has_anew_at_every_pose(behind_a_link):
    """Drives whose curves go with readings repeat by their readings, too."""
    calibration = calibrated(behind_a_link)
    spread = calibration.spread
    jacobian = calibration.parameter_jacobian(
        calibration.rows.data.readings, tool=calibration.model.setup.targets[0, 0]
    )
    noise = spread.noise(jacobian, np.zeros(3, dtype=np.bool_)) / spread.inflation**2
    told_mm = 1e3 * np.sqrt(np.trace(noise, axis1=1, axis2=2).mean() / 3.0)
    assert calibration.summary["noise_mm"] == pytest.approx(told_mm, rel=1e-3)


def test_the_report_names_readings():
    html = report(calibrated(True)).html
    assert "reading 2" in html
    assert "reading 3" in html
    assert "reading 4" not in html
