"""Parts of the cell alone: frames of lines, the panel, patterns, packets, verdicts, clearance."""

import contextlib
import os
import re
import socket
import threading
import time
import tty
from concurrent.futures import ThreadPoolExecutor
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from truearm._core import Chain
from truearm._core import Clearance as Gaps
from truearm.cell import ur_packets
from truearm.cell.cell_file import ClearanceSection
from truearm.cell.clearance import TOOL_MARGIN_M, Clearance
from truearm.cell.crew import Crew
from truearm.cell.device_errors import (
    DeviceError,
    DeviceGoneError,
    DeviceSilentError,
    EmergencyStopError,
    StoppedError,
)
from truearm.cell.framing import framed, unframed
from truearm.cell.judge import Rules, judge
from truearm.cell.line_port import LinePort
from truearm.cell.movemaster import parse_numbers
from truearm.cell.patterns import expression_for, filled, numbers_in
from truearm.cell.session import Stored
from truearm.cell.stretches import boundaries
from truearm.cell.table_panel import PanelSection, TablePanel
from truearm.cell.virtual.line_devices import answer_for
from truearm.cell.ways import Way
from truearm.errors import InputError
from truearm.robot import Robot

# More than a socket takes that nobody reads.
LONG = "x" * 12_000_000
TEXTS = st.text("ABCXYZ 0123456789.-", min_size=1).map(str.strip).filter(bool)


def test_no_motion_is_begun_behind_what_stops_the_device(monkeypatch):
    port = LinePort("device", "tcp://host:1", 0.1)
    sent: list[str] = []
    sending, go_on = threading.Event(), threading.Event()

    def slowly(*texts):
        sending.set()
        go_on.wait(5.0)
        sent.extend(texts)

    monkeypatch.setattr(port, "send", slowly)
    with ThreadPoolExecutor(2) as crew:
        begun = crew.submit(port.begin, "GO 1")
        assert sending.wait(5.0)
        stopping = crew.submit(port.interrupt)
        time.sleep(0.05)
        assert not stopping.done(), "a motion that is being sent comes before what stops it"
        go_on.set()
        begun.result(5.0)
        stopping.result(5.0)
    with pytest.raises(StoppedError):
        port.begin("GO 2")
    port.send("HALT")
    port.resume()
    port.begin("GO 3")
    assert sent == ["GO 1", "HALT", "GO 3"]


@given(st.integers(0, 10**8), TEXTS)
def test_framed_lines_read_back(number, text):
    assert unframed(framed(number, text)) == (number, text)


@given(st.integers(0, 10**8), TEXTS, st.data())
def test_a_line_with_one_other_character_is_not_believed(number, text, data):
    line = framed(number, text)
    place = data.draw(st.integers(0, len(line) - 1))
    other = data.draw(st.characters(min_codepoint=33, max_codepoint=126).filter(lambda c: c != line[place]))
    assert unframed(line[:place] + other + line[place + 1 :]) is None


@given(st.sampled_from(["+z", "-z", "+y", "-x"]), st.tuples(*[st.floats(-0.3, 0.3)] * 3))
def test_what_the_panel_sees_leads_back_to_the_point(normal, point):
    u = "+x" if normal[1] != "x" else "+y"
    panel = PanelSection(normal=normal, u=u, offset_mm=(10.0, -5.0, 30.0)).geometry()
    carriage = panel.carriage_under(np.array(point), 0.02)
    seen = panel.seen(carriage, np.array(point))
    assert panel.holds(seen)
    assert seen[2] == pytest.approx(0.02)
    touched = panel.point((carriage + 0.02 * panel.normal).tolist(), *panel.counts_of(seen).tolist())
    np.testing.assert_allclose(touched, point, atol=1e-12)


def test_the_panel_counts_a_quarter_of_a_millimetre():
    panel = PanelSection().geometry()
    step = panel.point([0.0] * 3, 1.0, 1.0) - panel.point([0.0] * 3, 0.0, 0.0)
    np.testing.assert_allclose(1e3 * step, [0.2598, 0.3125, 0.0], atol=1e-4)


