"""The cell under trial: killed, interrupted, with faults on every wire, over ten thousand poses."""

import collections
import contextlib
import multiprocessing
import os
import re
import resource
import signal
import socket
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import serial

from tests.cell_support import SPEED, cell_text, measured, poses_of, virtual, write_poses
from tests.trials import (
    FULL,
    Wires,
    accepted,
    acknowledged,
    apart_mm,
    assert_stands,
    calibrated,
    finished,
    growth_of,
    heads_for,
    killed_after,
    measuring,
    memory_mb,
    moments,
    outcomes,
    record,
    remarks_of,
    say,
    simulated,
    sized,
    wait_for,
)
from truearm.cell import (
    Cell,
    DeviceError,
    DeviceGoneError,
    DeviceRestartedError,
    DeviceSilentError,
    EmergencyStopError,
    PortUnavailableError,
)
from truearm.cell.cell_file import ProcessSection
from truearm.cell.measuring import DONE, Process
from truearm.cell.opening import open_session
from truearm.cell.poses_file import Poses
from truearm.cell.session import Session
from truearm.cell.table_panel import SENDINGS
from truearm.cell.virtual.launch import TIMES, VirtualCell
from truearm.cell.virtual.state import COLLISIONS
from truearm.errors import WorkError
from truearm.interrupts import INTERRUPTED

MESSAGE_FAULTS = ("lost", "delayed", "duplicated", "garbled")
CONTACT_FAULTS = ("missed", "outlier")
# A damaged Movemaster line may be a valid motion elsewhere, and one that comes twice, or late when it was
# sent again, goes twice as far: all stops before things meet.
MOVE_ELSEWHERE = ("garbled", "duplicated", "delayed")
SENT_AGAIN, TOO_LATE = ("lost", "delayed", "garbled"), ("lost", "delayed")
SHARE = 0.05
RIGHT_MM = 0.5
# Later than the time limits of virtual devices, which the fast clock does not shorten as far.
LATE_S = 1.5 * TIMES["timeout_s"] * SPEED
# Share, how long the device is away, s, and the table's port: a closed TCP port is refused meanwhile.
# Few messages see one in a hundred.
RESTARTS = {
    "restart": (SHARE, 5.0, "/dev/ttyS1"),
    "restart-tcp": (sized(0.03, 0.01), 20.0, "tcp://virtual:1"),
}
MOST_STARTS = 4
ENDS_WITHIN_S, ONCE_ANEW = 2.0, 1
MOVES = {
    (False, False): "nothing moves",
    (True, False): "the arm moves",
    (False, True): "the table moves",
    (True, True): "both move",
}
HOMING = "on its way to the origin, which nothing ends"
STATES = (*MOVES.values(), "for the frame", "for poses")
# How the table fails under way, and its port.
UNDER_WAY = {
    "silent-under-way": (signal.SIGSTOP, "/dev/ttyS1"),
    "gone": (signal.SIGKILL, "/dev/ttyS1"),
    "closed-under-way": (signal.SIGKILL, "tcp://virtual:1"),
}
# Share or mm, the reason, and how far off accepted readings may be: what drifts slowly is noticed late.
STOPS = {
    "emergency_stop": (SHARE, "emergency stop", RIGHT_MM),
    "drift_mm_per_contact": (0.018, "the first contact is now", RIGHT_MM + ProcessSection().drift_mm),
}
LOOKS_EVERY = sized(10, 100)


@pytest.mark.slow
def test_killed_at_random_moments_nothing_is_lost_or_doubled(tmp_path):
    side_by_side, kills, count = sized((1, 2, 15), (4, 50, 100))
    with ThreadPoolExecutor(side_by_side) as pool:
        numbers = range(side_by_side)
        found = list(pool.map(lambda n: killed_sessions(tmp_path / str(n), n, kills, count), numbers))
    total = {key: sum(each[key] for each in found) for key in found[0]}
    record("kill", **total)
    assert total["kills"] == side_by_side * kills
    assert total["poses"] == total["of"] > 0


