"""The two kinds of devices of a cell: a robot, and a sensor that measures a point of its tool.

A driver is a class that has these methods, derived from nothing. It is built as Driver(settings, arm), where
`settings` is an object of its pydantic class `Driver.Settings`, the keys of its section of the cell file, and
`arm` is the nominal robot. Building does not connect.

All calls block, and each has a time limit: it returns, or raises a DeviceError that names device, port and
limit. `stop` may come from another thread while a call is under way; that call then raises StoppedError.
:mod:`truearm.cell.conformance` tells whether a driver keeps to all this.
"""

from collections.abc import Callable
from types import TracebackType
from typing import Protocol, Self, TypeVar

from truearm.cell.reading import Expected, Reading
from truearm.types import Floats

T = TypeVar("T", bound="Device")


class Device(Protocol):
    """What robots and sensors have in common."""

    @property
    def name(self) -> str:
        """What people call it in messages."""

    @property
    def address(self) -> str:
        """The port it is at, as in the cell file."""

    def connect(self) -> None:
        """Open the port and see that the device is there and ready. Connecting twice is an error."""

    def stop(self) -> None:
        """Stop all motion. Works at any time, from any thread, connected or not, and more than once."""

    def close(self) -> None:
        """Let go of the port; no error if it is not open."""


class Robot(Device, Protocol):
    """An arm under a controller. Readings are (N,), rad or m, as the controller shows them."""

    def move_joints(self, readings: Floats) -> None:
        """Move to joint readings and come back when the arm is there and still.

        The arm may end beside them by what its controller rounds; read_joints tells where.
        """

    def move_pose(self, base_from_tool: Floats) -> None:
        """Move the controller's own tool to a pose (4, 4) in the frame of the base."""

    def read_joints(self) -> Floats:
        """Where the arm is."""


class Sensor(Device, Protocol):
    """An instrument that measures the target on the tool, in its own frame, the world."""

    def prepare(self, expected: Expected) -> None:
        """Be ready to measure near an expected point, without touching anything yet."""

    def measure(self) -> Reading:
        """Measure once. A reading that failed comes back as not valid; what cannot go on is raised."""

    def release(self) -> None:
        """Go out of the arm's way."""


class Connected:
    """A context manager over devices: connects them in order, closes them in any case.

    On the way out after an error or an interrupt all devices are stopped first.
    """

    def __init__(self, *devices: Device) -> None:
        self._devices = devices

    def __enter__(self) -> Self:
        try:
            for device in self._devices:
                device.connect()
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is not None:
                _each(self._devices, lambda device: device.stop())
        finally:
            self._close()

    def _close(self) -> None:
        _each(self._devices, lambda device: device.close())


class Managed:
    """A base of drivers that makes each a context manager, as Connected makes several devices one."""

    def __enter__(self: T) -> T:
        Connected(self).__enter__()
        return self

    def __exit__(
        self: T, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        Connected(self).__exit__(kind, error, trace)


def _each(devices: tuple[Device, ...], action: Callable[[Device], None]) -> None:
    """Do something to every device, and raise the first error when all had their turn."""
    first: Exception | None = None
    for device in devices:
        try:
            action(device)
        except Exception as error:  # noqa: BLE001 - raised below, once every device had its turn
            first = first or error
    if first is not None:
        raise first
