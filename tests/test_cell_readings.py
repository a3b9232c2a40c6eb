"""What drivers give: readings checked where they arrive, stops that stop, recordings that come in turn."""

import dataclasses
import json
import threading
import time
from unittest.mock import Mock

import numpy as np
import pytest

import truearm as ta
from truearm.cell import Cell, DeviceError, Expected, Reading, StoppedError
from truearm.cell.conformance import ConformanceError, check_robot, check_sensor
from truearm.cell.crew import Crew
from truearm.cell.device_errors import Calls
from truearm.cell.examples import example
from truearm.cell.playback import PlaybackRobot, PlaybackSensor
from truearm.cell.reading import checked_reading
from truearm.cell.session import Session, Step
from truearm.errors import InputError
from truearm.simulation import VirtualArm

GOOD = Reading(np.array([0.1, 0.2, 0.3]), 1e-5, 0.0, True, "raw", features={"humidity": 40.0})
TAKES_S = 0.6
PLACES = [np.zeros(6), np.full(6, 0.5)]


def changed(**parts):
    return dataclasses.replace(GOOD, **parts)


def test_numbers_of_numpy_and_lists_are_taken_and_can_be_kept(tmp_path):
    reading = changed(
        point_in_world=[0.1, 0.2, 0.3],
        sigma_m=np.float32(1e-5),
        time_s=np.int64(7),
        valid=np.True_,
        temperature_c=np.float32(21.5),
        features={"humidity": np.float32(40.0), "count": np.int64(3)},
    )
    checked = checked_reading(reading)
    assert type(checked.sigma_m) is type(checked.temperature_c) is float
    assert checked.valid is True
    with Session.create(tmp_path / "s.db", [Step(0, "pose", 0, "", 0, np.zeros(6))], {}) as session:
        session.add_reading(0, 1, checked, np.zeros(6), np.zeros(3))
        query = "SELECT typeof(sigma_m), typeof(temperature_c), features FROM readings"
        (*kinds, features) = session.rows(query)[0]
    assert kinds == ["real", "real"]
    assert json.loads(features) == {"humidity": 40.0, "count": 3.0}


def test_a_point_that_is_not_finite_is_a_reading_that_failed():
    checked = checked_reading(changed(point_in_world=np.array([0.0, np.nan, 0.0])))
    assert (checked.valid, checked.point_in_world) == (False, None)
    assert "not finite" in checked.reason


@pytest.mark.parametrize("sigma_m", [0.0, None, -1.0, np.nan, np.inf, "none", 10**400])
def test_where_nothing_was_measured_its_standard_deviation_does_not_matter(sigma_m, tmp_path):
    failed = changed(point_in_world=None, valid=False, reason="no target", sigma_m=sigma_m)
    checked = checked_reading(failed)
    assert (checked.valid, checked.reason, checked.sigma_m) == (False, "no target", 0.0)
    assert checked_reading(dataclasses.replace(failed, sigma_m=1e-5)).sigma_m == 1e-5
    with Session.create(tmp_path / "s.db", [Step(0, "pose", 0, "", 0, np.zeros(6))], {}) as session:
        session.add_reading(0, 1, checked, np.zeros(6), np.zeros(3))
    with pytest.raises(DeviceError, match="sigma_m is "):
        checked_reading(changed(sigma_m=sigma_m))


@pytest.mark.parametrize(
    ("reading", "message"),
    [
        (None, "measure gave None"),
        (changed(point_in_world=None), "a valid reading has no point"),
        (changed(point_in_world=np.zeros((1, 3))), r"point_in_world has the shape \(1, 3\)"),
        (changed(point_in_world="here"), "point_in_world is 'here'"),
        (changed(sigma_m=None), "sigma_m is None"),
        (changed(sigma_m=0.0), "sigma_m is 0"),
        (changed(sigma_m=np.nan), "sigma_m is nan"),
        (changed(time_s=np.inf), "time_s is inf"),
        (changed(valid="yes"), "valid is 'yes'"),
        (changed(raw=b"\x00"), "raw is b"),
        (changed(temperature_c="warm"), "temperature_c is 'warm'"),
        (changed(features={"who": "me"}), "feature \"who\" is 'me'"),
        (changed(features={"distance": 1.0}), "a feature is called 'distance'"),
        (changed(features={"q1": 1.0}), "a feature is called 'q1'"),
        (changed(pose_in_world=np.zeros((4, 4))), "pose_in_world is no turn and place"),
    ],
)
def test_what_is_no_reading_names_the_driver_and_is_not_tried_again(reading, message):
    device = Mock(address="there")
    device.name = "own sensor"
    with pytest.raises(DeviceError, match=f"own sensor at there: {message}") as raised, Calls(device):
        checked_reading(reading)
    assert not raised.value.recoverable


def test_errors_of_the_system_name_the_device_that_let_them_through():
    cell = Mock(arm=ta.Robot.load("ur10e"))
    cell.robot.name, cell.robot.address = "own robot", "here"
    cell.robot.move_joints.side_effect = TimeoutError("t")
    with pytest.raises(DeviceError, match="own robot at here: TimeoutError: t") as raised:
        Crew(cell, Mock(), threading.Event()).go([np.zeros(6)], Mock(), None)
    assert raised.value.recoverable