def killed_sessions(folder, seed, kills, count):
    """Sessions that are killed again and again, beside one that is not; what came of them.

    As many as it takes for all kills to hit a process at work.
    """
    # Noise that follows from the pose makes a session that was killed comparable with one that was not.
    text = cell_text(simulate={"repeatable": True, "speed": 100.0}, process={"stretch": 20})
    poses = poses_of(Cell.from_toml(text), count, seed=5 + seed)
    folder.mkdir()
    write_poses(folder / "poses.csv", poses)
    found = {"sessions": 0, "kills": 0, "acknowledged": 0, "poses": 0, "of": 0}
    with simulated(folder, text) as cell:
        whole = folder / "whole.db"
        done_by(cell, folder / "poses.csv", whole)
        reference, data, _ = finished(whole)
        expected = calibrated(text, data)
        while found["kills"] < kills:
            killed = folder / f"killed{found['sessions']}.db"
            at = moments(kills, 2.5, seed + 100 * found["sessions"])[: kills - found["kills"]]
            said, hit = kill_often(cell, folder / "poses.csv", killed, at)
            said += acknowledged(done_by(cell, folder / "poses.csv", killed))
            assert set(said) <= set(outcomes(killed))
            table, data, summary = finished(killed)
            assert summary["measured"] + len(summary["skipped"]) == count
            assert table["pose"].is_unique
            np.testing.assert_array_equal(calibrated(text, data), expected)
            news = {"sessions": 1, "kills": hit, "acknowledged": len(said)}
            news |= {"poses": len(table), "of": len(reference)}
            found = {key: value + news[key] for key, value in found.items()}
    return found


def done_by(cell, poses, session):
    """Measure to the end; what was told."""
    process = measuring(cell, poses, session)
    told = process.communicate()[1]
    assert process.returncode == 0, told[-2000:]
    return told


def kill_often(cell, poses, session, at):
    """Kill at moments until the session is complete; what was acknowledged, and how many processes it hit."""
    said, hit = [], 0
    for number, moment in enumerate(at):
        process = measuring(cell, poses, session)
        said += acknowledged(killed_after(process, moment, once_it_measures=number % 2 == 0))
        if process.returncode != -signal.SIGKILL:
            break
        hit += 1
        stored = outcomes(session) if session.exists() else []
        poses_stored = [step for step in stored if step[0] == "pose"]
        assert len(set(poses_stored)) == len(poses_stored)
        assert set(said) <= set(stored)
        say(f"{session}: kill {number + 1}, {len(poses_stored)} poses stored")
    return said, hit


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*MESSAGE_FAULTS, *CONTACT_FAULTS])
def test_with_faults_a_session_completes_with_right_readings(kind, tmp_path, wires):
    sessions, count = sized((1, 6), (20, 20))
    process = {"check_every": 0, "registration_poses": sized(4, 6)}
    worst_mm, stopped, remarks = 0.0, 0, 0
    for seed in range(sessions):
        settings = {"faults": {kind: SHARE, "delay_s": LATE_S}}
        text, poses = clean_and_faulty(tmp_path, seed, count, settings, process, wires)
        clean_path, path = tmp_path / f"clean{seed}.db", tmp_path / f"{seed}.db"
        complete = True
        with virtual(text) as (running, cell):
            try:
                assert measured(cell, poses, path)[0] == DONE
                assert not running.shared.flag(COLLISIONS)
            except EmergencyStopError as error:
                if kind not in MOVE_ELSEWHERE:
                    raise
                say(f"{kind} {SHARE:.0%}, session {seed}: stopped, {error}")
                stopped, complete = stopped + 1, False
        off_mm = apart_mm(path, clean_path)
        # What the table cannot reach is skipped with faults and without.
        if complete:
            assert len(off_mm) == len(accepted(clean_path)) == len(accepted(path)) > 0.8 * count
        assert (off_mm < RIGHT_MM).all(), "a wrong reading was accepted"
        worst_mm, remarks = max([worst_mm, *off_mm]), remarks + remarks_of(path)
        say(f"{kind} {SHARE:.0%}, session {seed}: worst {max(off_mm, default=0.0):.2f} mm")
    figures = {"sessions": sessions, "stopped": stopped, "poses": count, "worst_mm": worst_mm}
    record(f"fault-{kind}", share=SHARE, remarks=remarks, **figures, **wires.more)
    assert wires.more["sent_again"] > 0 or kind not in SENT_AGAIN
    assert wires.more["too_late"] > 0 or kind not in TOO_LATE


