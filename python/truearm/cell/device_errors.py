"""What goes wrong with devices, each with the device, its port and the time limit in the message."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from truearm.errors import WorkError


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


@contextmanager
def calls(device: Addressed) -> Iterator[None]:
    """Calls of a driver: errors of the system that it lets through, or of its readings, name the device.

    Raises:
        DeviceError: With the device and its port.
    """
    where = f"{device.name} at {device.address}"
    try:
        yield
    except OSError as error:
        raise DeviceError(f"{type(error).__name__}: {error}", where=where) from error
    except MalformedReadingError as error:
        raise MalformedReadingError(error.what, where=where, rule=error.rule, way_out=error.way_out) from None


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
