"""Drivers against virtual devices over their wires: the shipped conformance test, and what each must do."""

import time
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from unittest.mock import Mock, patch

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from tests.cell_support import cell_text, measured, merge, possible_readings, virtual
from truearm.cell import (
    Cell,
    Connected,
    EmergencyStopError,
    Expected,
    Managed,
    RefusedError,
    StoppedError,
    movemaster,
)
from truearm.cell.channels import ConnectionEndedError
from truearm.cell.conformance import ConformanceError, check_robot, check_sensor
from truearm.cell.device_errors import DeviceGoneError
from truearm.cell.drivers import ROBOTS, SENSORS
from truearm.cell.line_sensor import LineSensor
from truearm.cell.playback import PlaybackRobot, PlaybackSensor
from truearm.cell.poses_file import Poses
from truearm.cell.prediction import Prediction
from truearm.cell.session import Session, Step
from truearm.cell.summary import summary_of
from truearm.cell.table_panel import TablePanel
from truearm.cell.virtual.launch import release_emergency_stop
from truearm.files import parsed
from truearm.robot import Robot
from truearm.simulation import VirtualArm

SLOW = 5.0
"""Times as fast as real: motions last long enough to be stopped."""
SIX_PLACES = [np.full(6, 0.1), np.radians([60.0, -40.0, 80.0, 10.0, 20.0, 30.0])]
FIVE_PLACES = [np.radians([0.0, 60.0, -100.0, 0.0, 0.0]), np.radians([90.0, 30.0, -60.0, 10.0, 20.0])]
LINE_ROBOT = {
    "driver": "line",
    "port": "tcp://127.0.0.1:1",
    "move": "MOVE " + " ".join(f"{{q{j}:.5f}}" for j in range(1, 7)),
    "where": "POS?",
    "joints": "^POS " + " ".join(rf"(?P<q{j}>\S+)" for j in range(1, 7)) + "$",
    "stop": "HALT",
}


def texts():
    """Cells by name: every driver and both ways of asking an instrument."""
    line = parsed(cell_text("tracker"), where="line")
    line["robot"] = LINE_ROBOT
    return {
        "rv-m2": (cell_text("rv-m2"), FIVE_PLACES),
        "ur": (cell_text("ur"), SIX_PLACES),
        "line": (tomli_w.dumps(line), SIX_PLACES),
        "trigger": (cell_text("tracker", sensor={"trigger": "MEASURE", "average": 2}), SIX_PLACES),
    }


def test_a_target_at_a_limit_is_not_sent_beyond_it():
    with virtual(cell_text("ur", arm="abb-irb-120")) as (_, found):
        robot = Cell.from_toml(found).robot
        limit = Robot.load("abb-irb-120").limits[3, 1]
        assert round(limit, 6) > limit
        with Connected(robot):
            robot.move_joints(np.array([0.0, 0.1, 0.1, limit, 0.1, 0.0]))
            assert abs(robot.read_joints()[3] - limit) < 2e-6


def test_a_pose_beside_a_limit_is_approached_within_it(tmp_path):
    text = cell_text("tracker", arm="abb-irb-120", process={"registration_poses": 4})
    arm = Robot.load("abb-irb-120")
    readings = np.random.default_rng(0).uniform(-0.5, 0.5, (6, 6))
    readings[1::2, 3] = np.radians(159.0)
    poses = Poses(readings, np.full(6, -1), ("",) * 6)
    assert (readings + np.radians(3.0) > arm.limits[:, 1]).any()
    with virtual(text) as (_, found):
        measured(found, poses, tmp_path / "session.db")
    with Session(tmp_path / "session.db", writing=False) as session:
        assert summary_of(session)["measured"] == 6


@pytest.mark.parametrize("name", texts())
def test_drivers_keep_to_the_protocols(name):
    text, places = texts()[name]
    content = parsed(text, where=name)
    merge(content, {"simulate": {"speed": SLOW}})
    with virtual(tomli_w.dumps(content)) as (_, found):
        assert len(check_robot(lambda: Cell.from_toml(found).robot, places)) == 8
        cell = Cell.from_toml(found)
        readings = places[1] if cell.file.world is None else possible_readings(cell, 1)[0]
        with Connected(cell.sensor):
            cell.sensor.release()
        with Connected(cell.robot):
            cell.robot.move_joints(readings)
        expected = Prediction(cell).expected(Step(0, "pose", 0, "", 0, readings))
        assert len(check_sensor(lambda: Cell.from_toml(found).sensor, expected)) == 8


