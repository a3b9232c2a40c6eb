"""Virtual trackers that lose their target, from their lines to the status of `truearm measure`."""

from pathlib import Path

import numpy as np
import pytest

from tests.cell_support import cell_text, poses_of, virtual, write_poses
from truearm.cell import Cell
from truearm.cell.line_sensor import LineSensor
from truearm.cell.session import Session
from truearm.cell.summary import summary_of
from truearm.cell.virtual.launch import VirtualCell
from truearm.cell.virtual.line_devices import line_without_point
from truearm.cell.virtual.world import World
from truearm.cli import main
from truearm.errors import InputError

XYZ = r"^(?P<x>[-\d.]+),(?P<y>[-\d.]+),(?P<z>[-\d.]+)$"
PROCESS = {"check_every": 0, "attempts": 2}


def tracker(missed=0.0, **sensor):
    return cell_text(
        "tracker", sensor={"average": 1, **sensor}, simulate={"faults": {"missed": missed}}, process=PROCESS
    )


@pytest.mark.parametrize(
    ("sensor", "line"),
    [
        ({}, "0.0000,0.0000,0.0000,0"),
        ({"answer": XYZ, "nothing": r"^NO\s+TARGET$"}, "NO TARGET"),
        ({"nothing": "^NO TARGET$"}, "0.0000,0.0000,0.0000,0"),
    ],
)
def test_a_virtual_tracker_says_that_it_sees_nothing_as_its_lines_can(sensor, line):
    cell = Cell.from_toml(tracker(**sensor))
    assert isinstance(cell.sensor_settings, LineSensor.Settings)
    assert line_without_point(cell.sensor_settings, cell.file.simulate) == line


@pytest.mark.parametrize("nothing", [{}, {"nothing": "^(NO|LOST) TARGET$"}])
def test_a_fault_that_the_lines_cannot_tell_is_refused(nothing):
    sensor = {"answer": XYZ, **nothing}
    text = cell_text("tracker", sensor=sensor, simulate={"answer": "{x},{y},{z}"})
    VirtualCell(text)
    with pytest.raises(InputError, match="missed is 0.5, and no line of this sensor.*group ok in `answer`"):
        VirtualCell(cell_text("tracker", sensor=sensor, simulate={"faults": {"missed": 0.5}}))


def test_a_target_that_is_missed_now_and_then_costs_attempts(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # A tracker that streams draws anew each run: 50 attempts leave one pose in 1e15 without a valid reading.
    text = cell_text(
        "tracker",
        sensor={"average": 1},
        simulate={"faults": {"missed": 0.5}},
        process={"check_every": 0, "attempts": 50},
    )
    assert measure(text, 18) == 0
    found = summary()
    assert found["measured"] == 18
    assert found["invalid_readings"] > 0


def test_a_target_that_is_never_seen_ends_the_command_with_an_error(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert measure(tracker(missed=1.0), 8) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "5 contacts for the frame in a row had no valid reading; the last: the instrument" in said
    assert summary()["readings"] == 0


def test_a_target_that_is_lost_on_the_way_is_told_and_measured_later(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    tracked = World.tracked

    def lost(world, now):
        if not (tmp_path / "session.db").exists():
            return tracked(world, now)
        with Session(tmp_path / "session.db", writing=False) as session:
            return None if session.measured_poses() >= 4 else tracked(world, now)

    monkeypatch.setattr(World, "tracked", lost)
    assert measure(tracker(), 12) == 1
    assert "5 poses in a row had no valid reading" in " ".join(capsys.readouterr().err.split())
    found = summary()
    assert (found["measured"], found["open"], found["skipped"]) == (4, 8, [])
    monkeypatch.setattr(World, "tracked", tracked)
    assert measure(tracker(), 12) == 0
    assert summary()["measured"] == 12


def measure(text, count):
    """The status of measuring poses in a virtual cell, into session.db."""
    write_poses("poses.csv", poses_of(Cell.from_toml(text), count, approach=np.zeros(count, dtype=np.int64)))
    with virtual(text) as (_, found):
        Path("cell.toml").write_text(found)
        return main(["measure", "cell.toml", "poses.csv", "-o", "session.db"])


def summary():
    with Session(Path("session.db"), writing=False) as session:
        return summary_of(session)
