"""One process at a time drives an arm, whatever session it writes: locks by where the devices are."""

import os
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from truearm.cell.cell_file import Cell
from truearm.cell.channels import tcp_address, tcp_place
from truearm.cell.playback import PlaybackRobot
from truearm.cell.protocols import Device
from truearm.cell.table_panel import TablePanel
from truearm.locks import held


@contextmanager
def alone(cell: Cell) -> Iterator[None]:
    """While no other process of this user on this machine drives the arm of a cell, or its table.

    Controllers take several connections at a time, and do what each of them says. Instruments that only look
    may serve several. A process that dies lets go. A controller with several IP addresses counts as several.

    Raises:
        WorkError: If another process does, or the lock cannot be had.
    """
    devices: list[tuple[Device, str]] = []
    if not isinstance(cell.robot, PlaybackRobot):
        devices.append((cell.robot, "arm"))
    if isinstance(cell.sensor, TablePanel):
        devices.append((cell.sensor, "table"))
    with ExitStack() as locks:
        for device, noun in devices:
            for place in _places(device.address):
                where = f"{device.name} at {device.address}"
                locks.callback(held(place, f"drives this {noun}", where=where).release)
        yield


def _places(address: str) -> list[str]:
    """What an address leads to, whatever it is called: a TCP port at its IP addresses, or a serial port.

    An address of another kind, which a driver of one's own may have, stays as it is, and so does a host that
    nobody knows, to which nobody connects either.
    """
    try:
        place = tcp_place(address)
        found = [] if place is None else socket.getaddrinfo(*place, type=socket.SOCK_STREAM)
    except (OSError, ValueError):
        return [address.casefold()]
    if place is None:
        return [os.path.normcase(os.path.realpath(address) if os.path.exists(address) else address)]  # noqa: PTH110
    port = place[1]
    return sorted({tcp_address(str(entry[4][0]), port) for entry in found})
