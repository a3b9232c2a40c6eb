"""Drivers of robots and instruments as these behave: slow to begin, with digits that flicker, talkative."""

import contextlib
import dataclasses
import socketserver
import threading
import time
from unittest.mock import Mock

import numpy as np
import pytest
import tomli_w

from tests.cell_support import cell_text
from truearm.cell import (
    Cell,
    Connected,
    DeviceError,
    DeviceSilentError,
    NotReadyError,
    RefusedError,
    ur_packets,
)
from truearm.cell.channels import open_channel, tcp_address, tcp_place
from truearm.cell.device_errors import PortUnavailableError
from truearm.cell.line_robot import LineRobot
from truearm.cell.line_sensor import LineSensor
from truearm.cell.universal_robots import UniversalRobots
from truearm.errors import InputError
from truearm.files import parsed
from truearm.robot import Robot

SCARA = Robot.load("adept-cobra-600")
START = np.clip(np.zeros(4), *SCARA.limits.T)
PLACE = START + np.array([0.1, -0.1, 0.02, 0.2])
TO_SHOWN = np.array([180.0 / np.pi, 180.0 / np.pi, 1e3, 180.0 / np.pi])
NUMBER = r"[-+.\d]+"
XYZ = rf"^(?P<x>{NUMBER}),(?P<y>{NUMBER}),(?P<z>{NUMBER})$"


@contextlib.contextmanager
def served(answers):
    """The address of a device that sends the lines that `answers` gives for a line."""

    class Handler(socketserver.StreamRequestHandler):
        def handle(self):
            for line in self.rfile:
                for answer in answers(line.decode().strip()):
                    self.wfile.write(f"{answer}\n".encode())

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        yield f"tcp://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


@dataclasses.dataclass
class Arm:
    """A robot that talks in lines: it moves `delay_s` after it is told to, for `lasts_s`."""

    delay_s: float = 0.0
    lasts_s: float = 0.05
    flickers: float = 0.0
    short_of: float = 0.0
    refuses: bool = False

    def __post_init__(self):
        self.begin, self.end, self.told_at = START * TO_SHOWN, START * TO_SHOWN, 0.0
        self.moves, self._rng = 0, np.random.default_rng(0)

    def at(self):
        share = (time.monotonic() - self.told_at - self.delay_s) / self.lasts_s
        return self.begin + np.clip(share, 0.0, 1.0) * (self.end - self.begin)

    def __call__(self, line):
        word, _, rest = line.partition(" ")
        if word == "POS?":
            shown = self.at() + self.flickers * self._rng.uniform(-1.0, 1.0, 4)
            return ["WAIT", "POS " + " ".join(f"{value:.5f}" for value in shown)]
        if word == "MOVE" and self.refuses:
            return ["ERR 17 singularity"]
        if word == "MOVE":
            self.begin, self.told_at, self.moves = self.at(), time.monotonic(), self.moves + 1
            self.end = np.array([float(value) for value in rest.split()]) - [0.0, 0.0, self.short_of, 0.0]
        return ["OK"]


@contextlib.contextmanager
def robot_of(arm, **keys):
    names = [f"q{j}" for j in range(1, 5)]
    with served(arm) as port:
        settings = {
            "port": port,
            "move": "MOVE " + " ".join(f"{{{name}:.6f}}" for name in names),
            "where": "POS?",
            "joints": "^POS " + " ".join(rf"(?P<{name}>\S+)" for name in names) + "$",
            "stop": "HALT",
        }
        with Connected(robot := LineRobot(LineRobot.Settings(**settings | keys), SCARA)):
            yield robot


@pytest.mark.parametrize(
    ("field", "wanted"),
    [
        ("{NAME}", "MOVE 0.0 -45.0 0.00001 57.295779513"),
        ("{NAME:e}", "MOVE -1.590277e-15 -4.500000e+01 1.000000e-05 5.729578e+01"),
    ],
)
def test_commands_have_decimals_unless_all_numbers_are_to_have_an_exponent(field, wanted):
    lines, arm = [], Arm()

    def answers(line):
        lines.append(line)
        return arm(line)

    move = "MOVE " + " ".join(field.replace("NAME", f"q{j}") for j in range(1, 5))
    with robot_of(answers, move=move) as robot:
        robot.move_joints(np.array([-(2.0**-55), -np.pi / 4.0, 1e-8, 1.0]))
    assert [line for line in lines if line.startswith("MOVE")] == [wanted]