@pytest.fixture
def wires(monkeypatch):
    return Wires(monkeypatch)


def clean_and_faulty(folder, seed, count, settings, process, wires, **changes):
    """Measure a session without faults; the text of the same cell with them, and the poses."""
    clean, faulty = (
        cell_text(simulate={"seed": seed, **each}, process=process, **changes)
        for each in (dict[str, object](), settings)
    )
    poses = poses_of(Cell.from_toml(clean), count, seed=seed)
    with wires.without_faults(), virtual(clean) as (running, cell):
        assert measured(cell, poses, folder / f"clean{seed}.db")[0] == DONE
        assert not running.shared.flag(COLLISIONS)
    return faulty, poses


@pytest.mark.slow
@pytest.mark.parametrize("kind", RESTARTS)
def test_a_device_that_restarts_is_connected_anew(kind, tmp_path, wires):
    sessions, count = sized((1, 4), (20, 10))
    process = {"registration_poses": sized(4, 6)}
    share, restart_s, port = RESTARTS[kind]
    worst_mm, stopped, remarks, kept, clean = 0.0, 0, 0, 0, 0
    for seed in range(sessions):
        settings = {"faults": {"restart": share, "restart_s": restart_s}}
        path, clean_path = tmp_path / f"{seed}.db", tmp_path / f"clean{seed}.db"
        text, poses = clean_and_faulty(tmp_path, seed, count, settings, process, wires, sensor={"port": port})
        with virtual(text) as (running, cell):
            stopped += starts_until_done(cell, poses, path, restart_s / SPEED) - 1
            assert not running.shared.flag(COLLISIONS)
        off_mm = apart_mm(path, clean_path)
        assert (off_mm < RIGHT_MM).all(), "a wrong reading was accepted"
        kept, clean = kept + len(off_mm), clean + len(accepted(clean_path))
        worst_mm, remarks = max([worst_mm, *off_mm]), remarks + remarks_of(path)
        say(f"{kind} {share:.0%}, session {seed}: {remarks} remarks, worst {worst_mm:.2f} mm")
    figures = {"sessions": sessions, "stopped": stopped, "poses": count, "worst_mm": worst_mm}
    record(f"fault-{kind}", share=share, remarks=remarks, goes_on=True, **figures)
    assert remarks > 0
    assert kept > 0.8 * clean


def starts_until_done(cell, poses, path, away_s):
    """How often the same command is given until all is measured; it ends for restarts alone.

    It is given again when the device, which is away for `away_s`, is back.
    """
    for start in range(1, MOST_STARTS + 1):
        with contextlib.suppress(
            DeviceSilentError, DeviceGoneError, DeviceRestartedError, PortUnavailableError
        ):
            assert measured(cell, poses, path)[0] == DONE
            return start
        time.sleep(away_s)
    raise AssertionError(f"not done after {MOST_STARTS} starts")


@pytest.mark.slow
@pytest.mark.parametrize("kind", STOPS)
def test_what_cannot_go_on_stops_with_the_reason(kind, tmp_path, wires):
    share, reason, right_mm = STOPS[kind]
    worst_mm, kept, sessions = 0.0, 0, sized(1, 20)
    for seed in range(sessions):
        settings, process = {"faults": {kind: share}}, {"check_every": 4}
        text, poses = clean_and_faulty(tmp_path, seed, 12, settings, process, wires)
        path = tmp_path / f"{seed}.db"
        with virtual(text) as (running, cell):
            with pytest.raises(WorkError, match=reason):
                measured(cell, poses, path)
            assert not running.shared.flag(COLLISIONS)
            assert_stands(running.world)
        off_mm = apart_mm(path, tmp_path / f"clean{seed}.db")
        assert (off_mm < right_mm).all(), "a wrong reading was accepted"
        worst_mm, kept = max([worst_mm, *off_mm]), kept + len(off_mm)
    record(f"stop-{kind}", sessions=sessions, share=share, reason=reason, worst_mm=worst_mm, kept=kept)


