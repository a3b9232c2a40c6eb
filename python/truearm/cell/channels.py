"""Bytes to and from a device: a serial port, or a TCP connection."""

import contextlib
import errno
import os
import re
import select
import socket
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Final, Protocol

import serial

from truearm.cell.device_errors import PortUnavailableError

try:
    import termios
except ImportError:  # Windows
    TERMINAL_ERRORS: tuple[type[Exception], ...] = ()
else:
    TERMINAL_ERRORS = (termios.error,)

# What pyserial raises where a port cannot be opened.
SERIAL_ERRORS: Final[tuple[type[Exception], ...]] = (serial.SerialException, OSError, *TERMINAL_ERRORS)

# The longest a read waits before it looks whether the call was stopped.
SLICE_S: Final = 0.02
CHUNK: Final = 4096
# No descriptor.
CLOSED: Final = -1
TCP: Final = "tcp://"
TCP_PLACE: Final = re.compile(r"(?:\[(?P<bracketed>[^\[\]]+)\]|(?P<host>[^\[\]:/\s]+)):(?P<port>\d{1,5})")
MOST_PORT: Final = 65535
READS_AT_END: Final = 256


class ConnectionEndedError(OSError):
    """The other side has gone."""


class Wire(Protocol):
    """What a channel goes through; where it has gone or was closed, OSError or ValueError is raised."""

    def receive(self, wait_s: float) -> bytes | None:
        """What has come within a time: None where nothing has, empty where the other side has gone."""

    def send(self, data: bytes, wait_s: float) -> int:
        """How many bytes it has taken; none where it takes none now, after waiting for that."""

    def close(self) -> None:
        """Be no more; others may still wait for it."""


class _Waited(ABC):
    """What can be waited for by its number, and does not block."""

    def __init__(self, port: serial.Serial | socket.socket) -> None:
        self._port, self._number = port, port.fileno()

    def receive(self, wait_s: float) -> bytes | None:
        """See Wire."""
        if not select.select([self._number], [], [], wait_s)[0]:
            return None
        try:
            return self._read()
        except BlockingIOError:
            return None

    def send(self, data: bytes, wait_s: float) -> int:
        """See Wire."""
        try:
            return self._write(data)
        except BlockingIOError:
            select.select([], [self._number], [], wait_s)
            return 0

    def close(self) -> None:
        """See Wire."""
        self._number = CLOSED
        self._port.close()

    @abstractmethod
    def _read(self) -> bytes:
        """What is there."""

    @abstractmethod
    def _write(self, data: bytes) -> int:
        """How many bytes are taken."""


class _Terminal(_Waited):
    """A serial port, or a pseudo-terminal, by its descriptor."""

    def __init__(self, port: serial.Serial) -> None:
        super().__init__(port)
        os.set_blocking(self._number, False)

    def _read(self) -> bytes:
        return os.read(self._number, CHUNK)

    def _write(self, data: bytes) -> int:
        return os.write(self._number, data)


class _Connection(_Waited):
    """A TCP connection; on Windows the number of a socket is no descriptor."""

    def __init__(self, opened: socket.socket) -> None:
        super().__init__(opened)
        self._socket = opened
        opened.setblocking(False)

    def close(self) -> None:
        """See Wire.

        What has come is read before: a connection that is closed with something unread is reset, and what was
        sent last may be lost.
        """
        with contextlib.suppress(OSError, ValueError):
            self._socket.shutdown(socket.SHUT_WR)
            for _ in range(READS_AT_END):
                if not self.receive(0.0):
                    break
        super().close()

    def _read(self) -> bytes:
        return self._socket.recv(CHUNK)

    def _write(self, data: bytes) -> int:
        return self._socket.send(data)


class _Buffered:
    """A serial port whose descriptor cannot be waited for, as on Windows: pyserial waits."""

    def __init__(self, port: serial.Serial, limit_s: float) -> None:
        self._port = port
        port.timeout, port.write_timeout = SLICE_S, limit_s

    def receive(self, wait_s: float) -> bytes | None:
        """See Wire; it waits a slice or not at all."""
        with _closed_in_mid_call():
            first = self._port.read(1) if wait_s > 0.0 else b""
            return first + self._port.read(self._port.in_waiting) or None

    def send(self, data: bytes, wait_s: float) -> int:
        """See Wire; it waits as long as was said at first."""
        del wait_s
        with _closed_in_mid_call():
            return self._port.write(data) or 0

    def close(self) -> None:
        """See Wire."""
        self._port.close()


@contextlib.contextmanager
def _closed_in_mid_call() -> Iterator[None]:
    """Around a call of pyserial, which finds nothing where a port is closed meanwhile."""
    try:
        yield
    except (AttributeError, TypeError) as error:
        raise OSError("it was closed") from error


