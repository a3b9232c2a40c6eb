"""Opening the file of a session, for reading from places that take no files as well."""

import sqlite3
from pathlib import Path

from truearm.cell.session_checks import NO_FILES, PRIMARY


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


def _holds_more(path: Path) -> bool:
    """Whether the log beside a file holds what is not in it."""
    log = path.resolve().with_name(f"{path.resolve().name}-wal")
    return log.exists() and log.stat().st_size > 0