@contextlib.contextmanager
def failing(name, device, port, limit_s, error=DeviceError):
    """Within, a device fails: the error says which, where and by which limit, and comes in time.

    Gives a list, to which the moment of the failure may be added: else it is the beginning.
    """
    moments_of = [time.monotonic()]
    with pytest.raises(error) as raised:
        yield moments_of
    seconds, text = time.monotonic() - moments_of[-1], str(raised.value)
    record(f"device-{name}", seconds=seconds, limit_s=limit_s, said=text)
    assert f"{device} at {port}: " in text
    assert re.search(r"(limit|within) [\d.]+ s", text)
    # Beside the limit devices are stopped and let go; loaded machines may be slow.
    assert seconds < limit_s + sized(10.0, ENDS_WITHIN_S)


def stands_while_connecting(text, port, folder):
    """Measure in a virtual cell whose table is sought at another port; its robot is not moved."""
    with virtual(text) as (running, found):
        sensor = tomllib.loads(found)["sensor"]
        elsewhere = found.replace(f'port = "{sensor["port"]}"', f'port = "{port}"')
        before = running.world.arm.ends()
        try:
            measured(elsewhere, poses_of(Cell.from_toml(text), 6), folder / "session.db")
        finally:
            assert running.world.arm.ends() == before
            assert not running.shared.flag(COLLISIONS)


def at_a_port(port):
    """The virtual cell's text and the time limit of its table, s."""
    text = cell_text(sensor={"port": port}, process={"recoveries": ONCE_ANEW})
    return text, TIMES["timeout_s"]


def test_a_silent_device_is_named_within_its_limit(tmp_path):
    own, other = os.openpty()
    port = os.ttyname(other)
    text, limit_s = at_a_port("/dev/ttyS1")
    with failing("silent", "table", port, (1 + ONCE_ANEW) * SENDINGS * limit_s, DeviceSilentError):
        stands_while_connecting(text, port, tmp_path)
    os.close(own)
    os.close(other)


def test_a_busy_port_is_named(tmp_path):
    own, other = os.openpty()
    port = os.ttyname(other)
    text, limit_s = at_a_port("/dev/ttyS1")
    with (
        serial.Serial(port, exclusive=True),
        failing("busy", "table", port, limit_s, PortUnavailableError),
    ):
        stands_while_connecting(text, port, tmp_path)
    os.close(own)
    os.close(other)


def test_a_port_that_is_not_there_is_named(tmp_path):
    text, limit_s = at_a_port("/dev/ttyS1")
    with failing("absent", "table", "/dev/ttyNOWHERE", limit_s, PortUnavailableError):
        stands_while_connecting(text, "/dev/ttyNOWHERE", tmp_path)