class Channel:
    """An open connection, a serial port or a TCP one: what has come, and what is sent, as bytes."""

    def __init__(self, wire: Wire, limit_s: float, *, ended: str) -> None:
        """Take over what is open; `ended` says what it means when it gives nothing."""
        self._wire, self._limit_s, self._ended = wire, limit_s, ended

    def read(self, *, wait: bool = True) -> bytes:
        """What has come, after waiting a slice at most, or not at all; empty where nothing has.

        Raises:
            ConnectionEndedError: If the other side has gone, or the connection was closed.
        """
        try:
            data = self._wire.receive(SLICE_S if wait else 0.0)
        except (OSError, ValueError) as error:  # ValueError: closed in mid-wait
            raise _ended(error) from None
        if data == b"":
            raise ConnectionEndedError(self._ended)
        return data or b""

    def write(self, data: bytes) -> None:
        """Send all of it.

        Raises:
            ConnectionEndedError: If the other side has gone, or does not take it within the limit.
        """
        until = time.monotonic() + self._limit_s
        while data:
            try:
                taken = self._wire.send(data, max(0.0, until - time.monotonic()))
            except (OSError, ValueError) as error:  # ValueError: closed in mid-wait
                raise _ended(error) from None
            if not taken and time.monotonic() > until:
                raise ConnectionEndedError(f"it could not be sent within {self._limit_s:g} s")
            data = data[taken:]

    def close(self) -> None:
        """End the connection."""
        self._wire.close()


def open_serial(device: str, port: str, baud: int, limit_s: float, *, frame: str = "8N1") -> Channel:
    """A serial port or a pseudo-terminal, for this process alone.

    Args:
        device: What people call the device.
        port: Its name.
        baud: Bits a second.
        limit_s: How long the port may take to take what is sent.
        frame: Bits, parity and stop bits as in "8N1" or "8E2".

    Raises:
        PortUnavailableError: If there is no such port, somebody else has it, or it may not be opened.
    """
    bits, parity, stops = int(frame[0]), frame[1], int(frame[2])
    try:
        opened = serial.Serial(port, baud, bytesize=bits, parity=parity, stopbits=stops, exclusive=True)
    except SERIAL_ERRORS as error:
        raise _unavailable(device, port, error, limit_s) from None
    wire = _Terminal(opened) if hasattr(os, "openpty") else _Buffered(opened, limit_s)
    return Channel(wire, limit_s, ended="the port is gone")


def open_tcp(device: str, host: str, port: int, limit_s: float) -> Channel:
    """A TCP connection.

    Raises:
        PortUnavailableError: If nobody listens there, or not within the limit.
    """
    place = tcp_address(host, port)
    try:
        opened = socket.create_connection((host, port), timeout=limit_s)
    except TimeoutError:
        raise PortUnavailableError(
            f"no connection within {limit_s:g} s", where=f"{device} at {place}"
        ) from None
    except (OSError, UnicodeError) as error:  # UnicodeError: a name that no host can have
        raise PortUnavailableError(
            f"no connection: {getattr(error, 'strerror', None) or error} (limit {limit_s:g} s)",
            where=f"{device} at {place}",
            way_out="Check that the device is on and listens at this port",
        ) from None
    opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return Channel(_Connection(opened), limit_s, ended="the other side closed it")


def open_channel(
    device: str, address: str, limit_s: float, *, baud: int = 9600, frame: str = "8N1"
) -> Channel:
    """The connection to an address: "tcp://HOST:PORT", or the name of a serial port.

    Raises:
        PortUnavailableError: If it cannot be opened; says why.
    """
    try:
        place = tcp_place(address)
    except ValueError as error:
        raise PortUnavailableError(str(error), where=device) from None
    if place is not None:
        return open_tcp(device, *place, limit_s)
    return open_serial(device, address, baud, limit_s, frame=frame)


def tcp_address(host: str, port: int) -> str:
    """The address of a TCP port; an IPv6 host stands in brackets."""
    return f"{TCP}[{host}]:{port}" if ":" in host else f"{TCP}{host}:{port}"


def tcp_place(address: str) -> tuple[str, int] | None:
    """Host and number of the TCP port of an address; None for the name of a serial port.

    Raises:
        ValueError: If it begins as that of a TCP port and goes on otherwise; for pydantic's validators.
    """
    if not address.startswith(TCP):
        return None
    match = TCP_PLACE.fullmatch(address.removeprefix(TCP))
    if match is None or not 1 <= int(match["port"]) <= MOST_PORT:
        raise ValueError(
            f'"{address}" is no TCP port: {TCP}HOST:PORT with a number from 1 to {MOST_PORT}, '
            f"{TCP}[HOST]:PORT with an IPv6 address"
        )
    return match["bracketed"] or match["host"], int(match["port"])


def _ended(error: Exception) -> ConnectionEndedError:
    return ConnectionEndedError(getattr(error, "strerror", None) or str(error))


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