@pytest.mark.parametrize("delay_s", [0.05, 0.3])
def test_a_robot_that_is_slow_to_begin_is_told_once(delay_s):
    with robot_of(arm := Arm(delay_s=delay_s)) as robot:
        robot.move_joints(PLACE)
        np.testing.assert_allclose(robot.read_joints(), PLACE, atol=1e-6)
    assert arm.moves == 1


def test_a_robot_is_there_when_it_is_still():
    # The last of its way, all of which is within five tolerances, takes a while.
    with robot_of(arm := Arm(lasts_s=1.0)) as robot:
        robot.move_joints(START + np.radians([0.1, 0.0, 0.0, 0.0]))
        np.testing.assert_array_equal(arm.at(), arm.end)


def test_answers_that_come_late_are_not_taken_for_time_at_rest():
    arm = Arm(lasts_s=1.0)

    def late(line):
        answer = arm(line)
        time.sleep(0.15)
        return answer

    with robot_of(late) as robot:
        robot.move_joints(START + np.radians([0.06, 0.0, 0.0, 0.0]))
        np.testing.assert_array_equal(arm.at(), arm.end)


def test_of_a_robot_whose_last_digits_flicker_the_median_is_read():
    with robot_of(Arm(flickers=0.004)) as robot:
        robot.move_joints(PLACE)
        np.testing.assert_allclose(robot.read_joints() * TO_SHOWN, PLACE * TO_SHOWN, atol=0.004)


def test_a_sliding_joint_has_a_tolerance_of_its_own():
    with (
        robot_of(Arm(short_of=0.2), starts_within_s=0.1) as robot,
        pytest.raises(DeviceError, match=r"did not get there.*0.05 mm"),
    ):
        robot.move_joints(PLACE)
    with robot_of(Arm(short_of=0.2), tolerance_mm=0.3) as robot:
        robot.move_joints(PLACE)


def test_what_a_robot_refuses_is_told_in_its_words():
    with (
        robot_of(Arm(refuses=True), refused="^ERR") as robot,
        pytest.raises(RefusedError, match="ERR 17 singularity"),
    ):
        robot.move_joints(PLACE)


@contextlib.contextmanager
def sensor_of(answers, **keys):
    with served(answers) as port:
        settings = {"port": port, "answer": XYZ, "trigger": "M", "settle_s": 0.0, "timeout_s": 0.2}
        with Connected(sensor := LineSensor(LineSensor.Settings(**settings | keys), SCARA)):
            yield sensor


def test_an_instrument_may_say_other_things_before_it_answers():
    with sensor_of(lambda line: [line, "#ack", "1,2,3", "#done"], average=2) as sensor:
        reading = sensor.measure()
    assert reading.valid
    assert reading.point_in_world == pytest.approx([1e-3, 2e-3, 3e-3])


def test_lines_that_fit_nothing_are_counted_and_the_last_is_shown():
    with (
        sensor_of(lambda _: ["#ack", "P 1 2 3"]) as sensor,
        pytest.raises(DeviceSilentError, match=r'2 lines came.*none fits `answer`, the last was "P 1 2 3"'),
    ):
        sensor.measure()
    with sensor_of(lambda _: []) as sensor, pytest.raises(DeviceSilentError, match="no answer to measure"):
        sensor.measure()


class Tracker(socketserver.StreamRequestHandler):
    """Tells where the target was, a multiple of (1, 1, 1) mm: asked for, `late_s` later; or all the time."""

    at, late_s, streams = 0.0, 0.0, False

    def handle(self):
        while self.streams:
            try:
                self.wfile.write(f"{self.at},{self.at},{self.at}\n".encode() * 200)
            except OSError:
                return
            time.sleep(0.001)
        for _ in self.rfile:
            answer = f"{self.at},{self.at},{self.at}\n".encode()
            threading.Timer(self.late_s, self._tell, [answer]).start()

    def _tell(self, answer):
        with contextlib.suppress(OSError, ValueError):  # nobody listens any more
            self.wfile.write(answer)


@contextlib.contextmanager
def tracker_of(*, late_s=0.0, streams=False, **keys):
    tracker = type("Own", (Tracker,), {"late_s": late_s, "streams": streams})
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), tracker) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        port = f"tcp://127.0.0.1:{server.server_address[1]}"
        settings = {"port": port, "answer": XYZ, "settle_s": 0.0, "timeout_s": 0.2}
        with Connected(sensor := LineSensor(LineSensor.Settings(**settings | keys), SCARA)):
            yield tracker, sensor
        server.shutdown()