def test_playback_keeps_to_the_protocols(tmp_path):
    arm = VirtualArm(Robot.load("ur5"), seed=1)
    arm.measure_table(np.array(SIX_PLACES)).to_csv(tmp_path / "recorded.csv", index=False)
    settings = PlaybackSensor.Settings(file=tmp_path / "recorded.csv")
    check_robot(lambda: PlaybackRobot(PlaybackRobot.Settings(), arm.robot), SIX_PLACES, stops_within_s=None)
    expected = Expected(SIX_PLACES[0], np.zeros(3), 0.01, np.array([0.0, 0.0, 1.0]))
    check_sensor(lambda: PlaybackSensor(settings, arm.robot), expected)
    with (
        Connected(sensor := PlaybackSensor(settings, arm.robot)),
        pytest.raises(RefusedError, match="recorded"),
    ):
        sensor.prepare(Expected(np.zeros(6), np.zeros(3), 0.01, np.zeros(3)))


def test_conformance_finds_a_driver_that_gives_its_own_array():
    class Careless(PlaybackRobot):
        def read_joints(self):
            super().read_joints()
            return self._readings

    with pytest.raises(ConformanceError, match="keeps"):
        check_robot(lambda: Careless(PlaybackRobot.Settings(), Robot.load("ur5")), SIX_PLACES)


def test_the_rv_m2_rounds_targets_to_tenths_of_a_degree():
    with virtual(cell_text("rv-m2")) as (world, found):
        cell = Cell.from_toml(found)
        with Connected(cell.robot):
            cell.robot.move_joints(np.radians([10.04, 60.06, -99.97, 0.0, 5.0]))
            read = np.degrees(cell.robot.read_joints())
        np.testing.assert_allclose(read, [10.0, 60.1, -100.0, 0.0, 5.0], atol=1e-9)
        true = np.degrees(world.world.arm.at(world.shared.now()))
        np.testing.assert_allclose(read, true, atol=1e-9)


def test_the_rv_m2_refuses_readings_beyond_its_limits():
    with virtual(cell_text("rv-m2")) as (_, found):
        cell = Cell.from_toml(found)
        with Connected(cell.robot), pytest.raises(RefusedError, match="joint 2 at 120"):
            cell.robot.move_joints(np.radians([0.0, 120.0, -90.0, 0.0, 0.0]))


@pytest.mark.parametrize("name", ["rv-m2", "ur"])
def test_robots_move_to_poses(name):
    with virtual(cell_text(name)) as (_, found):
        cell = Cell.from_toml(found)
        readings = np.radians([10.0, 50.0, -80.0, 5.0, -10.0, 20.0][: cell.arm.joint_count])
        with Connected(cell.robot):
            cell.robot.move_joints(readings + 0.1)
            cell.robot.move_pose(cell.arm.pose(readings))
            off = cell.arm.position(cell.robot.read_joints()) - cell.arm.position(readings)
    assert np.linalg.norm(off) < 2e-3


def test_an_emergency_stop_is_told_by_both_devices():
    with virtual(cell_text("rv-m2")) as (world, found):
        cell = Cell.from_toml(found)
        with Connected(cell.sensor, cell.robot):
            world.world.emergency_stop(world.shared.now())
            with pytest.raises(EmergencyStopError, match="RV-M2 at /dev/"):
                cell.robot.move_joints(FIVE_PLACES[1])
            with pytest.raises(EmergencyStopError, match="table at /dev/"):
                cell.sensor.release()
            release_emergency_stop(world.shared)