def test_templates_and_patterns_are_two_sides():
    template = "GO {x:.3f},{y:.3f} END"
    line = filled(template, {"x": 1.5, "y": -2.0})
    assert line == "GO 1.500,-2.000 END"
    assert numbers_in(expression_for(template), line) == {"x": 1.5, "y": -2.0}
    assert numbers_in(expression_for(template), "GO 1.500,-2.0x0 END") is None
    with pytest.raises(InputError, match="Known here: x, y"):
        filled("{z}", {"x": 1.0, "y": 2.0})


@pytest.mark.parametrize(
    "pattern", [r"^(?P<x>[-\d.]+),\s*(?P<y>\S+);(?P<z>.+)$", r"P=(?P<x>-?\d+(\.\d+)?) (?P<y>\S+) (?P<z>\S+)"]
)
def test_virtual_answers_match_the_pattern_they_are_made_from(pattern):
    line = answer_for(pattern, {"x": 1.25, "y": -2.5, "z": 3.0})
    assert numbers_in(re.compile(pattern), line) == {"x": 1.25, "y": -2.5, "z": 3.0}


def test_packets_of_a_universal_robot_read_back_also_in_pieces():
    states = [ur_packets.State(k, np.full(6, 0.1 * k), np.zeros(6), ur_packets.NORMAL) for k in range(3)]
    stream = b"".join(map(ur_packets.build, states))
    packet, rest = ur_packets.last_whole(stream[:-7])
    assert packet is not None
    assert ur_packets.parse(packet).time_s == 1.0
    packet, rest = ur_packets.last_whole(rest + stream[-7:])
    assert packet is not None
    np.testing.assert_array_equal(ur_packets.parse(packet).readings, states[2].readings)
    assert rest == b""
    with pytest.raises(ValueError, match="packet of"):
        ur_packets.last_whole(b"\x00\x00\x00\x01" + stream)


RULES = Rules(contacts=2, attempts=6, agree_m=0.4e-3, likely_m=4e-3)


def readings(*points_mm):
    return [
        Stored(k, point is not None, None if point is None else (point / 1e3, 0.0, 0.0), 6e-5)
        for k, point in enumerate(points_mm, start=1)
    ]


@pytest.mark.parametrize(
    ("points", "decision", "attempts"),
    [
        ((), "again", ()),
        ((1.0,), "again", ()),
        ((1.0, 1.1), "accept", (1, 2)),
        ((1.0, None, 1.1), "accept", (1, 3)),
        ((1.0, 6.0), "again", ()),
        ((1.0, 6.0, 1.1), "accept", (1, 3)),
        ((9.0, 9.1), "again", ()),
        ((9.0, 9.1, 9.05), "accept", (1, 2, 3)),
        ((1.0, 1.1, 3.0, 3.1), "again", ()),
        ((None,) * 6, "give up", ()),
    ],
)
def test_verdicts(points, decision, attempts):
    verdict = judge(readings(*points), np.zeros(3), RULES)
    assert (verdict.decision, verdict.attempts) == (decision, attempts)


@given(st.lists(st.floats(-3.0, 3.0), max_size=6))
def test_what_is_accepted_agrees_and_outnumbers_what_contradicts(points):
    verdict = judge(readings(*points), np.zeros(3), RULES)
    if verdict.decision == "accept":
        chosen = [points[attempt - 1] for attempt in verdict.attempts]
        assert len(chosen) > len(points) - len(chosen)
        assert max(chosen) - min(chosen) <= 0.4 + 1e-9


def test_stretches_grow():
    assert boundaries(20, 100) == [20, 40, 60, 80, 100]
    found = boundaries(20, 5000)
    assert found[-1] <= 2000
    assert len(found) < 30
    assert boundaries(0, 100) == []