@pytest.mark.parametrize("late_s", [0.3, 0.5])
def test_an_answer_that_comes_late_is_not_believed_of_the_next_place(late_s):
    with tracker_of(late_s=late_s, trigger="M") as (tracker, sensor):
        for place in (1.0, 2.0, 3.0):
            tracker.at = place
            assert sensor.measure().point_in_world == pytest.approx([place * 1e-3] * 3)


def test_lines_of_a_stream_do_not_grow_old_while_nothing_is_measured():
    with tracker_of(streams=True) as (tracker, sensor):
        time.sleep(1.5)
        tracker.at = 7.0
        time.sleep(0.05)
        assert sensor.measure().point_in_world == pytest.approx([7e-3] * 3)


def test_a_line_that_says_that_there_is_no_point_is_a_reading_that_is_not_valid():
    with sensor_of(lambda _: ["NO TARGET"], nothing="^NO", average=5) as sensor:
        reading = sensor.measure()
    assert not reading.valid
    assert reading.point_in_world is None
    assert reading.reason == 'it says "NO TARGET"'


@pytest.mark.parametrize(("told", "sigma_m"), [("0", 2e-5), ("nan", 2e-5), ("-1", 2e-5), ("0.05", 5e-5)])
def test_a_sigma_that_none_can_be_is_not_believed(told, sigma_m):
    answer = XYZ.replace("$", r",(?P<sigma>\S+),(?P<t>\S+)$")
    with sensor_of(lambda _: [f"1,2,3,{told},nan"], answer=answer, sigma_mm=0.02) as sensor:
        reading = sensor.measure()
    assert reading.valid
    assert reading.sigma_m == pytest.approx(sigma_m)
    assert reading.features == {}


def test_a_coordinate_that_is_no_number_does_not_count():
    answer = XYZ.replace(rf"(?P<z>{NUMBER})", r"(?P<z>\S+)")
    with sensor_of(lambda _: ["1,2,nan"], answer=answer) as sensor:
        reading = sensor.measure()
    assert (reading.valid, reading.point_in_world) == (False, None)


def test_instruments_may_measure_in_inches():
    with sensor_of(lambda _: ["1,2,3"], length_unit="in") as sensor:
        assert sensor.measure().point_in_world == pytest.approx([0.0254, 0.0508, 0.0762])


class Controller:
    """What a Universal Robots controller streams: noise, and a script that starts late."""

    def __init__(self, robot, mode=ur_packets.RUNNING, noise=1e-5, lasts_s=0.2):
        self.target, self.told_at, self.sent = np.zeros(6), np.inf, 0
        self._mode, self._noise, self._rng = mode, noise, np.random.default_rng(0)
        self._lasts_s = lasts_s
        robot._script, robot._state = Mock(begin=self.send, where="UR"), self.state
        robot._wait_for_next = lambda _: time.sleep(0.005)

    def send(self, _):
        self.sent, self.told_at = self.sent + 1, time.monotonic()

    def state(self):
        share = np.clip((time.monotonic() - self.told_at - 0.25) / self._lasts_s, 0.0, 1.0)
        speed = np.full(6, 1.0 if 0.0 < share < 1.0 else 0.0)
        readings = share * self.target + self._noise * self._rng.normal(size=6)
        return ur_packets.State(0.0, readings, speed, ur_packets.NORMAL, self._mode)


def test_an_arm_whose_encoders_flicker_is_given_time_to_begin():
    robot = UniversalRobots(UniversalRobots.Settings(host="127.0.0.1"), Robot.load("ur5e"))
    controller = Controller(robot)
    controller.target = np.full(6, 0.2)
    robot.move_joints(controller.target)
    assert controller.sent == 1


def test_an_arm_that_is_slower_than_it_was_told_to_be_is_waited_for():
    keys = {"timeout_s": 0.4, "speed_rad_s": 10.0, "acceleration_rad_s2": 1000.0, "settle_s": 0.05}
    robot = UniversalRobots(UniversalRobots.Settings(host="127.0.0.1", **keys), Robot.load("ur5e"))
    controller = Controller(robot, lasts_s=1.5)
    controller.target = np.full(6, 0.2)
    robot.move_joints(controller.target)
    assert controller.sent == 1


