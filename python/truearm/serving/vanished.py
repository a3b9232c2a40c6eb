"""Noticing that who was at the other end of a connection is gone, though nothing says so.

A controller whose power or cable fails closes nothing, and one that pauses says nothing either. Only the
system of the other end tells them apart: it answers probes as long as it is there.
"""

import socket
from typing import Final

PROBES: Final = 5
SHARE_BEFORE_PROBES: Final = 0.5
"""How much of the time passes in silence before the first probe."""
IDLE: Final = ("TCP_KEEPIDLE", "TCP_KEEPALIVE")
"""What systems call the time before the first probe."""


def probe(connection: socket.socket, within_s: float) -> None:
    """Have the system end a connection whose other end no longer answers.

    Probes and data that is sent count alike (RFC 1122, 4.2.3.6; RFC 5482 for data). Systems count in whole
    seconds, one at least. What a system does not know is left at its own times.

    Args:
        connection: A TCP connection.
        within_s: After how many seconds without an answer.
    """
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    silent_s = SHARE_BEFORE_PROBES * within_s
    idle = next((name for name in IDLE if hasattr(socket, name)), "")
    _set(connection, idle, silent_s)
    _set(connection, "TCP_KEEPINTVL", (within_s - silent_s) / PROBES)
    _set(connection, "TCP_KEEPCNT", PROBES)
    _set(connection, "TCP_USER_TIMEOUT", 1000.0 * within_s)


def _set(connection: socket.socket, name: str, value: float) -> None:
    option = getattr(socket, name, None)
    if option is not None:
        connection.setsockopt(socket.IPPROTO_TCP, option, max(1, round(value)))
