"""Instruments that measure coarsely and say so: what they explain is no contradiction, and nothing moved."""

import dataclasses

import numpy as np
import pytest
from scipy.special import chdtrc, ndtr

from tests.recorded import CELL, COUNT, Recorded
from truearm.cell.cell_file import ProcessSection
from truearm.cell.judge import Rules, judge
from truearm.cell.measuring import DONE
from truearm.cell.playback import PlaybackSensor
from truearm.cell.scatter import AS_RARE_AS, explained_m, sigma_of_mean_m, told_coarse, weighted_mean
from truearm.cell.session import Stored
from truearm.cell.summary import summary_of
from truearm.cli import main
from truearm.errors import WorkError

COARSE = CELL.replace("contacts = 1", "contacts = 2\ncheck_every = 4")
SIGMA_M = 0.35e-3


def test_what_is_explained_is_as_rare_as_a_normal_value_so_far_off():
    assert chdtrc(3, explained_m(1.0, 0.0) ** 2) == pytest.approx(2.0 * ndtr(-AS_RARE_AS))
    assert explained_m(3.0, 4.0) == pytest.approx(5.0 * explained_m(1.0, 0.0))
    assert sigma_of_mean_m([3.0] * 4) == pytest.approx(1.5)
    assert sigma_of_mean_m([3.0, 4.0]) == pytest.approx(2.4)
    assert weighted_mean([[0.0], [25.0]], [3.0, 4.0]) == pytest.approx([9.0])


def test_limits_of_the_example_with_a_panel_hold_as_they_are_stated():
    assert told_coarse(0.06e-3, ProcessSection()) == ""
    words = told_coarse(0.25e-3, ProcessSection())
    assert "readings of a pose agree within 1.6" in words
    assert "not agree_mm = 0.4, and the first contact may be off by 1.17 mm, not drift_mm = 0.4" in words


@pytest.mark.parametrize(("sigma_m", "decision"), [(6e-5, "again"), (2e-4, "accept")])
def test_readings_agree_as_well_as_their_standard_deviations_say(sigma_m, decision):
    readings = [Stored(k, True, (1e-3 * k, 0.0, 0.0), sigma_m) for k in (1, 2)]
    rules = Rules(contacts=2, attempts=6, agree_m=0.4e-3, likely_m=4e-3)
    assert judge(readings, np.zeros(3), rules).decision == decision


FINE_M, COARSE_M = 2e-5, 1e-3
RULES = Rules(contacts=2, attempts=8, agree_m=0.4e-3, likely_m=4e-3)


def stated(*readings):
    """Readings at (x, sigma), m."""
    return [Stored(k, True, (x_m, 0.0, 0.0), sigma_m) for k, (x_m, sigma_m) in enumerate(readings, start=1)]


def test_a_coarse_reading_does_not_make_others_agree_that_contradict():
    between = stated((0.0, FINE_M), (5e-3, FINE_M), (2.5e-3, COARSE_M))
    assert judge(between, np.zeros(3), RULES).decision == "again"
    assert judge([*between, *stated((1e-5, FINE_M))], np.zeros(3), RULES).decision == "accept"


def test_a_coarse_reading_moves_the_mean_by_what_it_tells():
    found = judge(stated((0.0, FINE_M), (3e-3, COARSE_M)), np.zeros(3), RULES)
    assert found.attempts == (1, 2)
    assert found.off_m == pytest.approx(3e-3 * (FINE_M / COARSE_M) ** 2, rel=1e-3)


@pytest.fixture
def coarse(tmp_path, monkeypatch):
    """A recording of which every reading has errors of SIGMA_M, and says so."""
    measure, rng = PlaybackSensor.measure, np.random.default_rng(3)

    def measured(sensor):
        reading = measure(sensor)
        assert reading.point_in_world is not None
        point = reading.point_in_world + rng.normal(0.0, SIGMA_M, 3)
        return dataclasses.replace(reading, point_in_world=point, sigma_m=SIGMA_M)

    monkeypatch.setattr(PlaybackSensor, "measure", measured)
    return Recorded(tmp_path)


def test_an_honest_coarse_instrument_measures_all_poses_of_a_cell_that_stands_still(coarse):
    told, end = coarse.measure(text=COARSE)
    assert end == DONE
    with coarse.read() as session:
        found = summary_of(session)
    assert (found["measured"], found["skipped"]) == (COUNT, [])
    assert found["events"]["coarse"] == 1
    assert sum("standard deviation of 0.35 mm" in text for text in told) == 1


def test_what_moves_by_more_than_a_coarse_instrument_explains_is_found(coarse):
    coarse.killed(until="pose 8 stored", text=COARSE)
    with pytest.raises(WorkError, match=r"drift by 0.4 mm \(drift_mm\), and its readings explain 1.\d\d mm"):
        coarse.measure("moved", text=COARSE)


def test_a_dry_run_says_which_limits_give_way(tmp_path, capsys):
    recorded = Recorded(tmp_path)
    poses = tmp_path / "poses.csv"
    np.savetxt(
        poses, recorded.poses.readings, delimiter=",", header="q1,q2,q3,q4,q5,q6", comments="", fmt="%.9f"
    )
    for sigma_mm in (0.05, 0.35):
        text = CELL.replace('"FILE"', f'"there.csv", sigma_mm = {sigma_mm}')
        (tmp_path / "cell.toml").write_text(text)
        assert main(["measure", str(tmp_path / "cell.toml"), str(poses), "--dry-run"]) == 0
        assert ("standard deviation of 0.35 mm" in " ".join(capsys.readouterr().err.split())) == (
            sigma_mm > 0.1
        )
