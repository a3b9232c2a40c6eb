"""Updates of updated calibrations, and what an updated one knows of those before it."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.remastered import SHIFT, TOOL_MM, check_offset, paper_arm, remastered, std_mm, updated
from truearm.simulation import VirtualArm


@pytest.fixture(scope="module")
def known():
    return paper_arm()


@pytest.fixture(scope="module")
def moved(known):
    return updated(*known)


def test_updates_of_updates_stay_as_certain_as_one():
    arm = VirtualArm.paper(seed=2)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(25)), model="constant")
    q, errors, stds = arm.poses(50, seed=4), [], []
    for seed in range(20, 25):
        found = ta.update(calibration, arm.measure(arm.poses(20, seed=9), seed=seed))
        calibration = found.calibration
        errors.append([offset.std for offset in found.offsets if offset.told])
        stds.append(std_mm(calibration, q).mean())
    assert (np.array(errors[-1]) < 1.2 * np.array(errors[0])).all()
    assert stds[-1] < 1.2 * stds[0]
    details = calibration.constant
    np.testing.assert_allclose(
        details.standard_errors, np.sqrt(np.diag(details.covariance)[: len(details.names)])
    )


def test_files_that_do_not_tell_what_became_of_errors_count_both_parts_in_full(known, moved):
    arm, calibration = known
    updated, q = moved[1].calibration, arm.poses(20, seed=5)
    assert updated.revision is not None
    silent = replace(updated, revision=replace(updated.revision, carried=None), fitted_spread=None)
    assert (std_mm(silent, q) > std_mm(calibration, q)).all()


def test_rows_of_an_update_are_known_to_what_it_made(known, moved):
    arm, _ = known
    data, found = moved
    for told in (ta.evaluate(found.calibration, data, keep_frames=True), ta.update(found.calibration, data)):
        assert [(notice.kind, len(notice.rows)) for notice in told.notices] == [("known_rows", 15)]
    first = ta.evaluate(found.calibration, arm.measure(arm.poses(60)))
    assert [len(notice.rows) for notice in first.notices if notice.kind == "known_rows"] == [60]
    stripped = found.calibration.without_rows()
    assert ta.evaluate(stripped, data, keep_frames=True).notices == ()


def test_offsets_that_were_held_are_not_called_determined(known, moved):
    before, after = (set(each.constant.names) for each in (known[1], moved[1].calibration))
    columns = dict(zip(known[1].arm.candidates.columns, known[1].arm.candidates.names, strict=True))
    directions = moved[1].calibration.revision.directions
    held = {columns.get(int(np.argmax(np.abs(directions[:, joint])))) for joint in (0, 4)}
    assert after >= before
    assert not (after - before) & held
    assert (moved[1].calibration.constant.standard_errors > 0.0).all()


def test_an_updated_calibration_is_updated_and_rolled_back_again(known, moved, tmp_path):
    arm, _ = known
    data, found = moved
    found.calibration.save(tmp_path / "one.calib")
    twice = 2.0 * SHIFT
    more = remastered(arm, arm.poses(15, seed=19), twice, seed=19, tool_mm=TOOL_MM)
    second = ta.update(ta.Calibration.load(tmp_path / "one.calib"), more)
    assert second.verdict == "moved"
    check_offset(second.offsets[3], SHIFT[3], errors=5.0)
    second.calibration.save(tmp_path / "two.calib")
    ta.roll_back(tmp_path / "two.calib", tmp_path / "back.calib")
    assert (tmp_path / "back.calib").read_bytes() == (tmp_path / "one.calib").read_bytes()
    again = ta.update(found.calibration, data)
    assert again.verdict == "holds"
    for offset, before in zip(again.offsets[1:4], found.offsets[1:4], strict=True):
        assert offset.std is not None
        assert before.std is not None
        assert offset.std < 1.2 * before.std
