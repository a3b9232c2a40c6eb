"""Starting the devices of a virtual cell, and the cell file under which they are found."""

import multiprocessing
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
import tomli_w
from pydantic import BaseModel

from truearm.cell.cell_file import Cell
from truearm.cell.line_robot import LineRobot
from truearm.cell.line_sensor import LineSensor
from truearm.cell.rv_m2 import RvM2
from truearm.cell.table_panel import TablePanel
from truearm.cell.universal_robots import UniversalRobots
from truearm.cell.virtual.faults import Faults
from truearm.cell.virtual.line_devices import VirtualLineRobot, VirtualTracker, check_faults
from truearm.cell.virtual.rv_m2 import VirtualRvM2
from truearm.cell.virtual.serving import Machine, Stream, serve
from truearm.cell.virtual.state import STOPPED, Shared
from truearm.cell.virtual.table_panel import VirtualTablePanel
from truearm.cell.virtual.universal_robots import VirtualUr, VirtualUrStream
from truearm.cell.virtual.wires import PtyWire, TcpWire, Wire
from truearm.cell.virtual.world import World
from truearm.errors import InputError, WorkError
from truearm.files import parsed
from truearm.units import RADIANS_PER_DEGREE

DEVICES: Final = ("robot", "sensor")
# On macOS libraries of the system do not bear forks.
FORKS: Final = sys.platform == "linux" and hasattr(os, "fork")
STARTS_WITHIN_S: Final = 60.0
# Keys of devices that are times, each with the shortest that makes sense, or speeds: they follow the clock.
TIMES: Final = {
    "timeout_s": 0.2,
    "motion_timeout_s": 0.2,
    "origin_timeout_s": 1.0,
    "settle_s": 0.02,
    "starts_within_s": 0.2,
    "still_s": 0.02,
}
SPEEDS: Final = ("speed_mm_s", "touch_speed_mm_s")
# Pseudo-terminals have no parity bits.
PTY_FRAME: Final = "8N1"


class VirtualCell:
    """The devices of a cell file, virtual: a process for each, or a thread where asked for or needed.

    Threads are needed beside Linux, in processes that may have no children, as those of a cluster's workers,
    and outside of the main thread, for other threads may hold locks that a fork would keep for ever.

    Attributes:
        content: The cell file's values with the addresses at which the virtual devices are.
        world: What is true in it, once it runs.
    """

    def __init__(
        self, text: str, *, where: str = "cell", folder: Path = Path(), processes: bool = True
    ) -> None:
        """Check the file; nothing is started yet.

        Raises:
            InputError: If the file is wrong, a driver has no virtual counterpart, or a fault is not possible.
        """
        self._text, self._where, self._folder = text, where, folder.resolve()
        self._processes = processes and FORKS and _may_fork()
        self.content: dict[str, Any] = parsed(text, where=where)
        cell = Cell.from_toml(text, where=where, folder=folder)
        for device, settings in (("robot", cell.robot_settings), ("sensor", cell.sensor_settings)):
            if not isinstance(settings, tuple(MACHINES)):
                raise InputError(
                    "this driver has no virtual counterpart", where=f"{where}, {device}", rule=f"{KNOWN} have"
                )
        if isinstance(cell.sensor_settings, LineSensor.Settings):
            check_faults(cell.sensor_settings, cell.file.simulate, where)
        self._cell = cell
        self._ending = threading.Event()
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            memory = Path("/dev/shm")  # noqa: S108 - where there is one, the clock's file is kept in memory
            folder = tempfile.TemporaryDirectory(prefix="truearm-", dir=memory if memory.is_dir() else None)
            state = Path(stack.enter_context(folder)) / "state"
            Shared.create(state, self._cell.file.simulate.speed).close()
            self.world = World(self._cell, state)
            self.shared = self.world.shared
            stack.callback(self.shared.close)
            self._rest(self.world)
            stack.callback(self._ending.set)
            for device in DEVICES:
                address = self._started(device, state, stack)
                settings = getattr(self._cell, f"{device}_settings")
                self.content[device] = _at(self.content[device], address, settings, self.shared.speed)
            if os.name == "posix":  # all have it open: a process that is killed leaves nothing behind
                folder.cleanup()
            recovery_s = self._cell.file.process.recovery_s / self.shared.speed
            self.content["process"] = {**self.content.get("process", {}), "recovery_s": recovery_s}
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def cell_toml(self) -> str:
        """The cell file to measure with."""
        return tomli_w.dumps(self.content)

    def _rest(self, world: World) -> None:
        """Arm and table at rest where they are before anybody moves them."""
        settings, low_high = self._cell.robot_settings, self._cell.arm.limits.T
        start = np.clip(np.zeros(self._cell.arm.joint_count), *low_high)
        if isinstance(settings, RvM2.Settings):
            start = np.array(settings.origin_deg) * RADIANS_PER_DEGREE
        world.arm.go(start, 0.0, world.shared.now())
        world.table.go(np.zeros(3), 0.0, world.shared.now())

    def _started(self, device: str, state: Path, stack: ExitStack) -> Mapping[str, Any]:
        here, there = multiprocessing.Pipe(duplex=False)
        job = _Job(self._text, self._where, self._folder, device, state, there)
        if self._processes:
            process = multiprocessing.get_context("fork").Process(
                target=_in_process, args=(job,), daemon=True
            )
            process.start()
            stack.callback(process.join)
            stack.callback(process.terminate)
        else:
            thread = threading.Thread(target=_run, args=(job, self._ending.is_set), daemon=True)
            thread.start()
            stack.callback(thread.join)
            stack.callback(self._ending.set)
        if not here.poll(STARTS_WITHIN_S):
            raise WorkError(f"the virtual {device} did not start within {STARTS_WITHIN_S:g} s")
        with here:
            address: Mapping[str, Any] = here.recv()
        return address


