"""The other end of a port: a pseudo-terminal, or a TCP port of this machine."""

import os
import socket
from contextlib import suppress
from typing import Final, Protocol

with suppress(ImportError):  # Windows
    import tty

CHUNK: Final = 65536


class Wire(Protocol):
    """What a virtual device is connected to."""

    @property
    def address(self) -> str:
        """What a cell file calls it."""

    def waits_for(self) -> list[int]:
        """File descriptors to wait for."""

    def read(self) -> bytes:
        """What has come; empty where nothing has."""

    def write(self, data: bytes) -> None:
        """Send, if anybody is there."""

    def go_away(self) -> None:
        """End the connection and take no other one, as a device does that loses its power."""

    def come_back(self) -> None:
        """Take connections again."""

    def close(self) -> None:
        """Be no more."""


class PtyWire:
    """A pseudo-terminal; the client opens its other end like a serial port. Windows has none."""

    def __init__(self) -> None:
        # The other end is kept open here too, so that a client may come and go.
        self._own, self._other = os.openpty()
        tty.setraw(self._other)
        os.set_blocking(self._own, False)
        self.address = os.ttyname(self._other)

    def waits_for(self) -> list[int]:
        """See Wire."""
        return [self._own]

    def read(self) -> bytes:
        """See Wire."""
        try:
            return os.read(self._own, CHUNK)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> None:
        """See Wire. What does not fit while nobody reads is lost, as on a serial line."""
        try:
            os.write(self._own, data)
        except BlockingIOError:
            return

    def go_away(self) -> None:
        """See Wire. A serial line has no connection to end."""

    def come_back(self) -> None:
        """See Wire."""

    def close(self) -> None:
        """See Wire."""
        os.close(self._own)
        os.close(self._other)


class TcpWire:
    """A port at which one client at a time is served; a new one takes the place of the old."""

    def __init__(self, host: str = "127.0.0.1") -> None:
        self._host = host
        self._client: socket.socket | None = None
        self._server: socket.socket | None = self._listening(0)
        self.port = int(self._server.getsockname()[1])
        self.address = f"tcp://{host}:{self.port}"

    def waits_for(self) -> list[int]:
        """See Wire."""
        return [each.fileno() for each in (self._server, self._client) if each is not None]

    def read(self) -> bytes:
        """See Wire."""
        self._accept()
        if self._client is None:
            return b""
        try:
            data = self._client.recv(CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._drop()
        return data

    def write(self, data: bytes) -> None:
        """See Wire. Data that a client does not take is lost with it."""
        if self._client is None:
            return
        try:
            self._client.sendall(data)
        except OSError:
            self._drop()

    def go_away(self) -> None:
        """See Wire. Connecting is refused meanwhile."""
        self._drop()
        server, self._server = self._server, None
        if server is not None:
            server.close()

    def come_back(self) -> None:
        """See Wire."""
        self._server = self._listening(self.port)

    def close(self) -> None:
        """See Wire."""
        self.go_away()

    def _listening(self, port: int) -> socket.socket:
        server = socket.create_server((self._host, port))
        server.setblocking(False)
        return server

    def _drop(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()

    def _accept(self) -> None:
        if self._server is None:
            return
        try:
            client, _ = self._server.accept()
        except BlockingIOError:
            return
        self._drop()
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = client
