"""Driver of Universal Robots arms: URScript to the secondary port, joints from the real-time port.

Targets are absolute, so that a line that was lost is simply sent again, and one that came twice does nothing.
"""

import contextlib
import threading
import time
from typing import Final

import numpy as np

from truearm.cell import ur_packets
from truearm.cell.channels import Channel, ConnectionEndedError, open_tcp, tcp_address
from truearm.cell.device_errors import (
    DeviceError,
    DeviceRestartedError,
    DeviceSilentError,
    EmergencyStopError,
    NotReadyError,
    ProtectiveStopError,
    RefusedError,
    gone,
    silent,
    stopped,
)
from truearm.cell.line_port import LinePort
from truearm.cell.protocols import Managed
from truearm.cell.schema import Positive, Section, TcpPort
from truearm.errors import InputError
from truearm.robot import Robot
from truearm.rotations import rotation_vector_from_matrix
from truearm.types import Floats

JOINTS: Final = 6
THERE_RAD: Final = 2e-4
DIGITS: Final = 6
STATE_ASKED: Final = "the request for its state"
STILL_RAD_S: Final = 1e-3
SENDINGS: Final = 8
STOP_RAD_S2: Final = 4.0
MOTION_MARGIN: Final = 2.0
STARTS_WITHIN_S: Final = 0.5


