"""What is stopped stays stopped, what fails at one pose does not keep a session from going on."""

import dataclasses
import os
import signal
import threading
import time
from unittest.mock import Mock

import numpy as np
import pytest

from tests.cell_support import cell_text, poses_of
from truearm.cell import (
    Cell,
    DeviceGoneError,
    DeviceSilentError,
    EmergencyStopError,
    PortUnavailableError,
    ProtectiveStopError,
    Reading,
    RefusedError,
    StoppedError,
    rehearsal,
)
from truearm.cell.clearance import Clearance
from truearm.cell.crew import Crew
from truearm.cell.examples import example
from truearm.cell.line_port import LinePort
from truearm.cell.measuring import DONE, GIVEN_UP_IN_A_ROW, Process
from truearm.cell.opening import open_session
from truearm.cell.poses_file import Poses
from truearm.cell.running import run
from truearm.cell.session import Session
from truearm.robot import Robot


def test_a_robot_is_not_connected_once_the_process_is_to_end():
    halted, cell = threading.Event(), Mock(arm=Robot.load("rv-m2"))
    cell.sensor.connect.side_effect = halted.set
    crew = Crew(cell, Mock(), halted)
    for begin in (crew.connect, crew.recover):
        with pytest.raises(StoppedError):
            begin()
    cell.sensor.release.assert_not_called()
    cell.robot.connect.assert_not_called()


def test_no_further_place_is_gone_to_once_the_process_is_to_end():
    halted, cell = threading.Event(), Mock(arm=Robot.load("rv-m2"))
    cell.robot.move_joints.side_effect = lambda _: halted.set()
    with pytest.raises(StoppedError):
        Crew(cell, Mock(), halted).go([np.zeros(5), np.ones(5)], Mock(), None)
    assert cell.robot.move_joints.call_count == 1
    cell.sensor.prepare.assert_not_called()


def test_the_arm_is_stopped_before_its_port_is_closed():
    cell = Mock(arm=Robot.load("rv-m2"))
    cell.robot.read_joints.return_value = np.zeros(5)
    Crew(cell, Mock(), threading.Event()).recover()
    assert [call[0] for call in cell.robot.method_calls[:3]] == ["stop", "close", "connect"]


