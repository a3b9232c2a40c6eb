"""Connections to devices: what comes and goes through them, and what ends them."""

import os
import socket
import time
from typing import Any

import pytest
import serial

from truearm.cell.channels import (
    Channel,
    ConnectionEndedError,
    _Buffered,
    _Connection,
    _Terminal,
    open_tcp,
)

ENDED = "it is gone"


def test_pyserial_waits_where_descriptors_cannot_be_waited_for():
    own, other = os.openpty()
    channel = Channel(_Buffered(serial.Serial(os.ttyname(other)), 0.2), 0.2, ended="the port is gone")
    assert channel.read(wait=False) == channel.read() == b""
    os.write(own, b"here\r")
    answer = b""
    until = time.monotonic() + 10.0
    while len(answer) < 5 and time.monotonic() < until:
        answer += channel.read()
    assert answer == b"here\r"
    channel.write(b"there\r")
    assert os.read(own, 100) == b"there\r"
    channel.close()
    for broken in (channel.read, lambda: channel.write(b"x")):
        with pytest.raises(ConnectionEndedError):
            broken()
    os.close(own)
    os.close(other)


class _Closing:
    """A serial port that is closed while it is read: pyserial finds None where its handles were."""

    timeout = write_timeout = 0.0
    handle: Any = None

    def read(self, count):
        return self.handle.hEvent * count

    def write(self, data):
        return self.handle + len(data)


def test_a_port_that_is_closed_in_mid_call_has_ended():
    channel = Channel(_Buffered(_Closing(), 0.2), 0.2, ended=ENDED)  # type: ignore[arg-type]
    for broken in (channel.read, lambda: channel.write(b"x")):
        with pytest.raises(ConnectionEndedError, match="it was closed"):
            broken()


class _Busy(socket.socket):
    """A socket that can be written to, and yet takes nothing the first times."""

    refusals = 3

    def send(self, data, flags=0):
        if self.refusals:
            self.refusals -= 1
            raise BlockingIOError
        return super().send(data, flags)


def test_what_is_not_taken_at_once_is_sent_again():
    server = socket.create_server(("127.0.0.1", 0))
    busy = _Busy()
    busy.connect(server.getsockname())
    taken, _ = server.accept()
    channel = Channel(_Connection(busy), 5.0, ended=ENDED)
    channel.write(b"all of it")
    assert taken.recv(100) == b"all of it"
    channel.close()
    taken.close()
    server.close()


def test_what_nobody_takes_ends_within_the_limit():
    own, other = os.openpty()
    channel = Channel(_Terminal(serial.Serial(os.ttyname(other))), 0.1, ended=ENDED)
    with pytest.raises(ConnectionEndedError, match=r"could not be sent within 0\.1 s"):
        channel.write(bytes(1_000_000))
    channel.close()
    os.close(own)
    os.close(other)


def test_a_connection_that_is_closed_with_something_unread_is_not_reset():
    with socket.create_server(("127.0.0.1", 0)) as server:
        channel = open_tcp("device", "127.0.0.1", server.getsockname()[1], 1.0)
        device, _ = server.accept()
        with device:
            device.sendall(b"state" * 1000)
            time.sleep(0.05)
            channel.write(b"stopj(4)\n")
            channel.close()
            time.sleep(0.05)
            assert device.recv(100) == b"stopj(4)\n"
            assert device.recv(100) == b""
