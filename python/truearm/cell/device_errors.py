"""What goes wrong with devices, each with the device, its port and the time limit in the message."""

import traceback
from pathlib import Path
from types import TracebackType
from typing import Final, Protocol

from truearm.errors import TruearmError, WorkError

MEND_THE_DRIVER: Final = "Mend the driver: truearm.cell.conformance tries it"


class Addressed(Protocol):
    """What has a name and is somewhere."""

    @property
    def name(self) -> str:
        """What people call it."""

    @property
    def address(self) -> str:
        """The port it is at."""


class DeviceError(WorkError):
    """A device did not do its part. `recoverable` says whether connecting anew may help."""

    recoverable = True


class DeviceSilentError(DeviceError):
    """No answer within the time limit."""


class DeviceGoneError(DeviceError):
    """The connection ended."""


class DeviceRestartedError(DeviceError):
    """The device has forgotten what it was told, as after a loss of power."""


class RefusedError(DeviceError):
    """The device understood and will not: out of range, for instance."""

    recoverable = False


class PortUnavailableError(DeviceError):
    """The port is absent, closed, or somebody else has it."""


class EmergencyStopError(DeviceError):
    """Somebody pressed the button, or a safety device did."""

    recoverable = False


class ProtectiveStopError(EmergencyStopError):
    """The arm stopped itself, as where it met something."""


class NotReadyError(DeviceError):
    """The device is there and cannot work before somebody makes it ready, as an arm that is powered off."""

    recoverable = False


class StoppedError(DeviceError):
    """The call was ended by `stop` from another thread."""

    recoverable = False


class MalformedReadingError(DeviceError):
    """A driver gave something that is no reading: connecting anew does not help."""

    recoverable = False


class DriverError(DeviceError):
    """The driver itself failed: connecting anew does not help."""

    recoverable = False


class Calls:
    """Calls of a driver: errors that it lets through, the system's, of readings or its own, name the device.

    Used by `with`, which raises DeviceError with the device and its port.
    """

    __slots__ = ("_device",)

    def __init__(self, device: Addressed) -> None:
        self._device = device

    def __enter__(self) -> None:
        """Nothing has to be done before a call."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Name the device in an error that does not."""
        if isinstance(error, OSError):
            raise DeviceError(f"{type(error).__name__}: {error}", where=self._where()) from error
        if isinstance(error, MalformedReadingError):
            raise MalformedReadingError(
                error.what, where=self._where(), rule=error.rule, way_out=error.way_out
            ) from None
        if isinstance(error, Exception) and not isinstance(error, TruearmError):
            raise DriverError(
                f"its driver failed: {type(error).__name__}: {error} ({_last_line(trace)})",
                where=self._where(),
                way_out=MEND_THE_DRIVER,
            ) from error

    def _where(self) -> str:
        return f"{self._device.name} at {self._device.address}"


def _last_line(trace: TracebackType | None) -> str:
    """File and line where an error came up."""
    last = traceback.extract_tb(trace)[-1]
    return f"{Path(last.filename).name}, line {last.lineno}"


def silent(device: str, port: str, limit_s: float, *, doing: str = "") -> DeviceSilentError:
    """The error for a device that did not answer in time."""
    task = f" to {doing}" if doing else ""
    return DeviceSilentError(
        f"no answer{task} within {limit_s:g} s",
        where=f"{device} at {port}",
        way_out="Check its power and cable, or allow more with timeout_s",
    )


def gone(device: str, port: str, reason: str) -> DeviceGoneError:
    """The error for a connection that ended."""
    return DeviceGoneError(f"the connection ended: {reason}", where=f"{device} at {port}")


def stopped(device: str, port: str) -> StoppedError:
    """The error of a call that was under way when `stop` came."""
    return StoppedError("the call was ended by a stop", where=f"{device} at {port}")
