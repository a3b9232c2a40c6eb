"""Sessions are read from places that take no files: a read-only mount, an archive, another user's folder."""

import sqlite3
from contextlib import closing

import numpy as np
import pytest

from truearm.cell.session import Session, Step
from truearm.errors import InputError

STEPS = [Step(k, "pose", k, "", 0, np.zeros(6)) for k in range(3)]


@pytest.fixture
def closed(tmp_path):
    """A session that its writer has closed."""
    path = tmp_path / "session.db"
    with Session.create(path, STEPS, {}) as session:
        session.add_outcome(0, "skipped", reason="too far")
    return path


def journal_of(path):
    with closing(sqlite3.connect(path)) as database:
        return database.execute("PRAGMA journal_mode").fetchone()[0]


def without_room_beside(path):
    """Let no index of a log be made beside a file, for whoever runs this; permissions do not stop root."""
    path.with_name(f"{path.name}-shm").symlink_to(path.parent / "none" / "index")


def outcomes_of(path):
    with Session(path, writing=False) as session:
        return session.rows("SELECT step, reason FROM outcomes")


def test_a_session_that_is_closed_is_one_file_and_goes_on(closed):
    assert journal_of(closed) == "delete"
    without_room_beside(closed)
    assert outcomes_of(closed) == [(0, "too far")]
    closed.with_name(f"{closed.name}-shm").unlink()
    with Session(closed, writing=True) as session:
        assert session.rows("PRAGMA journal_mode") == [("wal",)]
        session.add_outcome(1, "skipped")
        with Session(closed, writing=False) as reader:
            assert reader.all_left()[0].step == 2
    assert journal_of(closed) == "delete"


def test_a_session_that_somebody_reads_is_closed_at_once(closed):
    writer = Session(closed, writing=True)
    with Session(closed, writing=False) as reader:
        assert reader.all_left()[0].step == 1
        writer.close()
        assert reader.all_left()[0].step == 1
    assert outcomes_of(closed) == [(0, "too far")]


@pytest.mark.parametrize("log", [None, b""])
def test_a_session_in_write_ahead_mode_is_read_where_nothing_can_be_made(closed, log):
    with closing(sqlite3.connect(closed)) as database:
        database.execute("PRAGMA journal_mode=WAL")
    if log is not None:
        closed.with_name(f"{closed.name}-wal").write_bytes(log)
    without_room_beside(closed)
    assert outcomes_of(closed) == [(0, "too far")]


def test_a_log_that_cannot_be_read_in_its_place_is_told_with_a_way_out(closed):
    with closing(sqlite3.connect(closed)) as database:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("DELETE FROM outcomes")
        database.commit()
        log = closed.with_name(f"{closed.name}-wal").read_bytes()
    closed.with_name(f"{closed.name}-wal").write_bytes(log)
    without_room_beside(closed)
    with pytest.raises(InputError, match=r"cannot be read: .* Copy it, with the files of its name and -wal"):
        outcomes_of(closed)
