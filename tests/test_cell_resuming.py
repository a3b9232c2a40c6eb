"""A session that is gone on with: its first contact is measured again; what moved is told and kept apart."""

import json
import sqlite3
from contextlib import closing
from dataclasses import replace
from itertools import islice
from unittest.mock import Mock

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from tests.recorded import CELL, COUNT, Recorded
from truearm.cell import Cell
from truearm.cell.accepted import accepted_table, measurements_of
from truearm.cell.checks import unsure_steps
from truearm.cell.measuring import ACCURATE, DONE, Process
from truearm.cell.opening import open_session
from truearm.cell.poses_file import Poses
from truearm.cell.reading import Reading
from truearm.cell.session import Session
from truearm.cell.summary import summary_of
from truearm.cli import main
from truearm.errors import InputError, WorkError


@pytest.fixture
def recorded(tmp_path):
    return Recorded(tmp_path)


@pytest.mark.parametrize("until", ["registration", "pose 8 stored"])
def test_an_instrument_that_was_moved_is_noticed_before_anything_else_is_measured(recorded, until):
    recorded.killed(until=until)
    with recorded.read() as session:
        before = session.measured_poses()
    for _ in range(2):
        with pytest.raises(WorkError, match=r"the first contact is now 20\.00 mm from where it was"):
            recorded.measure("moved")
    with recorded.read() as session:
        assert session.measured_poses() == before


def test_a_session_goes_on_once_all_is_in_its_place_again(recorded):
    recorded.killed(until="pose 8 stored")
    told, end = recorded.measure()
    assert end == DONE
    assert told[0].startswith("check ")
    with recorded.read() as session:
        assert session.measured_poses() == COUNT
        assert unsure_steps(session) == []
        assert "group" not in accepted_table(session).columns


def test_steps_that_are_left_keep_their_readings_and_remarks(recorded):
    recorded.killed(until="pose 3 stored")
    cell = Cell.from_toml(CELL.replace("FILE", str(recorded.folder / "there.csv")))
    with Session(recorded.session, writing=True) as session:
        step = session.next_step()
        assert step is not None
        reading = Reading(np.ones(3), 1e-4, 0.0, True, "kept")
        session.add_reading(step.step, 1, reading, step.readings, np.zeros(3))
        session.add_event("device", "remark", step.step)
    for _ in range(2):
        with open_session(recorded.session, cell, recorded.poses) as session:
            session.check_next()
            steps = list(islice(session.steps_left(), COUNT - 1))
            kinds = [each.kind for each in steps]
            assert kinds == ["check", *["pose"] * (COUNT - 3), "check"]
            assert [each.step for each in steps] == list(range(step.step, step.step + len(steps)))
            assert [each.point for each in session.readings_of(step.step + 1)] == [(1.0, 1.0, 1.0)]
            assert session.rows("SELECT step FROM events WHERE message = 'remark'") == [(step.step + 1,)]


def contacts(recorded):
    with recorded.read() as session:
        return [step.pose for step in session.steps("registration")]


def test_a_check_that_cannot_be_measured_does_not_let_a_session_go_on(recorded):
    recorded.killed(until="pose 8 stored")
    recorded.without(contacts(recorded))
    with pytest.raises(WorkError, match="the first contact could not be measured again"):
        recorded.measure("without")
    assert recorded.measure()[1] == DONE


def test_another_contact_is_checked_where_the_first_cannot_be_measured_again(recorded):
    recorded.killed(until="pose 8 stored")
    first, second, *_ = contacts(recorded)
    recorded.without([first])
    told, end = recorded.measure("without")
    assert end == DONE
    assert told[0].startswith(f"check {first + 1} skipped")
    assert told[1].startswith(f"check {second + 1} stored")
    with recorded.read() as session:
        assert [step.pose for step in session.steps("check")] == [first, second, first, second]
        assert session.measured_poses() == COUNT - (first >= 8)
        summary = summary_of(session)
    assert summary["checks"] == {"measured": 2, "skipped": 2}
    assert summary["unchecked"] == []


def test_poses_behind_which_no_contact_could_be_measured_again_are_told(recorded, capsys):
    recorded.killed(until=f"pose {COUNT} stored")
    cell = Cell.from_toml(CELL.replace("FILE", str(recorded.folder / "there.csv")))
    with Session(recorded.session, writing=True) as session:
        for _ in contacts(recorded):
            step = session.next_step()
            assert step is not None
            session.add_outcome(step.step, "skipped", reason="no way")
            session.check_elsewhere(step.step)
        assert session.next_step() is None
    with open_session(recorded.session, cell, recorded.poses) as session:
        assert Process(cell, session, lambda _: None).run() == DONE
    output = recorded.folder / "out.csv"
    for command in (["show"], ["export", "-o", str(output)]):
        assert main(["session", command[0], str(recorded.session), *command[1:]]) == 0
        said = " ".join("".join(capsys.readouterr()).split())
        assert "and 10 more: nothing says whether something moved" in said
    with recorded.read() as session:
        assert summary_of(session)["unchecked"] == list(range(1, COUNT + 1))


def test_what_was_refused_or_met_its_target_is_not_added_to(recorded):
    refused = CELL.replace("registration_mm = 300", "registration_mm = 0.001")
    for _ in range(2):
        with pytest.raises(WorkError, match="implausible"):
            recorded.measure(text=refused)
        with recorded.read() as session:
            assert len(session.steps("check")) == 1
    recorded.session.unlink()
    enough = CELL.replace("stretch = 0", "stretch = 2\ntarget_mm = 1000")
    for _ in range(2):
        assert recorded.measure(text=enough)[1] == ACCURATE
        with recorded.read() as session:
            assert len(session.steps("check")) == 1