def test_errors_of_a_driver_itself_name_the_device_and_the_line_and_are_not_tried_again():
    cell = Mock(arm=ta.Robot.load("ur10e"))
    cell.robot.name, cell.robot.address = "own robot", "here"
    cell.robot.move_joints.side_effect = lambda _: int("fast")
    with pytest.raises(
        DeviceError, match="own robot at here: its driver failed: ValueError: .*'fast'"
    ) as raised:
        Crew(cell, Mock(), threading.Event()).go([np.zeros(6)], Mock(), None)
    assert "(test_cell_readings.py, line " in str(raised.value)
    assert "truearm.cell.conformance" in str(raised.value)
    assert not raised.value.recoverable


def test_joints_may_be_a_list_of_as_many_numbers_as_the_arm_has():
    cell = Mock(arm=ta.Robot.load("ur10e"))
    cell.robot.name = "own robot"
    cell.robot.read_joints.return_value = [0.5] * 6
    np.testing.assert_array_equal(
        Crew(cell, Mock(), threading.Event()).go([np.zeros(6)], Mock(), None), [0.5] * 6
    )
    cell.robot.read_joints.return_value = np.zeros(3)
    with pytest.raises(DeviceError, match="own robot: it reads its joints as"):
        Crew(cell, Mock(), threading.Event()).connect()


@pytest.mark.parametrize("name", ["distance", "pose", "q1", "sigma_mm", "group", "readings"])
def test_a_group_of_an_answer_may_not_be_called_like_a_column(name):
    text = example("tracker").replace("(?P<ok>", f"(?P<{name}>")
    with pytest.raises(InputError, match=rf"sensor, answer: group \(\?P<{name}>.*another name"):
        Cell.from_toml(text)


class Slow(PlaybackRobot):
    """A robot whose motions take time and can be stopped."""

    def __init__(self):
        super().__init__(PlaybackRobot.Settings(), ta.Robot.load("ur10e"))
        self.stopped = threading.Event()

    def move_joints(self, readings):
        self.stopped.clear()
        if self.stopped.wait(TAKES_S):
            raise StoppedError("stopped", where=self.name)
        super().move_joints(readings)

    def stop(self):
        self.stopped.set()


class Unstopped(Slow):
    def stop(self): ...


class Stubborn(Slow):
    """It says that it was stopped, and goes on to its place."""

    def move_joints(self, readings):
        try:
            super().move_joints(readings)
        except StoppedError:
            PlaybackRobot.move_joints(self, readings)
            raise


class Quiet(Slow):
    """It stops, and does not say so."""

    def move_joints(self, readings):
        self.stopped.clear()
        if not self.stopped.wait(TAKES_S):
            PlaybackRobot.move_joints(self, readings)


def test_a_robot_that_stops_on_its_way_is_let_through_each_time():
    for _ in range(2):
        assert "a stop from another thread" in check_robot(Slow, PLACES)[-1]


@pytest.mark.parametrize(
    ("robot", "message"),
    [(Unstopped, "no StoppedError"), (Stubborn, "went on to its place"), (Quiet, "no StoppedError")],
)
def test_conformance_finds_a_stop_that_does_not_stop(robot, message):
    with pytest.raises(ConformanceError, match=message):
        check_robot(robot, PLACES)


def test_motions_that_are_too_short_to_be_stopped_are_told():
    arm = ta.Robot.load("ur10e")
    with pytest.raises(ConformanceError, match="give places farther apart"):
        check_robot(lambda: PlaybackRobot(PlaybackRobot.Settings(), arm), PLACES)


def recording(path):
    """A recording of one pose, from below, from above and from below again."""
    arm = VirtualArm(ta.Robot.load("ur10e"), seed=1)
    table = arm.measure_table(np.repeat(arm.poses(1), 3, axis=0))
    table.assign(x=[0.1, 0.2, 0.3], approach=[1, -1, 1]).to_csv(path, index=False)
    settings = PlaybackSensor.Settings(file=path)
    return PlaybackSensor(settings, arm.robot), arm.poses(1)[0]


def played(sensor, readings, side):
    sensor.prepare(Expected(readings, np.zeros(3), np.inf, np.zeros(3), side))
    return round(float(sensor.measure().point_in_world[0]), 9)


def test_recorded_rows_of_a_pose_come_in_turn_when_it_is_come_back_to(tmp_path):
    sensor, readings = recording(tmp_path / "recorded.csv")
    sensor.connect()
    assert [played(sensor, readings, 0) for _ in range(4)] == [0.1, 0.2, 0.3, 0.1]


def test_recorded_rows_are_of_the_side_that_a_pose_is_come_to_from(tmp_path):
    sensor, readings = recording(tmp_path / "recorded.csv")
    sensor.connect()
    assert [played(sensor, readings, side) for side in (-1, 1, -1, 1, 1)] == [0.2, 0.1, 0.2, 0.3, 0.1]


def test_conformance_finds_readings_that_are_none(tmp_path, monkeypatch):
    sensor, readings = recording(tmp_path / "recorded.csv")
    bad = changed(time_s=time.time(), features={"who": "me"})
    monkeypatch.setattr(PlaybackSensor, "measure", lambda _: bad)
    expected = Expected(readings, np.zeros(3), np.inf, np.zeros(3))
    with pytest.raises(ConformanceError, match="feature \"who\" is 'me'"):
        check_sensor(lambda: sensor, expected)
