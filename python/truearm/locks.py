"""Locks that one process of this user on this machine holds at a time, whatever each calls what is locked."""

import os
import stat
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Final
from urllib.parse import quote_from_bytes

from filelock import FileLock, Timeout

from truearm.errors import WorkError

LONGEST_NAME: Final = 200
ME: Final = str(os.getuid()) if hasattr(os, "getuid") else ""
FIXED: Final = Path("/tmp")  # noqa: S108 - the folder in it is this user's alone
"""Where the locks are whatever the environment says of temporary files, which may differ among processes."""


def held(name: str, doing: str, *, where: str, wait_s: float = 0.0) -> FileLock:
    """The lock of a name, held by this process until it is released; a process that dies lets go.

    Args:
        name: What is locked, under the one name that all processes have for it.
        doing: What the process that holds it does, as in "drives this arm".
        where: What is locked as the user calls it, for messages.
        wait_s: For how long another process is waited for.

    Raises:
        WorkError: If another process holds it, or whether one does cannot be told.
    """
    try:
        lock = FileLock(_folder() / f"{quote_from_bytes(os.fsencode(name), safe='')[-LONGEST_NAME:]}.lock")
        lock.acquire(timeout=wait_s)
    except Timeout:
        raise WorkError(f"another process {doing}", where=where, way_out="Wait for it, or end it") from None
    except OSError as error:
        raise WorkError(f"whether another process {doing} is not known: {error}", where=where) from None
    return lock


def _folder() -> Path:
    """Where the locks of this user are: the same for all processes, whatever they call temporary.

    Raises:
        OSError: If there is no such folder, and none can be made.
    """
    if os.name != "posix":
        folder = Path(tempfile.gettempdir()) / "truearm"
        folder.mkdir(exist_ok=True)
        return folder
    places = (FIXED / f"truearm-{ME}", Path("/run/user", ME, "truearm"))
    for folder in places:
        with suppress(OSError):
            folder.mkdir(mode=0o700, exist_ok=True)
            if _is_mine(folder):
                return folder
    raise PermissionError(f"no folder for locks: make {places[0]} one that is yours alone (chmod 700)")


def _is_mine(folder: Path) -> bool:
    """Whether nobody else can write into a folder."""
    state = folder.lstat()
    return stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not state.st_mode & 0o022