def test_the_gap_between_link_and_column_is_that_of_the_nearest_points():
    arm = Robot.load("rv-m2")
    panel = PanelSection().geometry()
    sizes = ClearanceSection(link_radius_mm=10.0, column_radius_mm=10.0, column_mm=400.0)
    clearance = Clearance(arm, arm.tool, panel, sizes)
    stretched = np.array([[0.0, 0.0, -1e-9, 0.0, 0.0]])
    last_link = Chain(arm.convention, list(arm.joints), arm.table, arm.base, np.eye(4))
    outermost = last_link.position(stretched)[0]
    beside, through = (outermost + np.array([0.0, y, 0.1]) - panel.middle_m for y in (0.2, 0.0))
    gap = clearance.gaps(stretched, beside[None], np.eye(4))[0, 0]
    assert gap == pytest.approx(0.2 - 0.02, abs=2e-3)
    meeting = clearance.gaps(stretched, through[None], np.eye(4))[0, 0]
    assert meeting < 0.0
    assert clearance.meets(stretched[0], beside, np.eye(4)) is None
    assert clearance.meets(stretched[0], through, np.eye(4)) == meeting


def test_a_tool_whose_line_goes_through_the_edge_of_the_plate_meets_it():
    """Its ends are beside the plate and above it; the least of many points on it is the line's."""

    def tool(count):
        begin, end = np.array([-0.05, 0.1, -0.02]), np.array([0.04, 0.1, 0.005])
        return [chain(begin + share * (end - begin)) for share in np.linspace(0.0, 1.0, count)]

    def chain(point):
        frame = np.eye(4)
        frame[:3, 3] = point
        return Chain("standard", ["revolute"], np.zeros((1, 5)), np.eye(4), frame)

    def gap(points):
        plate = (0.0, 0.0, 0.0), np.eye(3).tolist(), (0.2, 0.2), 0.02
        gaps = Gaps([chain([0.0, 0.0, 1.0])], points, ((5.0, 5.0, 5.0), (0.0, 0.0, -1.0), 0.01), plate)
        return gaps.gaps(np.zeros((1, 1)), np.zeros((1, 3)), np.eye(4))[0, 1]

    points = [gap([point]) for point in tool(2000)]
    assert points[0] > 0.0
    assert points[-1] > 0.0
    assert gap(tool(2)) == pytest.approx(min(points), abs=2e-5)
    assert gap(tool(2)) == pytest.approx(gap(tool(7)), abs=1e-12)
    assert gap(tool(2)) < -5e-3


def test_a_margin_is_that_of_the_nearest_places_on_both_ways():
    arm, panel, sizes = Robot.load("rv-m2"), PanelSection().geometry(), ClearanceSection()
    clearance = Clearance(arm, arm.tool, panel, sizes)
    frame = np.eye(4)
    frame[:3, 3] = [0.4, -0.25, -0.1]
    stops = [np.radians(row) for row in ([0.0, 40.0, -60.0, -50.0, 0.0], [25.0, 50.0, -80.0, -40.0, 10.0])]
    carriages = [np.array([0.5, 0.1, 0.05]), np.array([0.7, -0.1, 0.1])]
    found = clearance.margin(np.array(stops), np.array(carriages), frame)
    shares = [(a, b) for a in np.linspace(0.0, 1.0, 41) for b in np.linspace(0.0, 1.0, 41)]
    readings, places = (
        np.array([way[0] + share[k] * (way[1] - way[0]) for share in shares])
        for k, way in enumerate((stops, carriages))
    )
    gaps = clearance.gaps(readings, places, frame).min(axis=0)
    least = min(gaps[0] - 1e-3 * sizes.margin_mm, gaps[1] - TOOL_MARGIN_M)
    assert least - 1e-9 <= found <= least + 5e-3
    assert clearance.margin(np.array(stops[:1]), np.array(carriages[:1]), frame) >= found


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("+1.0,-2.5,300.0,.5,-.1", [10, -25, 3000, 5, -1]),
        (" 0.0, 0.0, 0.0, 0.0, 0.0 ", [0] * 5),
        ("1.0,2.0,3.0,4.0", None),
        ("1.0,2.0,3.0,4.0,5", None),
        ("1.0,2.0,3.0,4.0,x.0", None),
    ],
)
def test_positions_as_movemaster_controllers_write_them(text, found):
    numbers = parse_numbers(text)
    assert (None if numbers is None else list(numbers)) == found