class UniversalRobots(Managed):
    """An arm of Universal Robots; see the module."""

    class Settings(Section):
        """Keys of [robot] with driver "ur"."""

        driver: str = "ur"
        host: str
        script_port: TcpPort = 30002
        realtime_port: TcpPort = 30003
        timeout_s: Positive = 2.0
        speed_rad_s: Positive = 1.0
        acceleration_rad_s2: Positive = 1.4
        settle_s: Positive = 0.2

    def __init__(self, settings: Settings, arm: Robot) -> None:
        if arm.joint_count != JOINTS:
            raise InputError(f"{arm.name} has {arm.joint_count} joints", rule="These arms have six")
        self._settings, self._arm = settings, arm
        address = tcp_address(settings.host, settings.script_port)
        self._script = LinePort(self.name, address, settings.timeout_s)
        self._stream: _Stream | None = None
        self._unheard: _Unheard | None = None
        self._busy = threading.RLock()

    @property
    def name(self) -> str:
        """See Device."""
        return "UR"

    @property
    def address(self) -> str:
        """See Device."""
        return tcp_address(self._settings.host, self._settings.realtime_port)

    def connect(self) -> None:
        """Open both ports and wait for the first state."""
        self._script.open()
        self._unheard = _Unheard(self._script, self._settings.timeout_s)
        try:
            host, port, limit = self._settings.host, self._settings.realtime_port, self._settings.timeout_s
            self._stream = _Stream(self.name, self.address, open_tcp(self.name, host, port, limit), limit)
            self._state()
        except BaseException:
            self.close()
            raise

    def move_joints(self, readings: Floats) -> None:
        """See Robot."""
        target = np.asarray(readings, dtype=np.float64)
        low, high = self._arm.limits.T
        beyond = np.flatnonzero((target < low) | (target > high))
        if beyond.size:
            joint = int(beyond[0])
            raise RefusedError(
                f"joint {joint + 1} at {np.degrees(target[joint]):.1f} deg",
                where=self._script.where,
                rule=f"Its limits are {np.degrees(low[joint]):g} to {np.degrees(high[joint]):g} deg",
            )
        self._move(f"[{','.join(f'{value:.{DIGITS}f}' for value in _within(target, low, high))}]", target)

    def move_pose(self, base_from_tool: Floats) -> None:
        """See Robot. The controller's own inverse kinematics and tool centre point are used."""
        turn = rotation_vector_from_matrix(base_from_tool[:3, :3])
        numbers = [*base_from_tool[:3, 3], *turn]
        self._move(f"p[{','.join(f'{value:.6f}' for value in numbers)}]", None)

    def read_joints(self) -> Floats:
        """See Robot. Of a state that came since: what came before may be as old as `timeout_s`."""
        self._wait_for_next(self._state())
        return self._state().readings.copy()

    def stop(self) -> None:
        """See Device."""
        self._script.interrupt()
        try:
            if self._script.is_open:
                self._script.send(f"stopj({STOP_RAD_S2:g})")
        finally:
            with self._busy:
                self._script.resume()

    def close(self) -> None:
        """See Device."""
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()
        unheard, self._unheard = self._unheard, None
        if unheard is not None:
            unheard.end()
        self._script.close()

    def _move(self, place: str, target: Floats | None) -> None:
        """Send a motion until the arm gets there; without a target, until it moved and stands."""
        options = f"a={self._settings.acceleration_rad_s2:g}, v={self._settings.speed_rad_s:g}"
        with self._busy:
            for _ in range(SENDINGS):
                self._check_ready()
                self._script.begin(f"movej({place}, {options})")
                if self._arrives(target):
                    return
            self._check_ready()
        raise DeviceError(
            f"the arm did not get there ({SENDINGS} tries)",
            where=self._script.where,
            rule=f"It must begin to move within {STARTS_WITHIN_S + self._settings.settle_s:g} s",
            way_out="See what its teach pendant says; an e-Series arm obeys under remote control only",
        )

    def _check_ready(self) -> None:
        """Raise if the controller says that somebody has to make the arm ready before it can move."""
        mode = self._state().robot_mode
        if mode != ur_packets.RUNNING:
            words = ur_packets.ROBOT_MODES.get(int(mode), f"in robot mode {mode:g}")
            raise NotReadyError(
                f"the arm is {words}",
                where=f"{self.name} at {self.address}",
                way_out="Make it ready at the teach pendant and start again: the session continues",
            )

    def _arrives(self, target: Floats | None) -> bool:
        """Wait for the end of a motion; False if it never began, or ended elsewhere.

        An arm may be slower than it was told to be, as by its speed slider: it has time while it gets nearer.
        It is there once it has been within THERE_RAD, and still, for `settle_s`: a servo creeps to its place.
        """
        begin = self._state()
        limit, left = self._limit(begin.readings, target), np.inf
        until, moved = time.monotonic() + limit, False
        last_moved = came = time.monotonic()
        while time.monotonic() < until:
            state = self._state()
            # Encoders and speeds flicker; what has moved is farther off than they do.
            moved = moved or bool(np.abs(state.readings - begin.readings).max() > THERE_RAD)
            moves = bool(np.abs(state.speeds).max() > STILL_RAD_S)
            if moves:
                last_moved = time.monotonic()
            still_s = time.monotonic() - last_moved
            away = 0.0 if target is None else float(np.abs(state.readings - target).max())
            if moves or away >= THERE_RAD:
                came = time.monotonic()
            if target is not None and time.monotonic() - came >= self._settings.settle_s:
                return True
            if moves and (target is None or away < left - THERE_RAD):
                left, until = away, time.monotonic() + limit
            elsewhere = target is None or away >= THERE_RAD
            if elsewhere and still_s > self._settings.settle_s + (0.0 if moved else STARTS_WITHIN_S):
                return moved and target is None
            self._wait_for_next(state)
        raise DeviceSilentError(
            f"the motion did not end: in {limit:.1f} s the arm came no nearer",
            where=self._script.where,
            way_out="See what its teach pendant says",
        )

    def _limit(self, here: Floats, target: Floats | None) -> float:
        way = np.pi if target is None else float(np.abs(target - here).max())
        ramp = self._settings.speed_rad_s / self._settings.acceleration_rad_s2
        seconds = MOTION_MARGIN * (way / self._settings.speed_rad_s + ramp)
        return self._settings.timeout_s + self._settings.settle_s + seconds

    def _wait_for_next(self, state: ur_packets.State) -> None:
        stream = self._connected()
        until = time.monotonic() + self._settings.timeout_s
        while stream.newest(self._settings.timeout_s) is state:
            if self._script.is_interrupted:
                raise stopped(self.name, self.address)
            if time.monotonic() > until:
                raise silent(self.name, self.address, self._settings.timeout_s, doing=STATE_ASKED)
            stream.wait()
        if self._script.is_interrupted:
            raise stopped(self.name, self.address)

    def _state(self) -> ur_packets.State:
        state = self._connected().newest(self._settings.timeout_s)
        if state.safety_mode not in ur_packets.MOVING_ALLOWED:
            words = ur_packets.SAFETY_MODES.get(int(state.safety_mode), f"safety mode {state.safety_mode:g}")
            stopped_itself = state.safety_mode == ur_packets.PROTECTIVE_STOP
            kind = ProtectiveStopError if stopped_itself else EmergencyStopError
            raise kind(
                f"the arm is in {words}",
                where=f"{self.name} at {self.address}",
                way_out="Clear it at the teach pendant and start again: the session continues",
            )
        return state

    def _connected(self) -> "_Stream":
        if self._stream is None:
            raise DeviceError("not connected", where=f"{self.name} at {self.address}")
        return self._stream


