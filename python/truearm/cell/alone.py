"""One process at a time drives an arm, whatever session it writes: locks by the addresses of devices."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final
from urllib.parse import quote

from filelock import FileLock, Timeout

from truearm.cell.cell_file import Cell
from truearm.cell.playback import PlaybackRobot
from truearm.cell.protocols import Device
from truearm.cell.table_panel import TablePanel
from truearm.errors import WorkError

LONGEST_NAME: Final = 200
ME: Final = str(os.getuid()) if hasattr(os, "getuid") else ""


@contextmanager
def alone(cell: Cell) -> Iterator[None]:
    """While no other process of this user on this machine drives the arm of a cell, or its table.

    Controllers take several connections at a time, and do what each of them says. Instruments that only look
    may serve several. A process that dies lets go.

    Raises:
        WorkError: If another process does, or the lock cannot be had.
    """
    with ExitStack() as held:
        if not isinstance(cell.robot, PlaybackRobot):
            held.callback(_locked(cell.robot, "arm").release)
        if isinstance(cell.sensor, TablePanel):
            held.callback(_locked(cell.sensor, "table").release)
        yield


def _locked(device: Device, noun: str) -> FileLock:
    """The lock of a device, held by this process."""
    where = f"{device.name} at {device.address}"
    try:
        lock = FileLock(_folder() / f"{quote(device.address, safe='')[-LONGEST_NAME:]}.lock")
        lock.acquire(timeout=0.0)
    except Timeout:
        raise WorkError(
            f"another process drives this {noun}", where=where, way_out="Wait for it, or end it"
        ) from None
    except OSError as error:
        raise WorkError(
            f"whether another process drives this {noun} is not known: {error}", where=where
        ) from None
    return lock


def _folder() -> Path:
    """Where the locks of this user are."""
    folder = Path(tempfile.gettempdir()) / f"truearm-{ME}"
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder
