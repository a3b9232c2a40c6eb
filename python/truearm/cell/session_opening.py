"""Opening the file of a session, for reading from places that take no files as well; the logs beside it."""

import sqlite3
from pathlib import Path
from typing import Final

from truearm.cell.session_checks import NO_FILES, PRIMARY
from truearm.errors import InputError, Notice

MAGIC: Final = b"SQLite format 3\x00"
MODES: Final = slice(18, 20)
"""Bytes of the head that tell by which kind of log the file is written and read."""
WRITE_AHEAD: Final = b"\x02\x02"
HEAD_BYTES: Final = 20
LOG: Final = "-wal"
LOGS: Final = (LOG, "-journal")
TO_WRITE: Final = (
    "PRAGMA journal_mode=WAL",
    "PRAGMA synchronous=FULL",
    # Each commit is brought into the file at once, so that a file that is copied or moved without its log
    # holds it, unless somebody reads just then.
    "PRAGMA wal_autocheckpoint=1",
    # A commit, after which the log is not empty: by that one that was lost can be told.
    "PRAGMA user_version=0",
)
"""What a connection that writes begins with."""


def connected(path: Path, options: str) -> sqlite3.Connection:
    """A connection to a file with options of SQLite's URI; every statement is committed by itself."""
    return sqlite3.connect(
        f"{path.resolve().as_uri()}?{options}", uri=True, isolation_level=None, check_same_thread=False
    )


def opened_to_read(path: Path) -> sqlite3.Connection:
    """A connection that only reads.

    A file in write-ahead mode needs others beside it. Where there are none, and none can be made, all that
    was written is in the file itself, and it is read as one that nobody changes.
    """
    database = connected(path, "mode=ro")
    try:
        database.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchall()
    except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
        if getattr(error, "sqlite_errorcode", 0) & PRIMARY in NO_FILES and not _holds_more(path):
            database.close()
            return connected(path, "mode=ro&immutable=1")
    return database


def told_lost_log(path: Path, head: bytes) -> list[Notice]:
    """What is to be known of a file, of which these are the first bytes, whose log is not beside it.

    A file that was closed is in no need of one. To be asked before a connection makes an empty log.
    """
    if head[MODES] != WRITE_AHEAD or _holds_more(path):
        return []
    log = _beside(path, LOG)
    return [
        Notice(
            "no_log",
            f"{path} was not closed by what measured into it, as after a kill or a loss of power, and "
            f"{log.name} is not beside it: what was stored last may be missing, unless another program has "
            "taken it into the file. Copy both from where it was measured.",
        )
    ]


def check_no_logs(path: Path) -> None:
    """See that no log lies where a file of a session is to be made: SQLite would put it into that file.

    Raises:
        InputError: If one does.
    """
    for log in (_beside(path, ending) for ending in LOGS):
        if _is_filled(log):
            raise InputError(
                f"{log.name} lies there, of a session that does not",
                where=str(path),
                rule="It would become part of a new session of that name",
                way_out=f"Put the session back beside it, delete {log.name}, or name another file",
            )


def _holds_more(path: Path) -> bool:
    """Whether the log beside a file may hold what is not in it."""
    return _is_filled(_beside(path, LOG))


def _beside(path: Path, ending: str) -> Path:
    """The log of a file; links are followed, as SQLite does."""
    file = path.resolve()
    return file.with_name(f"{file.name}{ending}")


def _is_filled(log: Path) -> bool:
    return log.exists() and log.stat().st_size > 0