def test_what_was_measured_before_a_failed_check_is_a_set_up_of_its_own(recorded, capsys):
    text = f"{CELL}check_every = 5\n"
    recorded.killed(until="pose 8 stored", text=text)
    with pytest.raises(WorkError, match="the first contact is now"):
        recorded.measure("moved", text=text)
    recorded.measure(text=text)
    output = recorded.folder / "out.csv"
    assert main(["session", "export", str(recorded.session), "-o", str(output), "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["moved"] == [6, 7, 8]
    assert "Warning: poses 6, 7 and 8: something moved" in said.err
    data = ta.Measurements.read_csv(output)
    place, moved = data.groups
    assert moved == f"{place}, moved 1"
    np.testing.assert_array_equal(np.flatnonzero(data.group == moved), [5, 6, 7])
    with recorded.read() as session:
        assert len(measurements_of(session)) == COUNT - 3
    again = recorded.folder / "again.csv"
    assert main(["session", "export", str(recorded.session), "-o", str(again), "--json"]) == 0
    assert again.read_bytes() == output.read_bytes()


@pytest.mark.parametrize(("group", "common"), [(None, set()), ("hall 2", {"hall 2"})])
def test_sessions_in_which_something_moved_share_no_more_than_what_their_poses_are_meant_for(
    group, common, tmp_path
):
    groups, tables = [], []
    for day in ("monday", "tuesday"):
        (tmp_path / day).mkdir()
        recorded = Recorded(tmp_path / day)
        recorded.poses = replace(recorded.poses, group=group)
        text = f"{CELL}check_every = 5\n"
        recorded.killed(until="pose 8 stored", text=text)
        with pytest.raises(WorkError, match="the first contact is now"):
            recorded.measure("moved", text=text)
        recorded.measure(text=text)
        with recorded.read() as session:
            tables.append(accepted_table(session).drop(columns=["step", "pose"]))
        groups.append(set(tables[-1]["group"]))
    both = ta.Measurements.concatenate([ta.Measurements.from_dataframe(table) for table in tables])
    assert [len(each) for each in groups] == [2, 2]
    assert groups[0] & groups[1] == common
    assert len(both.groups) == 4 - len(common)


def test_a_session_that_has_lost_when_it_began_cannot_name_what_moved(recorded):
    recorded.killed(until="pose 8 stored")
    with pytest.raises(WorkError, match="the first contact is now"):
        recorded.measure("moved")
    with closing(sqlite3.connect(recorded.session, isolation_level=None)) as older:
        older.execute("DELETE FROM meta WHERE key = 'created_s'")
    with recorded.read() as session, pytest.raises(InputError, match="meta holds no created_s"):
        accepted_table(session)


def test_a_finished_session_whose_last_check_failed_says_so_again(recorded):
    table = pd.read_csv(recorded.folder / "there.csv")
    cell = Cell.from_toml(CELL.replace("FILE", str(recorded.folder / "there.csv")))
    with open_session(recorded.session, cell, recorded.poses) as session:
        first = session.steps("check")[-1].pose
    # The recording has the first contact a third time, elsewhere: as its contact, its pose and its check.
    moved = table.iloc[[first]].assign(x=table["x"][first] + 0.02)
    pd.concat([table, table.iloc[[first]], moved]).to_csv(recorded.folder / "at_last.csv", index=False)
    for _ in range(2):
        with pytest.raises(WorkError, match="the first contact is now 20"):
            recorded.measure("at_last")
    with recorded.read() as session:
        assert session.measured_poses() == COUNT


def test_a_session_keeps_the_set_up_that_its_poses_are_meant_for(recorded, tmp_path):
    readings = {f"q{j + 1}": column for j, column in enumerate(recorded.poses.readings.T)}
    pd.DataFrame(readings).assign(group="hall 2").to_csv(tmp_path / "poses.csv", index=False)
    arm = ta.Robot.load("ur10e")
    plain, recorded.poses = recorded.poses, Poses.read_csv(tmp_path / "poses.csv", arm)
    recorded.measure()
    with recorded.read() as session:
        assert measurements_of(session).groups == ["hall 2"]
    with closing(sqlite3.connect(recorded.session, isolation_level=None)) as older:
        older.execute("DELETE FROM meta WHERE key = 'group'")
    assert recorded.measure()[1] == DONE
    recorded.poses = plain
    with pytest.raises(InputError, match="another set-up"):
        recorded.measure()
    pd.DataFrame(readings).assign(group=["a", "b"] * (COUNT // 2)).to_csv(tmp_path / "two.csv", index=False)
    with pytest.raises(InputError, match='column "group" holds "a" and "b".*one set-up at a time'):
        Poses.read_csv(tmp_path / "two.csv", arm)


def test_without_a_guess_of_the_frame_no_contact_is_suspicious(recorded):
    told, _ = recorded.measure()
    contacts = [text for text in told if text.startswith("registration")]
    assert len(contacts) == 8
    assert not any("prediction" in text for text in contacts)
    assert any("from the prediction" in text for text in told)
    with recorded.read() as session:
        assert all(len(session.readings_of(step.step)) == 1 for step in session.steps("registration"))


def test_a_calibration_so_far_that_fails_ends_no_session(recorded, monkeypatch):
    monkeypatch.setattr("truearm.cell.stretches.calibrate", Mock(side_effect=ValueError("no norm")))
    assert recorded.measure(text=CELL.replace("stretch = 0", "stretch = 15"))[1] == DONE
    with recorded.read() as session:
        notes = session.rows("SELECT message FROM events WHERE kind = 'calibration'")
    assert notes == [("not yet: ValueError: no norm",)]