def test_a_stop_halts_the_table_where_it_is():
    with (
        virtual(cell_text("rv-m2", simulate={"speed": 1.0})) as (world, found),
        Connected(sensor := Cell.from_toml(found).sensor),
        ThreadPoolExecutor(1) as aside,
    ):
        assert isinstance(sensor, TablePanel)
        moving = aside.submit(sensor.go_to, np.array([0.7, 0.0, 0.0]))
        time.sleep(0.3)
        sensor.stop()
        assert isinstance(moving.exception(), StoppedError)
        where = world.world.table.at(world.shared.now())
        time.sleep(0.1)
        np.testing.assert_array_equal(where, world.world.table.at(world.shared.now()))
    assert 0.0 < where[0] < 0.7


@given(st.lists(st.floats(-1.5, 1.5), min_size=5, max_size=5))
def test_the_read_out_of_the_rv_m2_leads_back_to_the_joints(angles):
    arm = Robot.load("rv-m2")
    readings = np.clip(angles, *arm.limits.T)
    readings[2] = min(readings[2], -0.2)
    near = movemaster.readings_near(arm, movemaster.whereabouts(arm, readings), readings + 0.01)
    if near is not None:
        np.testing.assert_allclose(
            movemaster.whereabouts(arm, near), movemaster.whereabouts(arm, readings), atol=1e-5
        )


@given(st.lists(st.integers(-9999, 9999), min_size=5, max_size=5))
def test_movemaster_numbers_read_back(values):
    read = movemaster.parse_numbers(movemaster.listed(values))
    assert read is not None
    assert list(read) == values


@pytest.mark.parametrize("text", ["", "1,2,3,4,5", "+1.0,+2.0,+3.0,+4.0", "+1.0,+2.0,x3.0,+4.0,+5.0"])
def test_damaged_movemaster_numbers_are_none(text):
    assert movemaster.parse_numbers(text) is None


def test_groups_that_some_lines_lack_are_means_of_the_others(monkeypatch):
    number = r"[-+.\d]+"
    answer = (
        rf"^(?P<x>{number}) (?P<y>{number}) (?P<z>{number})(?: s(?P<sigma>{number}))?(?: t(?P<t>{number}))?$"
    )
    settings = LineSensor.Settings(port="tcp://127.0.0.1:1", answer=answer, average=3, settle_s=0.0)
    sensor = LineSensor(settings, Robot.load("ur5e"))
    lines = iter(["1 2 3 s0.04 t20", "1 2 3.05 s0.06", "damaged", "1 2 3.1"])
    monkeypatch.setattr(sensor._port, "receive", lambda *_, **__: next(lines))
    monkeypatch.setattr(sensor._port, "drain", list)
    reading = sensor.measure()
    assert reading.valid
    assert reading.point_in_world == pytest.approx([1e-3, 2e-3, 3.05e-3])
    assert reading.sigma_m == pytest.approx(5e-5)
    assert reading.features == {"t": 20.0}


def test_an_instrument_that_cannot_be_set_up_lets_go_of_its_port(monkeypatch):
    settings = {"port": "tcp://127.0.0.1:1", "answer": "(?P<x>.*) (?P<y>.*) (?P<z>.*)", "setup": ("START",)}
    sensor = LineSensor(LineSensor.Settings(**settings), Robot.load("ur5e"))
    channel = Mock(write=Mock(side_effect=ConnectionEndedError("cut")))
    monkeypatch.setattr("truearm.cell.line_port.open_channel", lambda *_, **__: channel)
    for _ in range(2):
        with pytest.raises(DeviceGoneError, match="cut"):
            sensor.connect()
    assert channel.close.call_count == 2


def test_drivers_are_context_managers():
    places = [*ROBOTS.values(), *SENSORS.values()]
    drivers = [getattr(import_module(module), name) for module, name in (each.split(":") for each in places)]
    assert all(issubclass(driver, Managed) for driver in drivers)
    text = cell_text()
    with virtual(text) as (_, found):
        cell = Cell.from_toml(found)
        assert isinstance(cell.sensor, TablePanel)
        stop = Mock()
        with patch.object(cell.sensor, "stop", stop), pytest.raises(ZeroDivisionError), cell.sensor:
            raise ZeroDivisionError
        stop.assert_called_once()
        assert cell.sensor.carriage is None
        with cell.sensor as table:
            assert table.carriage is not None