def test_a_closed_tcp_port_is_named(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = f"tcp://127.0.0.1:{server.getsockname()[1]}"
    text, limit_s = at_a_port("tcp://virtual:1")
    with failing("closed", "table", port, limit_s, PortUnavailableError):
        stands_while_connecting(text, port, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("how", UNDER_WAY)
def test_a_device_that_fails_under_way_stops_the_robot(how, tmp_path):
    number, port = UNDER_WAY[how]
    text, limit_s = at_a_port(port)
    others = set(multiprocessing.active_children())
    with VirtualCell(text) as running:
        # The robot's process is started first.
        found, started = running.cell_toml(), set(multiprocessing.active_children()) - others
        table = max(started, key=lambda process: process.pid or 0)
        assert table.pid is not None
        address = tomllib.loads(found)["sensor"]["port"]
        within_s = (1 + ONCE_ANEW) * SENDINGS * limit_s
        try:
            with failing(how, "table", address, within_s) as at:
                fail_under_way(found, poses_of(Cell.from_toml(text), 8), tmp_path, table.pid, number, at)
        finally:
            table.kill()
        assert_stands(running.world)
        assert not running.shared.flag(COLLISIONS)


def fail_under_way(text, poses, folder, pid, number, at):
    """Measure, and send a device a signal once a pose is stored."""

    def tell(progress):
        if progress.text.startswith("pose 2 ") and len(at) == 1:
            at.append(time.monotonic())
            os.kill(pid, number)

    cell = Cell.from_toml(text)
    with open_session(folder / "session.db", cell, poses) as session:
        Process(cell, session, tell).run()


@pytest.mark.slow
def test_ctrl_c_in_any_state_ends_within_two_seconds(tmp_path):
    count = sized(2, 40)
    text = cell_text(simulate={"speed": 4.0}, process={"stretch": 20})
    poses, session, slowest_s = tmp_path / "poses.csv", tmp_path / "session.db", 0.0
    write_poses(poses, poses_of(Cell.from_toml(text), sized(60, 600), seed=2))
    states: collections.Counter[str] = collections.Counter()
    origin = np.radians(tomllib.loads(text)["robot"]["origin_deg"])
    with virtual(text) as (running, found):
        (tmp_path / "cell.toml").write_text(found)
        for moment in moments(count, sized(2.0, 10.0), seed=3):
            seconds, state = interrupted(tmp_path / "cell.toml", poses, session, running.world, moment)
            slowest_s, states = max(slowest_s, seconds), states + collections.Counter(state)
            if heads_for(running.world, origin):
                # No command of the RV-M2 ends the way to the origin, on which connecting sends it.
                states[HOMING] += 1
            else:
                assert_stands(running.world)
            assert not running.shared.flag(COLLISIONS)
            with Session(session, writing=True) as known:
                assert known.rows("PRAGMA integrity_check") == [("ok",)]
    record("interrupt", interrupts=count, slowest_s=slowest_s, states=states)
    # Beside the two seconds a loaded machine may be slow; the figure is what `make trials` prints.
    assert slowest_s < sized(10.0, ENDS_WITHIN_S)
    if FULL:
        assert set(STATES) <= set(states)


def interrupted(cell, poses, session, world, moment):
    """Interrupt a process some time after its first motion; how long its end takes, and what it was doing."""
    table = world.table.ends()
    process = measuring(cell, poses, session)
    wait_for(lambda: world.table.ends() != table or process.poll() is not None)
    time.sleep(moment)
    state, began = state_of(world, session), time.monotonic()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate()
    assert process.returncode == INTERRUPTED, said[-2000:]
    assert "Interrupted." in said
    return time.monotonic() - began, state


def state_of(world, session):
    """What a process is doing now: which devices it moves, and what for."""
    now = world.shared.now()
    moves = bool(world.arm.speed(now).any()), bool(world.table.speed(now).any())
    with Session(session, writing=False) as known:
        return [MOVES[moves], "for poses" if known.registration() is not None else "for the frame"]


@pytest.mark.slow
def test_a_long_session_costs_little_time_and_no_memory(tmp_path):
    count, different = sized((120, 20), (10_000, 200))
    text = cell_text(simulate={"speed": 2000.0})
    few = poses_of(Cell.from_toml(text), different, seed=8)
    # As in a dense plan, every pose is near the one before.
    rng, near = np.random.default_rng(0), count // different
    readings = np.repeat(few.readings, near, axis=0) + np.radians(rng.uniform(-1.0, 1.0, (count, 5)))
    poses = Poses(np.clip(readings, *cell_limits(text)), np.zeros(count, dtype=np.int64), ("",) * count)
    used: list[tuple[int, float, float, float]] = []

    def look(progress):
        # Seldom, as looking costs time too.
        if progress.done % LOOKS_EVERY == 0:
            # The system brings readings to disk and lines to ports, and waits for both.
            spent = resource.getrusage(resource.RUSAGE_SELF)
            used.append((progress.done, spent.ru_utime, spent.ru_stime, memory_mb()))

    with simulated(tmp_path, text) as path:
        cell = Cell.load(path)
        with open_session(tmp_path / "session.db", cell, poses) as session:
            Process(cell, session, look).run()
    a_pose, grown, large = growth_of(used)
    record("long", poses=count, **a_pose, memory_mb=large, grown_mb=grown)
    assert len(outcomes(tmp_path / "session.db")) > 0.9 * count
    assert grown < 20.0
    if FULL:
        assert sum(a_pose.values()) < 1.0


def cell_limits(text):
    return Cell.from_toml(text).arm.limits.T