def _within(target: Floats, low: Floats, high: Floats) -> Floats:
    """A target as it is sent: one at a limit is not rounded beyond it, where no arm would move to."""
    last = 10.0**DIGITS
    return np.clip(np.round(target, DIGITS), np.ceil(low * last) / last, np.floor(high * last) / last)


class _Unheard:
    """A thread that reads what the script port says, and forgets it, so that the port does not fill up."""

    def __init__(self, port: LinePort, limit_s: float) -> None:
        self._port, self._limit_s = port, limit_s
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def end(self) -> None:
        """End the thread."""
        self._ended.set()
        self._thread.join(self._limit_s)

    def _run(self) -> None:
        with contextlib.suppress(DeviceError):  # what is sent next tells it
            while not self._ended.is_set():
                self._port.ignore()


class _Stream:
    """A thread that keeps the newest state, so that none grows old in a buffer."""

    def __init__(self, device: str, address: str, channel: Channel, limit_s: float) -> None:
        self._device, self._address, self._channel = device, address, channel
        self._state: ur_packets.State | None = None
        self._came = time.monotonic()
        self._limit_s = limit_s
        self._fault = ""
        self._restarted = False
        self._ended = threading.Event()
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def newest(self, limit_s: float) -> ur_packets.State:
        """The newest state, not older than the limit."""
        until = time.monotonic() + limit_s
        while True:
            if self._restarted:
                raise DeviceRestartedError(
                    "the controller was started anew", where=f"{self._device} at {self._address}"
                )
            if self._fault:
                raise gone(self._device, self._address, self._fault)
            state = self._state
            if state is not None and time.monotonic() - self._came < limit_s:
                return state
            if time.monotonic() >= until:
                raise silent(self._device, self._address, limit_s, doing=STATE_ASKED)
            self.wait()

    def wait(self) -> None:
        """Wait a little for news."""
        with self._news:
            self._news.wait(0.05)

    def close(self) -> None:
        """End the thread and the connection."""
        self._ended.set()
        self._thread.join(self._limit_s)
        self._channel.close()

    def _run(self) -> None:
        rest = b""
        while not (self._ended.is_set() or self._fault):
            try:
                packet, rest = ur_packets.last_whole(rest + self._channel.read())
            except (ConnectionEndedError, ValueError) as error:
                packet, self._fault = None, str(error)
            if packet is not None:
                state = ur_packets.parse(packet)
                self._restarted |= self._state is not None and state.time_s < self._state.time_s
                self._state, self._came = state, time.monotonic()
            with self._news:
                self._news.notify_all()
