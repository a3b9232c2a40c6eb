"""Robot and sensor as they work together: who moves when, and what is done when one fails."""

import math
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Final

import numpy as np

from truearm.cell.cell_file import Cell
from truearm.cell.device_errors import Calls, DeviceError, RefusedError, StoppedError
from truearm.cell.protocols import Device
from truearm.cell.reading import Expected
from truearm.cell.table_panel import TablePanel
from truearm.cell.ways import Ways
from truearm.types import Floats

LETS_GO_WITHIN_S: Final = 0.7


def places_on_the_way(cell: Cell, readings: Floats, side: int) -> list[Floats]:
    """Readings to go through to a pose, so that every joint comes from a side: 1, -1, or 0 for any."""
    return cell.run_up.places(readings, side)


class Crew:
    """The two devices of a cell.

    How arm and table get by one another says truearm.cell.ways.

    Nothing is connected or set in motion once `halted` is set: a stop alone ends what is under way, and not
    what comes behind it.
    """

    def __init__(self, cell: Cell, note: Callable[[str, str], None], halted: threading.Event) -> None:
        self._cell, self._note, self._halted = cell, note, halted
        self._table = cell.sensor if isinstance(cell.sensor, TablePanel) else None
        self._aside = ThreadPoolExecutor(1, thread_name_prefix="sensor")
        self._ways: Ways | None = None
        self._here: Floats | None = None
        self._refuge = np.clip(np.zeros(cell.arm.joint_count), *cell.arm.limits.T)

    def connect(self) -> None:
        """Connect the sensor, get it out of the way, then the robot.

        Raises:
            StoppedError: If the process is ended meanwhile.
        """
        sensor, robot = self._cell.sensor, self._cell.robot
        for device, action in ((sensor, sensor.connect), (sensor, sensor.release), (robot, robot.connect)):
            self.raise_if_halted()
            with Calls(device):
                action()
        self._refuge = self.where()

    def go(self, way: list[Floats], expected: Expected, world_from_base: Floats | None) -> Floats:
        """Bring the arm along readings to the last of them, and the sensor before its target.

        Args:
            way: Readings (N,) one after another.
            expected: Where the target will be.
            world_from_base: Where the base stands as far as is known; needed by a sensor that comes close.

        Returns:
            Where the arm is (N,).

        Raises:
            RefusedError: If link and table would meet whatever goes first, or a device refuses.
            StoppedError: If the process is ended meanwhile.
        """
        if self._table is None:
            self._along(way)
            self.raise_if_halted()
            with Calls(self._cell.sensor):
                self._cell.sensor.prepare(expected)
        else:
            self._with_table(self._table, way, expected, world_from_base)
        return self.where()

    def _with_table(
        self, table: TablePanel, way: list[Floats], expected: Expected, world_from_base: Floats | None
    ) -> None:
        carriage, here = table.carriage, self._here
        if carriage is None or here is None or world_from_base is None:
            raise RefusedError("where arm and table are is not known", where="the cell")
        if self._ways is None:
            self._ways = Ways(self._cell, table)
        found = self._ways.to(
            way,
            expected,
            here=here,
            carriage=carriage,
            refuge=self._refuge,
            world_from_base=world_from_base,
        )
        if found.over is None:
            self._together(found.arm, expected)
            return
        for place in found.over:
            self.raise_if_halted()
            table.go_to(place)
        if not found.waits:
            self._along(found.arm)
        self.raise_if_halted()
        table.prepare(expected)
        if found.waits:
            self._along(found.arm)

    def _together(self, way: list[Floats], expected: Expected) -> None:
        self.raise_if_halted()
        coming = self._aside.submit(self._cell.sensor.prepare, expected)
        try:
            self._along(way)
        except BaseException:
            # What ended the way is to be raised, not that the sensor failed too.
            self._tried("stop sensor", self._cell.sensor.stop)
            wait([coming], LETS_GO_WITHIN_S)
            raise
        coming.result()

    def _along(self, way: list[Floats]) -> None:
        for place in way:
            self.raise_if_halted()
            self._here = None
            with Calls(self._cell.robot):
                self._cell.robot.move_joints(place)
            self._here = place

    def where(self) -> Floats:
        """Where the arm is (N,), as its robot says.

        Raises:
            DeviceError: If it does not say it, or what it says is none.
        """
        robot = self._cell.robot
        with Calls(robot):
            told = robot.read_joints()
        try:
            here = np.array(told, dtype=np.float64)
        except (TypeError, ValueError):
            here = np.empty(0)
        if here.shape != (self._cell.arm.joint_count,) or not all(map(math.isfinite, here.tolist())):
            raise DeviceError(f"it reads its joints as {told!r}", where=robot.name)
        self._here = here
        return here

    def recover(self) -> None:
        """Stop the arm while it can still be told to, and connect both devices anew, as at the start."""
        self._stop(self._cell.robot)
        self.quiet()
        self._here = None
        self.connect()

    def raise_if_halted(self) -> None:
        """Raise StoppedError once the process is to end."""
        if self._halted.is_set():
            raise StoppedError("the process was ended")

    def stop(self) -> None:
        """Stop both devices at once, from any thread."""
        self._stop(self._cell.robot, self._cell.sensor)

    def _stop(self, *devices: Device) -> None:
        together = [
            threading.Thread(target=self._tried, args=(f"stop {device.name}", device.stop), daemon=True)
            for device in devices
        ]
        for thread in together:
            thread.start()
        for thread in together:
            thread.join(LETS_GO_WITHIN_S)

    def dismiss(self) -> None:
        """Get the sensor out of the way and let go of both devices; what fails is noted, nothing is raised.

        The sensor has a second for it; a table then goes on to the end of its way by itself.
        """
        away = threading.Thread(target=self._tried, args=("retract", self._cell.sensor.release), daemon=True)
        away.start()
        away.join(LETS_GO_WITHIN_S)
        self.quiet()
        self._aside.shutdown(wait=False, cancel_futures=True)

    def quiet(self) -> None:
        """Close both ports; what fails is noted."""
        self._tried("close robot", self._cell.robot.close)
        self._tried("close sensor", self._cell.sensor.close)

    def _tried(self, what: str, action: Callable[[], None]) -> None:
        try:
            action()
        except Exception as error:  # noqa: BLE001 - a driver of a user's own may raise anything
            self._note("failed", f"{what}: {str(error) or type(error).__name__}")
