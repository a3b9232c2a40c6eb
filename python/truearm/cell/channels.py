"""Bytes to and from a device: a serial port, or a TCP connection."""

import errno
import os
import select
import socket
import termios
from typing import Final, Protocol

import serial

from truearm.cell.device_errors import PortUnavailableError

# What pyserial raises; TypeError where the port was closed in the middle of a call.
SERIAL_ERRORS: Final = (serial.SerialException, OSError, TypeError, termios.error)

# The longest a read waits before it looks whether the call was stopped.
SLICE_S: Final = 0.02
CHUNK: Final = 65536


class ConnectionEndedError(OSError):
    """The other side has gone."""


class Channel(Protocol):
    """An open connection."""

    def read(self, *, wait: bool = True) -> bytes:
        """What has come, after waiting a slice at most, or not at all; empty where nothing has."""

    def write(self, data: bytes) -> None:
        """Send all of it."""

    def close(self) -> None:
        """End the connection."""


class SerialChannel:
    """A serial port or a pseudo-terminal, for this process alone."""

    def __init__(self, device: str, port: str, baud: int, limit_s: float, *, frame: str = "8N1") -> None:
        """Open it; `frame` gives bits, parity and stop bits as in "8N1" or "8E2".

        Raises:
            PortUnavailableError: If there is no such port, somebody else has it, or it may not be opened.
        """
        bits, parity, stops = int(frame[0]), frame[1], int(frame[2])
        try:
            self._port = serial.Serial(
                port,
                baud,
                bytesize=bits,
                parity=parity,
                stopbits=stops,
                timeout=SLICE_S,
                write_timeout=limit_s,
                exclusive=True,
            )
        except SERIAL_ERRORS as error:
            raise _unavailable(device, port, error, limit_s) from None
        self._limit_s = limit_s

    def read(self, *, wait: bool = True) -> bytes:
        """See Channel."""
        try:
            number = self._port.fileno()
            if not select.select([number], [], [], SLICE_S if wait else 0.0)[0]:
                return b""
            data = os.read(number, CHUNK)
        except (*SERIAL_ERRORS, ValueError) as error:  # ValueError: closed in mid-wait
            raise ConnectionEndedError(str(error)) from None
        if not data:
            raise ConnectionEndedError("the port is gone")
        return data

    def write(self, data: bytes) -> None:
        """See Channel. What the port does not take within its limit ends the connection."""
        try:
            number = self._port.fileno()
            while len(data) > (sent := _sent(number, data)):
                data = data[sent:]
                if not select.select([], [number], [], self._limit_s)[1]:
                    raise ConnectionEndedError(f"nothing could be sent within {self._limit_s:g} s")
        except (*SERIAL_ERRORS, ValueError) as error:
            raise ConnectionEndedError(str(error)) from None

    def close(self) -> None:
        """See Channel."""
        self._port.close()


class TcpChannel:
    """A TCP connection."""

    def __init__(self, device: str, host: str, port: int, limit_s: float) -> None:
        """Connect.

        Raises:
            PortUnavailableError: If nobody listens there, or not within the limit.
        """
        place = f"tcp://{host}:{port}"
        try:
            self._socket = socket.create_connection((host, port), timeout=limit_s)
        except TimeoutError:
            raise PortUnavailableError(
                f"no connection within {limit_s:g} s", where=f"{device} at {place}"
            ) from None
        except OSError as error:
            raise PortUnavailableError(
                f"no connection: {error.strerror or error} (limit {limit_s:g} s)",
                where=f"{device} at {place}",
                way_out="Check that the device is on and listens at this port",
            ) from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.settimeout(SLICE_S)

    def read(self, *, wait: bool = True) -> bytes:
        """See Channel."""
        try:
            if not (wait or select.select([self._socket], [], [], 0.0)[0]):
                return b""
            data = self._socket.recv(CHUNK)
        except TimeoutError:
            return b""
        except ValueError:  # closed in mid-read
            raise ConnectionEndedError("it was closed") from None
        except OSError as error:
            raise ConnectionEndedError(error.strerror or str(error)) from None
        if not data:
            raise ConnectionEndedError("the other side closed it")
        return data

    def write(self, data: bytes) -> None:
        """See Channel."""
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise ConnectionEndedError(error.strerror or str(error)) from None

    def close(self) -> None:
        """See Channel."""
        self._socket.close()


def open_channel(
    device: str, address: str, limit_s: float, *, baud: int = 9600, frame: str = "8N1"
) -> Channel:
    """The connection to an address: "tcp://HOST:PORT", or the name of a serial port.

    Raises:
        PortUnavailableError: If it cannot be opened; says why.
    """
    if address.startswith("tcp://"):
        host, _, port = address.removeprefix("tcp://").rpartition(":")
        return TcpChannel(device, host, int(port), limit_s)
    return SerialChannel(device, address, baud, limit_s, frame=frame)


def _sent(number: int, data: bytes) -> int:
    """How much of `data` a descriptor that does not block took at once."""
    try:
        return os.write(number, data)
    except BlockingIOError:
        return 0


def _unavailable(device: str, port: str, error: Exception, limit_s: float) -> PortUnavailableError:
    where = f"{device} at {port}"
    number = getattr(error, "errno", None)
    if number in (errno.EWOULDBLOCK, errno.EACCES, errno.EBUSY) and "lock" in str(error).casefold():
        return PortUnavailableError(
            f"somebody else has this port (limit {limit_s:g} s)",
            where=where,
            way_out="End the other program",
        )
    if number == errno.ENOENT:
        return PortUnavailableError(f"there is no such port (limit {limit_s:g} s)", where=where)
    if number == errno.EACCES:
        return PortUnavailableError(
            f"no permission to open this port (limit {limit_s:g} s)",
            where=where,
            way_out="Join the group that owns it, often dialout",
        )
    return PortUnavailableError(f"cannot be opened: {error} (limit {limit_s:g} s)", where=where)
