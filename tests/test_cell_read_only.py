"""Sessions are read from places that take no files, as a read-only mount, and without the log beside them."""

import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing

import numpy as np
import pytest

from truearm.cell.session import Session, Step
from truearm.cli import main
from truearm.errors import InputError

STEPS = [Step(k, "pose", k, "", 0, np.zeros(6)) for k in range(3)]


@pytest.fixture
def closed(tmp_path):
    """A session that its writer has closed."""
    path = tmp_path / "session.db"
    with Session.create(path, STEPS, {"arm": {"name": "arm"}, "cell": "cell"}) as session:
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


KILLED = """
import os, sys
from pathlib import Path
from truearm.cell.session import Session
session = Session(Path(sys.argv[1]), writing=True)
session.add_outcome(1, "skipped", reason="late")
with session.together():
    session.add_outcome(2, "skipped", reason="last")
os._exit(1)
"""
ALL = [(0, "too far"), (1, "late"), (2, "last")]


@pytest.fixture
def killed(closed):
    """A session whose writer was killed: its log lies beside it."""
    subprocess.run([sys.executable, "-c", KILLED, closed], check=False)
    assert log_of(closed).stat().st_size > 0
    return closed


def log_of(path):
    return path.with_name(f"{path.name}-wal")


def test_a_session_that_was_killed_is_whole_without_its_log_and_says_that_it_may_not_be(
    killed, tmp_path, capsys
):
    assert main(["session", "show", str(killed)]) == 0
    assert "Warning" not in capsys.readouterr().err
    copied = shutil.copy(killed, tmp_path / "copied.db")
    assert outcomes_of(copied) == ALL
    assert main(["session", "show", str(copied)]) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "copied.db was not closed by what measured into it" in said
    assert "copied.db-wal is not beside it: what was stored last may be missing" in said


def test_a_session_that_somebody_reads_as_it_is_closed_is_whole_without_its_log(closed, tmp_path):
    writer = Session(closed, writing=True)
    with Session(closed, writing=False) as reader:
        assert reader.all_left()[0].step == 1
        writer.add_outcome(1, "skipped", reason="late")
        writer.close()
    assert outcomes_of(closed.rename(tmp_path / "moved.db")) == ALL[:2]


def test_what_somebody_reads_for_long_holds_up_nobody_and_is_in_the_log(closed, tmp_path):
    with closing(sqlite3.connect(closed)) as reader, Session(closed, writing=True) as writer:
        reader.execute("BEGIN")
        reader.execute("SELECT * FROM outcomes").fetchall()
        writer.add_outcome(1, "skipped", reason="late")
        copied = shutil.copy(closed, tmp_path / "copied.db")
        with Session(copied, writing=False) as lacking:
            assert [each.kind for each in lacking.notices] == ["no_log"]
    assert outcomes_of(closed) == ALL[:2]


def test_a_new_session_takes_nothing_from_one_that_was_deleted(killed):
    killed.unlink()
    with pytest.raises(InputError, match=r"session\.db-wal lies there, of a session that does not"):
        Session.create(killed, STEPS, {})
    assert sorted(path.name for path in killed.parent.iterdir()) == [
        "session.db-shm", "session.db-wal", "session.db.lock"
    ]  # fmt: skip
    log_of(killed).unlink()
    with Session.create(killed, STEPS, {}) as session:
        assert session.notices == []
        assert len(session.all_left()) == len(STEPS)