def test_opening_a_port_does_not_undo_a_stop(monkeypatch):
    monkeypatch.setattr("truearm.cell.line_port.open_channel", Mock())
    port = LinePort("device", "tcp://host:1", 0.1)
    port.interrupt()
    port.open()
    with pytest.raises(StoppedError):
        port.receive()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_every_request_to_end_halts_the_process(number):
    halted = threading.Event()

    def work():
        os.kill(os.getpid(), number)
        halted.wait(5.0)
        raise StoppedError("the process was ended")

    # As it is without nohup, whatever the tests were started by.
    before = signal.signal(number, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            run(Mock(run=work, halt=halted.set))
    finally:
        signal.signal(number, before)
    assert halted.is_set()


def test_a_hang_up_that_nohup_hides_stays_hidden():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:

        def work():
            os.kill(os.getpid(), signal.SIGHUP)
            return DONE

        assert run(Mock(run=work)) == DONE
    finally:
        signal.signal(signal.SIGHUP, before)


def test_joints_start_beside_a_pose_by_degrees_where_they_turn_and_by_millimetres_where_they_slide():
    text = example("playback").replace('"ur10"', '"adept-cobra-600"')
    cell, readings = Cell.from_toml(text), np.array([0.1, 0.2, 0.1, 0.3])
    for side in (1, -1):
        away = side * (readings - cell.beside(readings, side))
        np.testing.assert_allclose(away, [np.radians(3.0), np.radians(3.0), 3e-3, np.radians(3.0)])
    np.testing.assert_array_equal(cell.beside(cell.arm.limits[:, 0], 1), cell.arm.limits[:, 0])


def test_the_place_beside_a_pose_is_rehearsed_too(monkeypatch):
    cell = Cell.from_toml(cell_text(process={"check_every": 0}))
    poses = poses_of(cell, 8, approach=[0, 1] * 4)
    besides = [cell.beside(readings, 1) for readings in poses.readings]

    class Near(Clearance):
        def meets(self, readings, carriage, world_from_base):
            return 1e-3 if any(np.array_equal(readings, each) for each in besides) else None

    monkeypatch.setattr(rehearsal, "Clearance", Near)
    found = rehearsal.rehearse(cell, poses)
    assert {each.step.pose for each in found.refused} == {1, 3, 5, 7}
    for each in found.steps:
        assert (each.beside is None) == (each.step.approach == 0)
        assert ("beside it" in each.problem) == (each.step.approach == 1)


class Instrument:
    """Measures an arm perfectly, but fails with an error wherever `fails` says so."""

    name = address = "instrument"

    def __init__(self, arm, fails):
        self._arm, self._fails = arm, fails
        self.connect = self.release = self.stop = self.close = lambda: None

    def go_away(self, until):
        """Refuse connections until a time; the error that tells that it has gone."""

        def connect():
            if time.monotonic() < until:
                raise PortUnavailableError("no connection", where=self.name)

        self.connect = connect
        return DeviceGoneError("the connection ended", where=self.name)

    def prepare(self, expected):
        self._readings = expected.readings

    def measure(self):
        error = self._fails(self._readings)
        if error is not None:
            raise error
        return Reading(self._arm.position(self._readings), 1e-5, time.time(), True, "raw")


def measured_with(folder, fails, count=12, *, tell=lambda _: None, recovery_s=2.0, repeats=()):
    """A session of poses in which the first joint tells the number of the pose; how it ended.

    The last poses are those of `repeats` again, from another side.
    """
    cell = Cell.from_toml(f"{example('playback')}recovery_s = {recovery_s}\n")
    readings = np.random.default_rng(0).uniform(-1.0, 1.0, (count, 6))
    readings[:, 0] = 0.1 * np.arange(count)
    poses = Poses(
        np.concatenate([readings, readings[list(repeats)]]),
        np.repeat([0, 1], [count, len(repeats)]),
        ("",) * (count + len(repeats)),
    )

    def at(place):
        return fails(round(10.0 * place[0]))

    cell = dataclasses.replace(cell, sensor=Instrument(cell.arm, at))
    with open_session(folder / "session.db", cell, poses) as session:
        return Process(cell, session, tell).run()


class Restarting:
    """Fails once at pose 5, and refuses connections for a while then."""

    def __init__(self, away_s, monkeypatch):
        self.away_s = away_s
        self.told: list[str] = []
        self.made: list[Instrument] = []
        build = Instrument.__init__

        def building(instrument, *given):
            self.made.append(instrument)
            build(instrument, *given)

        monkeypatch.setattr(Instrument, "__init__", building)

    def __call__(self, pose):
        if pose != 5 or not self.away_s:
            return None
        until, self.away_s = time.monotonic() + self.away_s, 0.0
        return self.made[-1].go_away(until)

    def tell(self, progress):
        self.told.append(progress.text)


def test_a_device_that_starts_anew_is_waited_for_longer_each_time(tmp_path, monkeypatch):
    fails = Restarting(0.5, monkeypatch)
    assert measured_with(tmp_path, fails, tell=fails.tell, recovery_s=0.1) == DONE
    assert skipped(tmp_path) == {}
    waits = [text.partition(":")[0] for text in fails.told if text.startswith("connecting anew")]
    assert waits[:2] == [
        "connecting anew in 0.1 s, then 3 times more",
        "connecting anew in 0.2 s, then 2 times more",
    ]


def test_a_wait_for_a_device_ends_with_the_process(tmp_path, monkeypatch):
    fails, made, begin = Restarting(100.0, monkeypatch), [], Process.__init__

    def beginning(process, *given):
        made.append(process)
        begin(process, *given)

    def tell(progress):
        if progress.text.startswith("connecting anew"):
            threading.Timer(0.1, made[-1].halt).start()

    monkeypatch.setattr(Process, "__init__", beginning)
    began = time.monotonic()
    with pytest.raises(StoppedError):
        measured_with(tmp_path, fails, tell=tell, recovery_s=60.0)
    assert time.monotonic() - began < 10.0


def skipped(folder):
    with Session(folder / "session.db", writing=False) as session:
        rows = session.rows(
            "SELECT pose, reason FROM outcomes JOIN steps USING (step) "
            "WHERE kind = 'pose' AND outcome = 'skipped'"
        )
    return dict(rows)


def test_a_pose_at_which_a_device_fails_each_time_is_skipped(tmp_path):
    hidden = {3, 7}

    def fails(pose):
        return DeviceSilentError("no target", where="tracker") if pose in hidden else None

    assert measured_with(tmp_path, fails) == DONE
    found = skipped(tmp_path)
    assert set(found) == hidden
    assert found[3] == "tried 6 times: tracker: no target."


def test_a_device_that_fails_at_all_poses_ends_the_process(tmp_path):
    with pytest.raises(DeviceSilentError, match="no target"):
        measured_with(tmp_path, lambda _: DeviceSilentError("no target", where="tracker"))
    with Session(tmp_path / "session.db", writing=False) as session:
        assert len(session.rows("SELECT step FROM outcomes")) == GIVEN_UP_IN_A_ROW


@pytest.mark.parametrize(("kind", "stops"), [(ProtectiveStopError, 1), (EmergencyStopError, 2)])
def test_a_pose_at_which_the_arm_was_stopped_is_skipped_later(kind, stops, tmp_path):
    def fails(pose):
        # The frame is registered at the same poses.
        measuring = (tmp_path / "session.db").exists() and registered(tmp_path)
        return kind("the arm stopped", where="arm") if pose == 5 and measuring else None

    for _ in range(stops):
        with pytest.raises(kind):
            measured_with(tmp_path, fails)
    assert measured_with(tmp_path, fails) == DONE
    assert list(skipped(tmp_path)) == [5]


def test_no_step_leads_again_to_where_the_arm_stopped_itself(tmp_path):
    told: list[str] = []

    def fails(pose):
        measuring = (tmp_path / "session.db").exists() and registered(tmp_path)
        return ProtectiveStopError("the arm stopped", where="arm") if pose == 5 and measuring else None

    with pytest.raises(ProtectiveStopError):
        measured_with(tmp_path, fails, repeats=[4, 5])
    ends = measured_with(tmp_path, fails, tell=lambda now: told.append(now.text), repeats=[4, 5])
    assert ends == DONE
    assert list(skipped(tmp_path)) == [5, 13]
    assert told[0] == "2 steps to places that stops kept the arm from will be skipped"


def test_a_contact_at_which_the_arm_stopped_itself_is_not_gone_to_again_nor_is_its_pose(tmp_path):
    gone: list[int] = []

    def fails(pose):
        gone.append(pose)
        return ProtectiveStopError("the arm stopped", where="arm") if pose == gone[0] else None

    with pytest.raises(ProtectiveStopError):
        measured_with(tmp_path, fails)
    assert measured_with(tmp_path, fails) == DONE
    assert gone.count(gone[0]) == 1
    assert list(skipped(tmp_path)) == [gone[0]]


def test_a_check_is_made_elsewhere_where_the_arm_stopped_itself_at_its_contact(tmp_path):
    gone: list[int] = []

    def fails(pose):
        gone.append(pose)
        measuring = (tmp_path / "session.db").exists() and registered(tmp_path)
        return ProtectiveStopError("the arm stopped", where="arm") if pose == gone[0] and measuring else None

    with pytest.raises(ProtectiveStopError):
        measured_with(tmp_path, fails)
    before = len(gone)
    assert measured_with(tmp_path, fails) == DONE
    assert gone[0] not in gone[before:]


def registered(folder):
    with Session(folder / "session.db", writing=False) as session:
        return session.registration() is not None


def test_what_answers_a_stop_is_no_refusal_of_the_pose(tmp_path, monkeypatch):
    made, begin = [], Process.__init__

    def beginning(process, *given):
        made.append(process)
        begin(process, *given)

    def fails(pose):
        if pose != 5:
            return None
        made[-1].halt()
        return RefusedError("aborted", where="arm")

    monkeypatch.setattr(Process, "__init__", beginning)
    with pytest.raises(StoppedError):
        measured_with(tmp_path, fails)
    with Session(tmp_path / "session.db", writing=False) as session:
        assert session.rows("SELECT step FROM outcomes WHERE outcome = 'skipped'") == []