@contextlib.contextmanager
def tcp_port(limit_s):
    """A port, and the socket at its other end."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = LinePort("device", f"tcp://127.0.0.1:{server.getsockname()[1]}", limit_s)
        port.open()
        other, _ = server.accept()
        with other:
            yield port, other
        port.close()


def test_a_device_that_is_slow_to_take_what_is_sent_is_waited_for():
    with tcp_port(5.0) as (port, other), ThreadPoolExecutor(1) as aside:
        sending = aside.submit(port.send, LONG)
        time.sleep(0.2)
        assert not sending.done()
        taken = 0
        while taken < len(LONG) + 1:
            taken += len(other.recv(1 << 20))
        sending.result(5.0)


def test_a_device_that_takes_nothing_is_gone_within_the_limit():
    with tcp_port(0.2) as (port, _):
        began = time.monotonic()
        with pytest.raises(DeviceGoneError, match="device at tcp://.*could not be sent within 0.2 s"):
            port.send(LONG)
        assert time.monotonic() - began < 2.0


def test_lines_that_come_may_end_in_any_way():
    own, other = os.openpty()
    tty.setraw(other)
    port = LinePort("device", os.ttyname(other), 1.0, terminator=b"\r")
    port.open()
    os.write(own, b"one\r\ntwo\rthree\n\r\nfour\r")
    assert [port.receive() for _ in range(4)] == ["one", "two", "three", "four"]
    port.close()
    os.close(own)
    os.close(other)


def test_what_ended_a_way_is_raised_where_the_sensor_fails_too():
    noted = []
    cell = Mock(arm=Robot.load("rv-m2"))
    cell.robot.move_joints.side_effect = EmergencyStopError("pressed", where="arm")
    cell.sensor.stop.side_effect = DeviceSilentError("no answer", where="table")
    crew = Crew(cell, lambda kind, message: noted.append((kind, message)), threading.Event())
    with pytest.raises(EmergencyStopError, match="pressed"):
        crew._together([np.zeros(5)], Mock())
    assert noted == [("failed", "stop sensor: table: no answer.")]


@pytest.mark.parametrize(
    ("waits", "order"),
    [(False, ["go_to", "move_joints", "prepare"]), (True, ["go_to", "prepare", "move_joints"])],
)
def test_arm_and_table_go_one_after_the_other(waits, order):
    done: list[str] = []
    table = Mock(spec=TablePanel, carriage=np.zeros(3))
    cell = Mock(arm=Robot.load("rv-m2"), sensor=table)
    cell.robot.read_joints.return_value = np.zeros(5)
    for device, action in ((cell.robot, "move_joints"), (table, "go_to"), (table, "prepare")):
        setattr(device, action, Mock(side_effect=lambda *_, action=action: done.append(action)))
    crew = Crew(cell, Mock(), threading.Event())
    crew.connect()
    crew._ways = Mock()
    crew._ways.to.return_value = Way([np.ones(5)], [np.ones(3)], waits=waits)
    crew.go([np.ones(5)], Mock(), np.eye(4))
    assert done == order


def test_joints_that_are_no_numbers_are_an_error_of_the_device():
    cell = Mock(arm=Robot.load("rv-m2"))
    cell.robot.name = "own robot"
    cell.robot.read_joints.return_value = np.array([0.1, np.nan, 0.0, 0.0, 0.0])
    with pytest.raises(DeviceError, match=r"own robot: it reads its joints as .*\[0.1, nan"):
        Crew(cell, Mock(), threading.Event()).connect()


def test_a_driver_that_raises_anything_while_it_lets_go_does_not_keep_the_other_open():
    noted: list[tuple[str, str]] = []
    cell = Mock(robot=Mock(close=Mock(side_effect=OSError("pulled out"))), arm=Robot.load("rv-m2"))
    Crew(cell, lambda kind, message: noted.append((kind, message)), threading.Event()).quiet()
    cell.robot.close.side_effect = TimeoutError()
    Crew(cell, lambda kind, message: noted.append((kind, message)), threading.Event()).quiet()
    assert noted == [("failed", "close robot: pulled out"), ("failed", "close robot: TimeoutError")]
    assert cell.sensor.close.call_count == 2
