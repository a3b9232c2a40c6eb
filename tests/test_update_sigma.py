"""What the rows of an update state as their sigma, beside the noise of the calibration."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.remastered import remastered_table
from truearm.certainty.uncertainty import noises_of
from truearm.fits.known_scale import KnownScale
from truearm.proposing import Candidates, acceptance_poses
from truearm.simulation import VirtualArm
from truearm.storage import calibration_content
from truearm.storage.calibration_file import calibration_bytes
from truearm.updating.scale import known_scale


@pytest.fixture(scope="module")
def arm():
    return VirtualArm.paper(seed=2)


@pytest.fixture(scope="module")
def silent(arm):
    """A calibration whose rows stated no sigma."""
    return ta.calibrate(arm.robot, arm.measure(arm.poses(60)))


@pytest.fixture(scope="module")
def later(arm):
    return arm.measure_table(arm.poses(15, seed=8), seed=8)


def of(table):
    return ta.Measurements.from_dataframe(table)


def rest(calibration, table):
    return ta.update(calibration, of(table)).rest.squares


def noise_mm(calibration):
    return 1e3 * calibration.variable.inflation * noises_of(calibration.variable.hyper)[0]


def test_a_sigma_that_the_noise_holds_already_changes_nothing(silent, later):
    without = rest(silent, later)
    assert rest(silent, later.assign(sigma_mm=0.99 * noise_mm(silent))) == pytest.approx(without, rel=1e-6)
    assert rest(silent, later.assign(sigma_mm=2.0 * noise_mm(silent))) < without


def test_a_sigma_comes_on_top_of_noise_that_was_told_beside_one(arm, later):
    rows = arm.measure_table(arm.poses(60)).assign(sigma_mm=0.01)
    stated = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(rows))
    assert rest(stated, later.assign(sigma_mm=0.99 * noise_mm(stated))) < rest(stated, later)


def test_a_sigma_comes_on_top_of_what_constants_alone_leave(arm, later):
    constant = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), model="constant")
    sigma_mm = 0.5e3 * constant.constant.noise_m
    assert rest(constant, later.assign(sigma_mm=sigma_mm)) < rest(constant, later)


def test_rows_that_state_none_scatter_as_those_of_the_calibration_did(arm, later):
    stated = ta.calibrate(arm.robot, of(arm.measure_table(arm.poses(60)).assign(sigma_mm=0.03)))
    told = later.assign(sigma_mm=0.03)
    assert rest(stated, later) == pytest.approx(rest(stated, told), rel=1e-9)
    assert [notice.message for notice in ta.update(stated, of(later)).notices if notice.kind == "sigma"] == [
        "15 rows without a sigma, which the calibration's rows have: the device is taken to scatter as it "
        "did then, by 0.03 mm. If it does not, say how much in a column sigma_mm."
    ]
    assert "sigma" not in {notice.kind for notice in ta.update(stated, of(told)).notices}


def test_nothing_is_said_where_the_calibration_stated_none(silent, later):
    assert "sigma" not in {notice.kind for notice in ta.update(silent, of(later)).notices}


def test_a_stripped_calibration_finds_what_the_whole_one_finds(arm):
    """How far its rows scattered stays with the file, whatever its updates."""
    rows = arm.measure_table(arm.poses(60)).assign(sigma_mm=0.02)
    whole = ta.calibrate(arm.robot, of(rows), model="constant")
    moved = of(remastered_table(arm, arm.poses(15, seed=8), [0.0, 0.3, 0.0, 0.0, 0.0], seed=8))
    once = ta.update(whole, moved)
    for known in (whole, once.calibration):
        stripped = ta.Calibration.from_bytes(known.to_bytes(with_rows=False), where="stripped")
        found, expected = ta.update(stripped, moved), ta.update(known, moved)
        assert found.verdict == expected.verdict
        assert (found.changed, found.rest) == (expected.changed, expected.rest)
        assert found.notices[-1].kind == "sigma"
    assert once.verdict == "moved"


def without_a_scale(calibration):
    """A calibration as files of earlier versions hold it, without rows."""
    arrays, content = calibration_content.pack(calibration, with_rows=False)
    content["constant"].pop("scale")
    return ta.Calibration.from_bytes(calibration_bytes(arrays, content), where="arm.calib")


def test_files_of_earlier_versions_know_their_scale_from_what_was_measured(arm, later):
    whole = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), model="constant")
    old = without_a_scale(whole)
    assert known_scale(old).freedom == known_scale(whole).freedom
    found = ta.update(old, of(later))
    assert [notice.message for notice in found.notices] == [
        "15 rows without a sigma, and the calibration's file does not say whether its rows had one: they are "
        "taken to have none. If they had, say how much in a column sigma_mm."
    ]
    updated = without_a_scale(found.calibration)
    for refused in (lambda: ta.update(updated, of(later)), lambda: acceptance_of(updated, arm)):
        with pytest.raises(ta.WorkError, match="the calibration before the update is not in this file"):
            refused()


def acceptance_of(calibration, arm):
    return acceptance_poses(Candidates(calibration, arm.poses(30, seed=5)), 12)


def test_poses_promise_no_more_than_the_device_that_was_stated_shows(arm):
    rows = arm.measure_table(arm.poses(60)).assign(sigma_mm=0.3)
    stated = ta.calibrate(arm.robot, of(rows), model="constant")
    noise = Candidates(stated, arm.poses(3)).noise
    assert noise[0, 0, 0] == pytest.approx(stated.constant.noise_m**2 + 0.3e-3**2, rel=1e-9)


@pytest.mark.parametrize(("stating", "usual"), [(1, 0.0), (20, 0.0), (21, 5e-4), (40, 5e-4)])
def test_a_few_rows_that_state_a_sigma_do_not_speak_for_the_others(arm, stating, usual):
    stated = np.where(np.arange(40) < stating, 5e-4, np.nan)
    data = replace(arm.measure(arm.poses(40)), sigma_m=stated)
    assert KnownScale.of(np.ones((40, 3)), 15, data, 0.0).sigma_m == usual