@dataclass(frozen=True)
class _Job:
    """A device to be: its cell file, which of its devices, the shared state, and whom to tell the address."""

    text: str
    where: str
    folder: Path
    device: str
    state: Path
    report: Connection


def _may_fork() -> bool:
    in_main = threading.current_thread() is threading.main_thread()
    return in_main and not multiprocessing.current_process().daemon


def _in_process(job: _Job) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    parent = os.getppid()
    _run(job, lambda: os.getppid() != parent)


def _run(job: _Job, ended: Callable[[], bool]) -> None:
    """Be a device until the end."""
    cell = Cell.from_toml(job.text, where=job.where, folder=job.folder)
    world = World(cell, job.state)
    simulate = cell.file.simulate
    faults = Faults(simulate.faults, simulate.seed, DEVICES.index(job.device))
    settings = cell.robot_settings if job.device == "robot" else cell.sensor_settings
    machine, wire, stream, address = next(
        build(world, settings, faults) for kind, build in MACHINES.items() if isinstance(settings, kind)
    )
    job.report.send(address)
    job.report.close()
    try:
        serve(machine, wire, world, faults, ended, stream)
    finally:
        wire.close()
        if stream is not None:
            stream.wire.close()
        world.shared.close()


Built = tuple[Machine, Wire, Stream | None, dict[str, Any]]


def _rv_m2(world: World, settings: Any, faults: Faults) -> Built:  # noqa: ANN401
    del faults
    wire = _wire(settings.port)
    return VirtualRvM2(world, settings), wire, None, {"port": wire.address}


def _ur(world: World, settings: Any, faults: Faults) -> Built:  # noqa: ANN401
    del settings
    script, realtime = TcpWire(), TcpWire()
    address = {"host": "127.0.0.1", "script_port": script.port, "realtime_port": realtime.port}
    return VirtualUr(world), script, VirtualUrStream(world, realtime, faults), address


def _line_robot(world: World, settings: Any, faults: Faults) -> Built:  # noqa: ANN401
    del faults
    wire = _wire(settings.port)
    return VirtualLineRobot(world, settings), wire, None, {"port": wire.address}


def _table_panel(world: World, settings: Any, faults: Faults) -> Built:  # noqa: ANN401
    del faults
    wire = _wire(settings.port)
    return VirtualTablePanel(world, settings), wire, None, {"port": wire.address}


def _tracker(world: World, settings: Any, faults: Faults) -> Built:  # noqa: ANN401
    del faults
    wire = _wire(settings.port)
    return VirtualTracker(world, settings), wire, None, {"port": wire.address}


MACHINES: Final[Mapping[type[Any], Callable[[World, Any, Faults], Built]]] = {
    RvM2.Settings: _rv_m2,
    UniversalRobots.Settings: _ur,
    LineRobot.Settings: _line_robot,
    TablePanel.Settings: _table_panel,
    LineSensor.Settings: _tracker,
}
KNOWN: Final = '"rv-m2", "ur", "table-panel" and "line"'


def _wire(port: str) -> Wire:
    """A TCP port where the cell file has one, or there are no others, else a pseudo-terminal."""
    return TcpWire() if port.startswith("tcp://") or not hasattr(os, "openpty") else PtyWire()


def _at(
    section: Mapping[str, Any], address: Mapping[str, Any], settings: BaseModel, speed: float
) -> dict[str, Any]:
    """A device's section with another address, and times and speeds that follow the virtual clock."""
    changed = {**section, **address}
    known = type(settings).model_fields
    if "frame" in known:
        changed["frame"] = PTY_FRAME
    for key, least in TIMES.items():
        if key in known:
            changed[key] = max(least, float(getattr(settings, key)) / speed)
    return changed | {key: float(getattr(settings, key)) * speed for key in SPEEDS if key in known}


def release_emergency_stop(shared: Shared) -> None:
    """Pull the button out again."""
    shared.set_flag(STOPPED, False)
