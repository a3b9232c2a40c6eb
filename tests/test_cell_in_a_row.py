"""Poses in a row: a target that is lost uses up none, and what is far from its prediction is looked into."""

import dataclasses
import time
from unittest.mock import Mock

import numpy as np
import pytest

from tests.cell_support import cell_text
from tests.recorded import COUNT, Recorded
from truearm.cell import Cell
from truearm.cell.checks import unsure_steps
from truearm.cell.in_a_row import REPEATED, TAKEN_BACK, UNMEASURED_IN_A_ROW, Far
from truearm.cell.measuring import DONE
from truearm.cell.playback import PlaybackSensor
from truearm.cell.prediction import Prediction
from truearm.cell.reading import Reading
from truearm.cell.summary import summary_of
from truearm.errors import WorkError

A_METRE = np.array([1.0, 0.0, 0.0])
LOST = "5 poses in a row had no valid reading; the last: the beam is broken"


class Seen(Recorded):
    """A recording of which nothing is seen at some poses, and some are elsewhere, once pose 8 is measured.

    Attributes:
        unseen: Poses, from 0, at which nothing is seen.
        elsewhere: Poses, from 0, that are a metre from where they were recorded.
        frozen: Poses, from 0, at which the point of the pose before is said again.
        at_once: Whether that is so from the beginning.
    """

    def __init__(self, folder, monkeypatch):
        super().__init__(folder)
        self.unseen: set[int] = set()
        self.elsewhere: set[int] = set()
        self.frozen: set[int] = set()
        self._last = A_METRE
        self.at_once = False
        measure = PlaybackSensor.measure

        def measured(sensor):
            reading, pose = measure(sensor), int(sensor._rows[0])
            if self.at_once or self.begun():
                if pose in self.unseen:
                    return Reading(None, 1e-5, time.time(), False, "-", "the beam is broken")
                if pose in self.frozen:
                    return dataclasses.replace(reading, point_in_world=self._last)
                assert reading.point_in_world is not None
                self._last = reading.point_in_world
                if pose in self.elsewhere:
                    return dataclasses.replace(reading, point_in_world=reading.point_in_world + A_METRE)
            return reading

        monkeypatch.setattr(PlaybackSensor, "measure", measured)

    def begun(self):
        with self.read() as session:
            return session.measured_poses() >= 8

    def summary(self):
        with self.read() as session:
            return summary_of(session)

    def skipped(self):
        return [each["pose"] - 1 for each in self.summary()["skipped"]]

    def first_contact(self):
        with self.read() as session:
            return session.steps("registration")[0].pose


@pytest.fixture
def seen(tmp_path, monkeypatch):
    return Seen(tmp_path, monkeypatch)


def test_a_target_that_is_lost_uses_up_no_poses(seen):
    seen.unseen = set(range(COUNT))
    with pytest.raises(WorkError, match=f"{LOST}.*measures these poses again, and skips"):
        seen.measure()
    with seen.read() as session:
        assert session.measured_poses() == 8
        step = session.next_step()
        assert step is not None
        assert (step.kind, step.pose) == ("pose", 8)
        assert session.readings_of(step.step) == []
        told = session.rows("SELECT step FROM events WHERE kind = ? ORDER BY id", (TAKEN_BACK,))
        assert told[0] == (step.step,)
        assert len(told) == UNMEASURED_IN_A_ROW
    # It is still lost, which the check tells before any pose is tried.
    with pytest.raises(WorkError, match="the first contact could not be measured again"):
        seen.measure()
    seen.unseen = set()
    assert seen.measure()[1] == DONE
    assert seen.summary()["measured"] == COUNT
    assert seen.skipped() == []


def test_poses_that_are_not_seen_then_either_are_skipped(seen):
    seen.unseen = set(range(8, 20))
    for _ in range(2):
        with pytest.raises(WorkError, match=LOST):
            seen.measure()
    assert seen.skipped() == list(range(8, 13))
    assert seen.first_contact() < 8
    assert seen.measure()[1] == DONE
    assert seen.skipped() == list(range(8, 20))


def test_a_few_that_are_hidden_are_skipped_at_once(seen):
    seen.unseen = {*range(8, 12), *range(13, 17)}
    assert seen.measure()[1] == DONE
    assert seen.skipped() == sorted(seen.unseen)


def test_points_that_an_instrument_repeats_at_other_poses_do_not_count(seen):
    seen.frozen = {12, 13}
    assert seen.measure()[1] == DONE
    assert seen.skipped() == [12, 13]
    with seen.read() as session:
        reasons = session.rows("SELECT DISTINCT reason FROM readings WHERE reason != ''")
    assert reasons == [(REPEATED,)]


def test_a_calibration_so_far_that_is_no_better_than_the_frame_judges_no_readings():
    prediction, calibration = Prediction(Cell.from_toml(cell_text("tracker"))), Mock(groups=("a",))
    prediction.register(np.eye(4), 2e-3)
    registered_m = prediction.likely_m
    assert not prediction.learn(calibration, 0.8)
    assert prediction.likely_m == registered_m
    assert prediction.learn(calibration, 1e-5)
    assert prediction.likely_m < registered_m


def test_what_a_device_refuses_in_between_is_no_end_of_the_row_and_is_tried_again(seen):
    seen.unseen = set(range(8, 20))
    seen.without([10, 11])
    with pytest.raises(WorkError, match=LOST):
        seen.measure("without")
    assert seen.summary()["open"] == COUNT - 8
    seen.unseen = set()
    assert seen.measure()[1] == DONE
    assert seen.summary()["measured"] == COUNT


def test_contacts_for_the_frame_are_never_skipped_so(seen):
    seen.at_once, seen.unseen = True, set(range(COUNT))
    for _ in range(3):
        with pytest.raises(WorkError, match="5 contacts for the frame in a row had no valid reading"):
            seen.measure()
        with seen.read() as session:
            assert session.rows("SELECT count(*) FROM outcomes") == [(0,)]
    seen.unseen = set()
    assert seen.measure()[1] == DONE
    assert seen.summary()["measured"] == COUNT


def test_an_instrument_that_moves_is_noticed_after_three_poses(seen):
    seen.elsewhere = set(range(COUNT))
    with pytest.raises(WorkError, match=r"the first contact is now 1000\.00 mm from where it was"):
        seen.measure()
    with seen.read() as session:
        assert session.measured_poses() == 11
        (steps,) = unsure_steps(session)
        poses = {step.step: step.pose for step in session.steps("pose")}
    assert [poses[step] for step in steps if step in poses][-3:] == [8, 9, 10]
    seen.elsewhere = set()
    assert seen.measure()[1] == DONE


def test_an_arm_that_is_worse_than_expected_is_checked_once_each_time(seen):
    seen.elsewhere = {*range(8, 13), *range(15, 20)}
    told, end = seen.measure()
    assert end == DONE
    assert seen.first_contact() < 8
    kinds = [text.split()[0] for text in told if " stored" in text]
    assert kinds[8:] == [
        *["pose"] * 11, "check", *["pose"] * 7, "check", *["pose"] * 2, "check"
    ]  # fmt: skip
    assert seen.summary()["checks"] == {"measured": 3, "skipped": 0}


def test_a_check_is_asked_for_once_until_a_pose_is_near_its_prediction():
    far, asked = Far(), []
    for each in "fff ff nff fffn fff".replace(" ", ""):
        far.accepted(far=each == "f")
        asked.append(far.asks_for_check())
    assert [k for k, each in enumerate(asked) if each] == [2, 8, 14]
    assert UNMEASURED_IN_A_ROW == 5
