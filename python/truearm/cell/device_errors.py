"""What goes wrong with devices, each with the device, its port and the time limit in the message."""

from truearm.errors import WorkError


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


class StoppedError(DeviceError):
    """The call was ended by `stop` from another thread."""

    recoverable = False


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
