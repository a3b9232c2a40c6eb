"""Readings that are valid and contradict each other: no poses are used up, and nothing is lost for good."""

import dataclasses
import json

import numpy as np
import pytest

from tests.cell_support import write_poses
from tests.recorded import CELL, COUNT, Recorded
from truearm.cell.checks import CONTRADICTED
from truearm.cell.measuring import DONE
from truearm.cell.playback import PlaybackSensor
from truearm.cell.summary import summary_of
from truearm.cli import main
from truearm.errors import WorkError

SHAKEN = CELL.replace("contacts = 1", "contacts = 2\nattempts = 3\ncheck_every = 10")
APART = np.array([2e-3, 0.0, 0.0])


class Shaken(Recorded):
    """A recording of which readings at some poses are all apart, from a number of measured poses on.

    Attributes:
        shaken: These poses, from 0.
        after: How many poses are measured before.
    """

    def __init__(self, folder, monkeypatch):
        super().__init__(folder)
        self.shaken: set[int] = set()
        self.after = 8
        made, measure = iter(range(10_000)), PlaybackSensor.measure

        def measured(sensor):
            reading = measure(sensor)
            if int(sensor._rows[0]) not in self.shaken or self.summary()["measured"] < self.after:
                return reading
            assert reading.point_in_world is not None
            return dataclasses.replace(reading, point_in_world=reading.point_in_world + next(made) * APART)

        monkeypatch.setattr(PlaybackSensor, "measure", measured)

    def go(self, recording="there"):
        return self.measure(recording, text=SHAKEN)[1]

    def summary(self):
        with self.read() as session:
            return summary_of(session)

    def contacts(self):
        with self.read() as session:
            return [step.pose for step in session.steps("registration")]


@pytest.fixture
def shaken(tmp_path, monkeypatch):
    return Shaken(tmp_path, monkeypatch)


@pytest.mark.parametrize(
    ("check_every", "lost"),
    [
        (0, "5 poses in a row could not be measured; the last: 3 readings, of which 1 agree.*poses again"),
        (10, CONTRADICTED),
    ],
)
def test_an_instrument_that_shakes_uses_up_no_poses(shaken, check_every, lost):
    text = SHAKEN.replace("check_every = 10", f"check_every = {check_every}")
    shaken.shaken = set(range(COUNT))
    for message in (lost, CONTRADICTED):
        with pytest.raises(WorkError, match=message):
            shaken.measure(text=text)
        found = shaken.summary()
        assert (found["measured"], found["open"], found["skipped"]) == (8, COUNT - 8, [])
    assert {each["reason"] for each in found["skipped_checks"]} == {"3 readings, of which 1 agree"}
    shaken.shaken = set()
    assert shaken.measure(text=text)[1] == DONE
    assert shaken.summary()["measured"] == COUNT


def test_checks_that_contradict_themselves_everywhere_let_no_session_go_on(shaken):
    shaken.go()
    contacts = set(shaken.contacts())
    shaken.session.unlink()
    shaken.shaken = contacts
    with pytest.raises(WorkError, match=CONTRADICTED):
        shaken.go()
    assert shaken.summary()["open"]
    shaken.shaken = set()
    assert shaken.go() == DONE
    found = shaken.summary()
    assert found["measured"] == COUNT - len(found["skipped"])
    assert found["unchecked"] == []


def test_contacts_that_were_given_up_are_told_and_measured_again(shaken, capsys):
    shaken.go()
    contacts = shaken.contacts()
    shaken.session.unlink()
    shaken.after, shaken.shaken = 0, {contacts[k] for k in (1, 2, 4, 5, 7)}
    for _ in range(2):
        with pytest.raises(WorkError, match="3 contacts for the frame succeeded.*measures them again"):
            shaken.go()
    assert main(["session", "show", str(shaken.session)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f"Contact for the frame at pose {contacts[1] + 1} skipped: 3 readings, of which 1 agree" in said
    assert len(shaken.summary()["skipped_contacts"]) == 5
    shaken.shaken = set()
    assert shaken.go() == DONE
    assert shaken.summary()["measured"] == COUNT


def test_poses_that_were_skipped_are_told_at_the_end(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    recorded = Recorded(tmp_path)
    recorded.without([8, 11])
    write_poses("poses.csv", recorded.poses)
    (tmp_path / "cell.toml").write_text(CELL.replace("FILE", "without.csv"))
    assert main(["measure", "cell.toml", "poses.csv", "--json"]) == 0
    printed = capsys.readouterr()
    assert "2 of 20 poses were skipped (poses 9 and 12)" in " ".join(printed.err.split())
    assert [each["pose"] for each in json.loads(printed.out)["skipped"]] == [9, 12]