def test_what_the_script_port_says_is_read_so_that_it_goes_on_saying_it():
    class Port(socketserver.BaseRequestHandler):
        said = 0

        def handle(self):
            with contextlib.suppress(OSError):
                for Port.said in range(20000):
                    self.request.sendall(b"x" * 1100)

    class State(socketserver.BaseRequestHandler):
        def handle(self):
            still = ur_packets.State(0.0, np.zeros(6), np.zeros(6), ur_packets.NORMAL)
            with contextlib.suppress(OSError):
                while True:
                    self.request.sendall(ur_packets.build(still))
                    time.sleep(0.01)

    with (
        socketserver.ThreadingTCPServer(("127.0.0.1", 0), Port) as script,
        socketserver.ThreadingTCPServer(("127.0.0.1", 0), State) as state,
    ):
        for server in (script, state):
            server.daemon_threads = True
            threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        ports = {"script_port": script.server_address[1], "realtime_port": state.server_address[1]}
        settings = UniversalRobots.Settings(host="127.0.0.1", **ports)
        with Connected(UniversalRobots(settings, Robot.load("ur5e"))):
            until = time.monotonic() + 20.0
            while Port.said < 19999 and time.monotonic() < until:
                time.sleep(0.02)
        assert Port.said == 19999
        for server in (script, state):
            server.shutdown()


def test_an_arm_that_is_off_is_said_to_be():
    robot = UniversalRobots(UniversalRobots.Settings(host="127.0.0.1"), Robot.load("ur5e"))
    controller = Controller(robot, mode=3.0)
    with pytest.raises(NotReadyError, match="the arm is powered off"):
        robot.move_joints(np.full(6, 0.2))
    assert controller.sent == 0
    packet = ur_packets.build(controller.state())
    assert ur_packets.parse(packet).robot_mode == 3.0


def line_cell(**robot):
    names = " ".join(rf"(?P<q{j}>\S+)" for j in range(1, 7))
    keys = {"driver": "line", "port": "tcp://host:1", "where": "?", "joints": f"^{names}$", "stop": "HALT"}
    keys["move"] = "MOVE " + " ".join(f"{{q{j}}}" for j in range(1, 7))
    content = parsed(cell_text("tracker"), where="tracker")
    content["robot"] = keys | robot
    return tomli_w.dumps(content)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("move", "MOVE {q1.a}", "robot, move.*cannot be filled"),
        ("move", "MOVE {q1[0]}", "robot, move.*cannot be filled"),
        ("move", "MOVE {q7}", "robot, move.*Known here: q1"),
        ("move", "MOVE {q1:d}", "robot, move.*cannot be filled"),
        ("move", "MOVE {q1} {q2} {q3} {q4} {q5}", "leaves out {q6}"),
        ("move", "MOVE {q1:g} {q2} {q3} {q4} {q5} {q6}", "exponent: MOVE 1e-07 .*Name decimals, as {q1:.4f}"),
        ("move", "MOVE {q1!r} {q2} {q3} {q4} {q5} {q6}", "exponent: MOVE 1e-07 0.0000001 "),
        ("move_pose", "LIN {x:.3e} {y:.6}", "robot, move_pose.*exponent: LIN 1.000e-07 1e-07"),
        ("move_pose", "LIN {a}", "robot, move_pose.*Known here: x"),
        ("refused", "ERR (", "robot, refused.*no regular expression"),
        ("port", "tcp://localhost", "robot, port.*no TCP port"),
        ("port", "tcp://localhost:abc", "robot, port.*no TCP port"),
        ("port", "tcp://localhost:70000", "from 1 to 65535"),
        ("port", "tcp://::1:5002", "in brackets|IPv6"),
    ],
)
def test_what_is_wrong_with_lines_and_ports_is_told_when_the_cell_is_read(key, value, message):
    Cell.from_toml(line_cell())
    with pytest.raises(InputError, match=message):
        Cell.from_toml(line_cell(**{key: value}))


def test_ports_of_hosts_by_name_and_by_either_kind_of_address():
    assert tcp_place("/dev/ttyS0") is None
    for host in ("localhost", "192.168.0.1", "::1"):
        assert tcp_place(tcp_address(host, 5002)) == (host, 5002)
    for address, message in (("tcp://localhost", "no TCP port"), ("tcp://a..b:1", "no connection")):
        with pytest.raises(PortUnavailableError, match=message):
            open_channel("device", address, 0.1)
