"""The server: connections that cannot hurt each other, each with a stream of its own."""

import asyncio
import hmac
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from typing import Final

from truearm.errors import InputError, UsageError
from truearm.robot import Robot
from truearm.serving.protocol import (
    PROTOCOL,
    MalformedError,
    Units,
    answer,
    line_of,
    read_object,
    read_request,
)
from truearm.serving.vanished import probe
from truearm.streaming import CorrectionStream

DISCARDED_BYTES: Final = 65_536
GIVES_WAY: Final = "newer connections came before the token"


@dataclass(frozen=True)
class Bounds:
    """What one connection may do.

    Attributes:
        line_bytes: Longest line.
        requests_per_s: Requests in a second; seconds begin with the first request after the one before.
        connections: Connections at once that are served.
        waiting: Others at once, whose token has not come or that are turned away; the oldest gives way.
        token_s: Time to send the token.
        reading_s: Time to take an answer off the line.
        vanished_s: Time for which the system of a client may answer nothing, not even a probe.
    """

    line_bytes: int = 16_384
    requests_per_s: int = 5000
    connections: int = 16
    waiting: int = 16
    token_s: float = 5.0
    reading_s: float = 1.0
    vanished_s: float = 30.0


class Flood:
    """Counts requests of the running second."""

    def __init__(self, most: int) -> None:
        """Allow so many a second."""
        self._most, self._began, self._count = most, 0.0, 0

    def check(self, now: float) -> None:
        """Count a request at the time `now`, s.

        Raises:
            MalformedError: If there are too many.
        """
        if now - self._began >= 1.0:
            self._began, self._count = now, 0
        self._count += 1
        if self._count > self._most:
            raise MalformedError(f"more than {self._most} requests a second")


class Server:
    """Answers set-points on a TCP port."""

    def __init__(
        self,
        robot: Robot,
        make_stream: Callable[[], CorrectionStream],
        *,
        token: str | None = None,
        bounds: Bounds | None = None,
        told: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Prepare a server.

        Args:
            robot: Whose set-points come.
            make_stream: Makes the stream of a connection.
            token: What a client has to send first; None for nothing.
            bounds: What a connection may do.
            told: Told in words when a connection ends early.
        """
        self._robot, self._make_stream, self._token = robot, make_stream, token
        self._units = Units(robot.joints)
        self._bounds = bounds or Bounds()
        self._told = told
        self._served_now = 0
        self._waiting: dict[asyncio.StreamWriter, None] = {}

    async def start(self, host: str, port: int) -> asyncio.Server:
        """Listen; port 0 takes a free one.

        Raises:
            InputError: If the address or the port cannot be had.
        """
        try:
            return await asyncio.start_server(self._connected, host, port, limit=self._bounds.line_bytes)
        except (OSError, OverflowError) as error:
            where = f"{host}:{port}"
            raise InputError(f"cannot listen there: {error}", where=where, way_out="Name another") from None

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._make_room()
        self._waiting[writer] = None
        try:
            await self._answered(reader, writer)
        except asyncio.CancelledError:
            # The server ends. Python 3.11 prints a traceback for a connection that says it was cancelled.
            self._told(f"{_peer(writer)}: the server ends; connection closed")
        finally:
            self._waiting.pop(writer, None)
            writer.close()

    def _make_room(self) -> None:
        """Have the oldest connection without a token, or turned away, give way to another one."""
        if len(self._waiting) < self._bounds.waiting:
            return
        oldest = next(iter(self._waiting))
        del self._waiting[oldest]
        self._told(f"{_peer(oldest)}: {GIVES_WAY}; connection closed")
        oldest.write(line_of({"error": GIVES_WAY}))
        oldest.transport.abort()

    async def _answered(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve a connection until it ends, or breaks the rules and is told so."""
        try:
            probe(writer.get_extra_info("socket"), self._bounds.vanished_s)
            await self._served(reader, writer)
        except (MalformedError, UsageError) as error:
            reason = str(error) if isinstance(error, UsageError) else error.what
            self._told(f"{_peer(writer)}: {reason}; connection closed")
            await self._say_goodbye(reader, writer, reason)
        except (OSError, EOFError):
            self._told(f"{_peer(writer)}: left")

    async def _served(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._token is not None:
            await self._check_token(reader, self._token)
        if self._served_now >= self._bounds.connections:
            raise MalformedError(f"more than {self._bounds.connections} connections")
        self._waiting.pop(writer, None)
        self._served_now += 1
        try:
            await self._corrected(reader, writer)
        finally:
            self._served_now -= 1

    async def _corrected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer requests until the connection ends, or one is malformed."""
        stream, flood, before = self._make_stream(), Flood(self._bounds.requests_per_s), None
        await self._send(writer, line_of(self._greeting(list(stream.features))))
        while True:
            line = await self._line(reader)
            now = time.monotonic()
            flood.check(now)
            request = read_request(line, self._units)
            if request.switch is not None:
                stream.switch(request.switch)
            stream.set_features(request.features)
            if request.is_set_point:
                stream.step(request.q, 0.0 if before is None else now - before)
                before = now
            await self._send(writer, answer(request, stream.last, self._units))
            # A client with many lines in its buffer must not keep the others waiting.
            await asyncio.sleep(0)

    def _greeting(self, features: list[str]) -> dict[str, object]:
        return {
            "truearm": version("truearm"),
            "protocol": PROTOCOL,
            "robot": self._robot.name,
            "joints": list(self._robot.joints),
            "features": features,
        }

    async def _check_token(self, reader: asyncio.StreamReader, token: str) -> None:
        try:
            line = await asyncio.wait_for(self._line(reader), self._bounds.token_s)
        except TimeoutError:
            raise MalformedError("no token came") from None
        given = read_object(line).get("token")
        if not isinstance(given, str) or not hmac.compare_digest(_bytes(given), _bytes(token)):
            raise MalformedError("the token is wrong")

    async def _line(self, reader: asyncio.StreamReader) -> bytes:
        try:
            return await reader.readuntil(b"\n")
        except asyncio.LimitOverrunError:
            raise MalformedError(f"a line is longer than {self._bounds.line_bytes} bytes") from None

    async def _send(self, writer: asyncio.StreamWriter, line: bytes) -> None:
        writer.write(line)
        if not writer.transport.get_write_buffer_size():
            return
        try:
            await asyncio.wait_for(writer.drain(), self._bounds.reading_s)
        except TimeoutError:
            raise MalformedError("the answers are not read") from None

    async def _say_goodbye(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, why: str
    ) -> None:
        """Say why, and take what is still coming: closing on unread bytes would tear the words away."""
        try:
            writer.write(line_of({"error": why}))
            await asyncio.wait_for(writer.drain(), self._bounds.reading_s)
            writer.write_eof()
            await asyncio.wait_for(_discard(reader), self._bounds.reading_s)
        except (OSError, TimeoutError):
            writer.transport.abort()


def _bytes(token: str) -> bytes:
    """A token as bytes; JSON can hold halves of characters that UTF-8 cannot."""
    return token.encode("utf-8", "surrogatepass")


async def _discard(reader: asyncio.StreamReader) -> None:
    while await reader.read(DISCARDED_BYTES):
        await asyncio.sleep(0)


def _peer(writer: asyncio.StreamWriter) -> str:
    host, port, *_ = writer.get_extra_info("peername") or ("?", "?")
    return f"{host}:{port}"
