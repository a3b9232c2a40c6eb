"""The loop of a virtual device: lines in, answers out when they are due, with faults on the way."""

import heapq
import select
from collections.abc import Callable
from itertools import count
from typing import Final, Protocol

from truearm.cell.virtual.faults import Faults
from truearm.cell.virtual.wires import Wire
from truearm.cell.virtual.world import World

LONGEST_WAIT_S: Final = 0.05


class Machine(Protocol):
    """A device as a state machine over virtual time."""

    terminator: bytes

    def received(self, line: str, now: float) -> list[tuple[float, str]]:
        """Take a line; answers, each with the time at which it is due."""

    def pending(self, now: float) -> list[tuple[float, str]]:
        """Answers to what was put off."""

    def next_event(self) -> float | None:
        """When `pending` should be asked again; None if there is nothing to wait for."""

    def restart(self) -> None:
        """Lose all that a loss of power loses."""


class Stream(Protocol):
    """A second wire on which a device sends of its own accord."""

    wire: Wire
    period_s: float

    def packet(self, now: float) -> bytes:
        """What is sent now."""


def serve(
    machine: Machine,
    wire: Wire,
    world: World,
    faults: Faults,
    ended: Callable[[], bool],
    stream: Stream | None = None,
) -> None:
    """Serve until `ended` says so."""
    _Server(machine, wire, world, faults, stream).run(ended)


class _Server:
    def __init__(
        self, machine: Machine, wire: Wire, world: World, faults: Faults, stream: Stream | None
    ) -> None:
        self._machine, self._wire, self._world, self._faults, self._stream = (
            machine,
            wire,
            world,
            faults,
            stream,
        )
        self._arriving: list[tuple[float, int, bytes]] = []
        self._leaving: list[tuple[float, int, bytes]] = []
        self._numbers = count()
        self._rest = b""
        self._silent_until, self._away = 0.0, False
        self._wires = [wire] if stream is None else [wire, stream.wire]
        self._next_packet = 0.0

    def run(self, ended: Callable[[], bool]) -> None:
        while not ended():
            self._wait()
            if self._away and self._world.shared.now() >= self._silent_until:
                self._come_back()
            self._take()
            now = self._world.shared.now()
            for line in _due(self._arriving, now):
                self._handle(line, now)
            self._answer(self._machine.pending(self._world.shared.now()))
            for line in _due(self._leaving, self._world.shared.now()):
                self._wire.write(line)
            self._send_stream()

    def _wait(self) -> None:
        now = self._world.shared.now()
        times = [heap[0][0] for heap in (self._arriving, self._leaving) if heap]
        event = self._machine.next_event()
        if event is not None:
            times.append(event)
        wait = min([LONGEST_WAIT_S, *((moment - now) / self._world.shared.speed for moment in times)])
        watched = self._wire.waits_for()
        if self._stream is not None:
            wait = min(wait, self._stream.period_s)
            watched = watched + self._stream.wire.waits_for()
        select.select(watched, [], [], max(0.0, wait))

    def _take(self) -> None:
        *lines, self._rest = (self._rest + self._wire.read()).split(self._machine.terminator)
        now = self._world.shared.now()
        for line in lines:
            for late_s, copy in self._faults.carried(line):
                heapq.heappush(self._arriving, (now + late_s, next(self._numbers), copy))

    def _handle(self, line: bytes, now: float) -> None:
        if now < self._silent_until:
            return
        if self._faults.restarts():
            self._go_away(now)
            return
        if self._faults.stops():
            self._world.emergency_stop(now)
        self._answer(self._machine.received(line.decode("ascii", "replace"), now))

    def _go_away(self, now: float) -> None:
        """Lose the power for a while."""
        self._machine.restart()
        self._leaving.clear()
        for wire in self._wires:
            wire.go_away()
        self._away, self._silent_until = True, now + self._faults.settings.restart_s

    def _come_back(self) -> None:
        for wire in self._wires:
            wire.come_back()
        self._away = False

    def _answer(self, answers: list[tuple[float, str]]) -> None:
        for due, text in answers:
            for late_s, copy in self._faults.carried(text.encode()):
                entry = (due + late_s, next(self._numbers), copy + self._machine.terminator)
                heapq.heappush(self._leaving, entry)

    def _send_stream(self) -> None:
        if self._stream is None:
            return
        self._stream.wire.read()
        now = self._world.shared.now()
        if self._away:
            return
        if now >= self._next_packet:
            self._stream.wire.write(self._stream.packet(now))
            self._next_packet = now + self._stream.period_s * self._world.shared.speed


def _due(heap: list[tuple[float, int, bytes]], now: float) -> list[bytes]:
    found = []
    while heap and heap[0][0] <= now:
        found.append(heapq.heappop(heap)[2])
    return found
