"""Lines to and from a device, with time limits, and a way to end a wait from another thread."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Final, Literal, Self, TypeVar

from pydantic import field_validator

from truearm.cell.channels import Channel, ConnectionEndedError, open_channel, tcp_place
from truearm.cell.device_errors import DeviceError, DeviceSilentError, gone, silent, stopped
from truearm.cell.schema import Frame, Positive, Section
from truearm.cell.shown import LONGEST_SHOWN
from truearm.errors import count_of

LONGEST_LINE: Final = 65536
ENDS: Final = (b"\r", b"\n")
TERMINATORS: Final = {"lf": b"\n", "cr": b"\r", "crlf": b"\r\n"}
PASSES_EVERY_S: Final = 0.05
T = TypeVar("T")


class PortSection(Section):
    """Keys of every driver whose device speaks in lines."""

    driver: str
    port: str
    baud: int = 9600
    frame: Frame = "8N1"
    timeout_s: Positive = 2.0

    @field_validator("port")
    @classmethod
    def _port(cls, value: str) -> str:
        tcp_place(value)
        return value


class LineSection(PortSection):
    """Keys of the drivers whose lines stand in the cell file."""

    end_of_line: Literal["lf", "cr", "crlf"] = "lf"

    @property
    def terminator(self) -> bytes:
        """What ends a line that is sent."""
        return TERMINATORS[self.end_of_line]


class LinePort:
    """A port of a device that speaks in lines of ASCII.

    Lines are sent with the `terminator`; those that come may end with CR, LF or both.

    Attributes:
        device: What people call the device.
        address: Where it is, as in the cell file.
        limit_s: Time limit of a call that names none.
    """

    def __init__(
        self,
        device: str,
        address: str,
        limit_s: float,
        *,
        terminator: bytes = b"\n",
        baud: int = 9600,
        frame: str = "8N1",
    ) -> None:
        self.device, self.address, self.limit_s = device, address, limit_s
        self._terminator, self._baud, self._frame = terminator, baud, frame
        self._channel: Channel | None = None
        self._rest = b""
        self._lines: deque[str] = deque()
        self._interrupted = threading.Event()
        self._writing = threading.Lock()
        self._starting = threading.Lock()

    @classmethod
    def of(cls, device: str, keys: PortSection, *, terminator: bytes = b"\n") -> Self:
        """The port of a device by the keys of its section; not yet open.

        Args:
            device: What people call the device.
            keys: The section.
            terminator: Of lines that are sent.
        """
        return cls(device, keys.port, keys.timeout_s, terminator=terminator, baud=keys.baud, frame=keys.frame)

    @property
    def is_open(self) -> bool:
        """Whether there is a connection."""
        return self._channel is not None

    def open(self) -> None:
        """Open the port.

        Raises:
            PortUnavailableError: If it cannot be opened.
            DeviceError: If it is open already.
        """
        if self._channel is not None:
            raise DeviceError("connected already", where=self.where, way_out="Close it first")
        self._channel = open_channel(
            self.device, self.address, self.limit_s, baud=self._baud, frame=self._frame
        )
        self._rest = b""
        self._lines.clear()

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Open the port for good; closed again only where the work within the block fails.

        Raises:
            PortUnavailableError: If it cannot be opened.
            DeviceError: If it is open already.
        """
        self.open()
        try:
            yield
        except BaseException:
            self.close()
            raise

    @property
    def where(self) -> str:
        """Device and port, for messages."""
        return f"{self.device} at {self.address}"

    def close(self) -> None:
        """Close the port if it is open."""
        channel, self._channel = self._channel, None
        if channel is not None:
            channel.close()

    @property
    def is_interrupted(self) -> bool:
        """Whether another thread is to end its waits."""
        return self._interrupted.is_set()

    def interrupt(self) -> None:
        """End the wait of another thread, which then raises StoppedError.

        No motion is begun from then on, and one that was being begun has been sent: what stops the device
        comes behind it.
        """
        self._interrupted.set()
        with self._starting:
            pass

    def resume(self) -> None:
        """Let waits be waits again."""
        self._interrupted.clear()

    def end_waits(self, busy: AbstractContextManager[object]) -> None:
        """End the wait of the thread that holds the lock `busy`; once it let go, waits are waits again."""
        self.interrupt()
        with busy:
            self.resume()

    def send(self, *texts: str) -> None:
        """Send lines, in one piece.

        Raises:
            DeviceGoneError: If the connection has ended, or there is none.
        """
        channel = self._open_channel()
        data = b"".join([text.encode("ascii", "replace") + self._terminator for text in texts])
        try:
            with self._writing:
                channel.write(data)
        except ConnectionEndedError as error:
            raise gone(self.device, self.address, str(error)) from None

    def begin(self, *texts: str) -> None:
        """Send lines that begin a motion, in one piece.

        Raises:
            DeviceGoneError: If the connection has ended, or there is none.
            StoppedError: If another thread interrupted; nothing is sent then.
        """
        with self._starting:
            if self.is_interrupted:
                raise stopped(self.device, self.address)
            self.send(*texts)

    def receive(self, limit_s: float | None = None, *, doing: str = "") -> str:
        """The next line without its end.

        Args:
            limit_s: Time limit; that of the port by default.
            doing: What the device was asked to do, for the message.

        Raises:
            DeviceSilentError: If none came in time.
            DeviceGoneError: If the connection has ended.
            StoppedError: If another thread interrupted.
        """
        limit = self.limit_s if limit_s is None else limit_s
        until = time.monotonic() + limit
        while not self._lines:
            if self.is_interrupted:
                raise stopped(self.device, self.address)
            self._take()
            if not self._lines and time.monotonic() >= until:
                raise silent(self.device, self.address, limit, doing=doing)
        return self._lines.popleft()

    def answer(
        self,
        meaning: Callable[[str], T | None],
        *,
        doing: str,
        key: str,
        way_out: str = "",
        limit_s: float | None = None,
    ) -> T:
        """What the first line that has a meaning means; devices say other things before it, as they like.

        Args:
            meaning: Gives what a line means, None for one that is something else.
            doing: What the device was asked to do, for the message.
            key: Of the cell file, which says what lines have a meaning.
            way_out: What else may be done about lines that have none, for the message.
            limit_s: Time limit; that of the port by default.

        Raises:
            DeviceSilentError: If no such line came within the limit.
            DeviceGoneError: If the connection has ended.
            StoppedError: If another thread interrupted.
        """
        limit = self.limit_s if limit_s is None else limit_s
        until, lines, last = time.monotonic() + limit, 0, ""
        while (left := until - time.monotonic()) > 0.0:
            try:
                last = self.receive(left, doing=doing)
            except DeviceSilentError:
                break
            lines += 1
            found = meaning(last)
            if found is not None:
                return found
        if not lines:
            raise silent(self.device, self.address, limit, doing=doing)
        raise DeviceSilentError(
            f"{count_of(lines, 'line')} came within {limit:g} s, none fits `{key}`, "
            f'the last was "{last[:LONGEST_SHOWN]}"',
            where=self.where,
            way_out=f"Correct `{key}` of the cell file{way_out}",
        )

    def pause(self, seconds: float) -> None:
        """Wait.

        Raises:
            StoppedError: If another thread interrupted.
        """
        if self._interrupted.wait(seconds):
            raise stopped(self.device, self.address)

    def pass_over(self, seconds: float) -> None:
        """Wait, and forget all that comes meanwhile, so that nothing is kept waiting at the other side.

        Raises:
            DeviceGoneError: If the connection has ended.
            StoppedError: If another thread interrupted.
        """
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self.drain()
            self.pause(min(PASSES_EVERY_S, max(0.0, until - time.monotonic())))
        self.drain()

    def ignore(self) -> None:
        """Wait a slice for what comes, and forget it unread; another thread may send meanwhile.

        Raises:
            DeviceGoneError: If the connection has ended.
        """
        self._read(wait=True)

    def drain(self) -> list[str]:
        """Forget what has come and was not asked for: these lines."""
        self._take_waiting()
        lines = list(self._lines)
        self._lines.clear()
        return lines

    def newest(self) -> str | None:
        """The newest of the lines that have come, None where none has."""
        self._take_waiting()
        line = self._lines.pop() if self._lines else None
        self._lines.clear()
        return line

    def _take_waiting(self) -> None:
        while self._take(wait=False):
            pass

    def _take(self, *, wait: bool = True) -> bool:
        """Split what comes within a slice, or has come, into lines; whether anything came."""
        data = self._read(wait=wait)
        if not data:
            return False
        # Devices end lines as they like, and not always as they want them ended: an empty line means nothing.
        lines = (self._rest + data).splitlines()
        self._rest = b"" if data.endswith(ENDS) else lines.pop()[-LONGEST_LINE:]
        self._lines.extend([line.decode("ascii", "replace") for line in lines if line])
        return True

    def _read(self, *, wait: bool) -> bytes:
        channel = self._open_channel()
        try:
            return channel.read(wait=wait)
        except ConnectionEndedError as error:
            raise gone(self.device, self.address, str(error)) from None

    def _open_channel(self) -> Channel:
        if self._channel is None:
            raise gone(self.device, self.address, "it is not open")
        return self._channel
