"""The session file: everything a measurement process has found out, on disk before the next motion starts.

SQLite in write-ahead mode with full synchronisation: what was committed outlives process and power, and
whoever reads for long does not hold up the writer. Each commit is brought from the log into the file at once.
When the writer closes it, it is one file that can be read from where nothing can be written.
"""

import json
import secrets
import sqlite3
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Final, NamedTuple, Self

import numpy as np
from filelock import FileLock, Timeout

from truearm.cell.reading import Reading
from truearm.cell.session_checks import PUT_BACK, check_values, unreadable, value_of
from truearm.cell.session_opening import (
    HEAD_BYTES,
    MAGIC,
    TO_WRITE,
    check_no_logs,
    connected,
    opened_to_read,
    told_lost_log,
)
from truearm.cell.session_schema import SCHEMA, VERSION
from truearm.errors import InputError, WorkError
from truearm.rotations import quaternion_from_matrix
from truearm.types import Floats

Point = tuple[float, ...]

ADD_READING: Final = "INSERT INTO readings VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)"
STEPS_LEFT: Final = (
    "SELECT * FROM steps WHERE step > coalesce((SELECT max(step) FROM outcomes), -1) ORDER BY step LIMIT ?"
)
STEPS_AT_ONCE: Final = 100
FIRST_MEASURED: Final = (
    "SELECT pose, purpose, approach, readings FROM steps JOIN outcomes USING (step) "
    "WHERE outcome = 'measured' ORDER BY step LIMIT 1"
)
# A contact for the frame at which no check of an unbroken row of them has been tried.
OTHER_CONTACT: Final = (
    "SELECT pose, purpose, approach, readings FROM steps JOIN outcomes USING (step) "
    "WHERE kind = 'registration' AND outcome = 'measured' AND pose NOT IN (SELECT pose FROM steps "
    "WHERE step <= :step AND step > (SELECT max(step) FROM steps WHERE kind != 'check' AND step < :step)) "
    "ORDER BY step LIMIT 1"
)
ADD_STEP: Final = "INSERT INTO steps VALUES (?, ?, ?, ?, ?, ?)"
# One step on, by way of negative numbers: no two may have the same one at any time.
MOVE_AWAY: Final = (
    "UPDATE steps SET step = -1 - step WHERE step >= ?",
    "UPDATE readings SET step = -1 - step WHERE step >= ?",
    "UPDATE events SET step = -1 - step WHERE step >= ?",
)
MOVE_BACK: Final = (
    "UPDATE steps SET step = -step WHERE step < 0",
    "UPDATE readings SET step = -step WHERE step < 0",
    "UPDATE events SET step = -step WHERE step < 0",
)
NO_FEATURES: Final = "{}"


@dataclass(frozen=True, eq=False)
class Step:
    """One thing to do: a pose to measure, for the frame ("registration"), for itself, or as a "check"."""

    step: int
    kind: str
    pose: int
    purpose: str
    approach: int
    readings: Floats


class Stored(NamedTuple):
    """A reading of a step as it is in the file: the attempt, from 1, and its point, m, if there is one."""

    attempt: int
    valid: bool
    point: Point | None
    sigma_m: float


class Session:
    """A session file, open for writing by one process at a time, or for reading by any.

    Attributes:
        path: The file.
        notices: What is to be known of the file.
    """

    def __init__(self, path: Path, *, writing: bool, lock: FileLock | None = None) -> None:
        """Open a file that exists.

        Args:
            path: The file.
            writing: Whether it is written to.
            lock: Its lock, where this process holds it already; given back when the session is closed.

        Raises:
            InputError: If there is none, it is no session of this layout, it is damaged, or values in it were
                changed to what they cannot be.
            WorkError: If another process is writing to it.
        """
        if not path.is_file():
            what = "this is a directory" if path.is_dir() else "there is no such file"
            raise InputError(what, where=str(path))
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
            if not head.startswith(MAGIC):
                raise InputError(
                    "this is no session file", where=str(path), rule="truearm measure makes them"
                )
        self.path, self.notices = path, told_lost_log(path, head)
        self._keeps = writing
        self._lock = (lock or _locked(path)) if writing else None
        self._db = connected(path, "mode=rwc") if writing else opened_to_read(path)
        try:
            self._check_version()
            check_values(self.rows, path)
            if writing:
                for setting in TO_WRITE:
                    self._write(setting)
        except BaseException:
            self._keeps = False
            self.close()
            raise

    @classmethod
    def create(cls, path: Path, steps: Sequence[Step], meta: dict[str, Any]) -> "Session":
        """Make a new file; it is complete, or not there.

        Raises:
            InputError: If it cannot be written, or the log of another session lies there.
            WorkError: If another process has made it, or is about to.
        """
        if not path.parent.is_dir():
            raise InputError("there is no such directory", where=str(path.parent))
        file = path.resolve()
        neighbour = file.with_name(f".{file.name}.{secrets.token_hex(8)}")
        lock = None
        try:
            _write_new(neighbour, steps, {"version": VERSION, "created_s": time.time(), **meta})
            lock = _locked(path)
            if path.exists():
                raise WorkError(
                    "another process has made this session meanwhile",
                    where=str(path),
                    way_out="Give the same command again to go on with it",
                )
            check_no_logs(file)
            neighbour.replace(file)
            return cls(path, writing=True, lock=lock)
        except BaseException as error:
            neighbour.unlink(missing_ok=True)
            if lock is not None:
                lock.release()
            if isinstance(error, sqlite3.OperationalError | OSError):
                raise InputError(f"cannot be written: {error}", where=str(path)) from None
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file and let others write to it.

        The log is taken away, unless somebody reads now: a file without one is read where SQLite can make no
        other beside it.
        """
        if self._keeps:
            with suppress(sqlite3.Error):
                self._db.execute("PRAGMA busy_timeout=0")
                self._db.execute("PRAGMA journal_mode=DELETE")
        self._keeps = False
        if hasattr(self, "_db"):
            self._db.close()
        if self._lock is not None:
            self._lock.release()

    def meta(self, key: str) -> Any:  # noqa: ANN401 - a JSON value
        """A value of the head of the file; None where there is none, or it is no JSON."""
        found = self.rows("SELECT value FROM meta WHERE key = ?", (key,))
        return value_of(found[0][0]) if found else None

    def has_meta(self, key: str) -> bool:
        """Whether the head of the file holds a value; sessions of before hold fewer."""
        return bool(self.rows("SELECT 1 FROM meta WHERE key = ?", (key,)))

    def set_meta(self, key: str, value: Any) -> None:  # noqa: ANN401 - a JSON value
        """Keep a value of the head of the file, in the place of the one that may be there."""
        self._write("INSERT OR REPLACE INTO meta VALUES (?, ?)", (key, json.dumps(value)))

    @property
    def arm(self) -> dict[str, Any]:
        """The arm that is measured, as Robot.to_dict gives it.

        Raises:
            InputError: If the head of the file has lost it.
        """
        found = self.meta("arm")
        if found is None:
            raise InputError("meta holds no arm", where=str(self.path), way_out=PUT_BACK)
        return dict(found)

    def next_step(self) -> Step | None:
        """The first step that has no outcome."""
        return next(iter(_steps(self.rows(STEPS_LEFT, (1,)))), None)

    def steps_left(self) -> Iterator[Step]:
        """The steps that have no outcome, each of which has to get one before the next is asked for."""
        while rows := self.rows(STEPS_LEFT, (STEPS_AT_ONCE,)):
            yield from _steps(rows)

    def all_left(self) -> list[Step]:
        """All steps that have no outcome."""
        return _steps(self.rows(STEPS_LEFT, (-1,)))

    def steps(self, kind: str) -> list[Step]:
        """All steps of a kind."""
        return _steps(self.rows("SELECT * FROM steps WHERE kind = ? ORDER BY step", (kind,)))

    def readings_of(self, step: int) -> list[Stored]:
        """All readings of a step, in the order of their attempts."""
        rows = self.rows(
            "SELECT attempt, valid, x_m, y_m, z_m, sigma_m FROM readings WHERE step = ? ORDER BY attempt",
            (step,),
        )
        return [Stored(row[0], bool(row[1]), _point(row[2:5]), row[5]) for row in rows]

    def add_reading(
        self, step: int, attempt: int, reading: Reading, joints: Floats, expected: Floats
    ) -> None:
        """Keep a reading for good: when this returns it is on disk."""
        point = [None] * 3 if reading.point_in_world is None else reading.point_in_world.tolist()
        turn: list[float | None] = [None] * 4
        if reading.pose_in_world is not None:
            turn = quaternion_from_matrix(reading.pose_in_world[:3, :3]).tolist()
        head = (step, attempt, reading.time_s, _listed(joints))
        quality = (reading.sigma_m, int(reading.valid), reading.reason)
        tail = (
            reading.temperature_c,
            json.dumps(reading.features) if reading.features else NO_FEATURES,
            reading.raw,
        )
        self._write(ADD_READING, (*head, *point, *turn, *quality, *expected.tolist(), *tail))

    def add_outcome(self, step: int, outcome: str, *, reason: str = "", attempts: Sequence[int] = ()) -> None:
        """Keep what became of a step, and which of its readings are the accepted ones."""
        row = (step, outcome, reason, str(list(attempts)), time.time())
        self._write("INSERT INTO outcomes VALUES (?, ?, ?, ?, ?)", row)

    def add_event(self, kind: str, message: str, step: int | None = None) -> None:
        """Keep a remark about the process.

        One that comes after the file is closed is dropped, or after something could not be written, which
        has been raised.
        """
        if not self._keeps:
            return
        self._write(
            "INSERT INTO events (time_s, step, kind, message) VALUES (?, ?, ?, ?)",
            (time.time(), step, kind, message),
        )

    def take_back(self, steps: Sequence[int], kind: str, message: str) -> None:
        """Take outcomes and readings from the first of `steps` on out of the file; an event at each says why.

        The session goes on at the first.
        """
        with self.together():
            for table in ("outcomes", "readings"):
                self._write(f"DELETE FROM {table} WHERE step >= ?", (steps[0],))  # noqa: S608 - one of two names
            for step in steps:
                self.add_event(kind, message, step)

    def registration(self) -> tuple[Floats, float] | None:
        """world_from_base (4, 4) and its residual in mm; None before it is found."""
        found = self.rows("SELECT world_from_base, residual_mm FROM registration")
        return (np.array(json.loads(found[0][0])), found[0][1]) if found else None

    def set_registration(self, world_from_base: Floats, residual_mm: float, poses: int) -> None:
        """Keep where the base stands."""
        row = (json.dumps(world_from_base.tolist()), residual_mm, poses, time.time())
        self._write("INSERT INTO registration VALUES (1, ?, ?, ?, ?)", row)

    def add_stretch(
        self, measured: int, model: str, mean_mm: float, p95_mm: float, expected_mm: float
    ) -> None:
        """Keep what the calibration so far is worth."""
        row = (measured, model, mean_mm, p95_mm, expected_mm, time.time())
        self._write("INSERT OR REPLACE INTO stretches VALUES (?, ?, ?, ?, ?, ?)", row)

    def rows(self, query: str, values: Sequence[Any] | Mapping[str, Any] = ()) -> list[tuple[Any, ...]]:
        """Rows of a query that reads.

        Raises:
            InputError: If the file is damaged, or cannot be read.
        """
        try:
            return self._db.execute(query, values).fetchall()
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            raise unreadable(error, self.path) from None

    def measured_poses(self) -> int:
        """How many poses of the list are measured."""
        return int(
            self.rows("SELECT count(*) FROM outcomes JOIN steps USING (step) "
                      "WHERE kind = 'pose' AND outcome = 'measured'")[0][0]
        )  # fmt: skip

    def check_next(self) -> bool:
        """Have the contact that was measured first measured again, before any step that is left.

        It becomes a step of its own; those that are left, and readings that one of them has, count on from
        it. Nothing is to be done where the next step is a check, or none is left, or nothing is measured.

        Returns:
            Whether there is a new step.
        """
        step, first = self.next_step(), self.rows(FIRST_MEASURED)
        if step is None or step.kind == "check" or not first:
            return False
        self._insert_check(step.step, first[0])
        return True

    def check_elsewhere(self, step: int) -> bool:
        """Have another contact for the frame measured again behind a check that told nothing.

        Returns:
            Whether there is such a step now; not where all contacts were tried in this row of checks.
        """
        other = self.rows(OTHER_CONTACT, {"step": step})
        if not other:
            return False
        self._insert_check(step + 1, other[0])
        return True

    def _insert_check(self, step: int, contact: tuple[Any, ...]) -> None:
        """Put a check of a contact, which is (pose, purpose, approach, readings), in the place of a step."""
        with self.together():
            for query in MOVE_AWAY:
                self._write(query, (step,))
            for query in MOVE_BACK:
                self._write(query)
            self._write(ADD_STEP, (step, "check", *contact))

    @contextmanager
    def together(self) -> Iterator[None]:
        """What is added inside is committed together."""
        self._write("BEGIN IMMEDIATE")
        try:
            yield
            self._write("COMMIT")
        except BaseException:
            # A full disk ends a transaction by itself.
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            raise

    def _write(self, query: str, values: Sequence[Any] = ()) -> None:
        """Do what changes the file.

        Raises:
            WorkError: If that fails, as on a full disk.
            InputError: If the file is damaged.
        """
        try:
            self._db.execute(query, values)
        except sqlite3.OperationalError as error:
            self._keeps = False
            raise WorkError(
                f"the session cannot be written: {error}",
                where=str(self.path),
                way_out="What it says is stored is there. Make room, then the same command goes on",
            ) from None
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            self._keeps = False
            raise unreadable(error, self.path) from None

    def _check_version(self) -> None:
        tables = {name for (name,) in self.rows("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if "meta" not in tables:
            raise InputError(
                "this is no session file: it has no table meta",
                where=str(self.path),
                rule="truearm measure makes them",
            )
        version = self.meta("version")
        if version != VERSION:
            raise InputError(
                f"layout {version}",
                where=str(self.path),
                rule=f"This version of truearm knows layout {VERSION}",
            )


def _locked(path: Path) -> FileLock:
    """The lock of a session file, held by this process."""
    lock = FileLock(f"{path.resolve()}.lock")
    try:
        lock.acquire(timeout=0.0)
    except Timeout:
        raise WorkError(
            "another process is measuring into this session", where=str(path), way_out="Wait for it"
        ) from None
    return lock


def _write_new(file: Path, steps: Sequence[Step], values: dict[str, Any]) -> None:
    """Write a session with steps and a head, to a file that is not there yet."""
    with closing(sqlite3.connect(file, isolation_level=None)) as database:
        database.executescript(SCHEMA)
        database.execute("BEGIN")
        rows = [(key, json.dumps(value)) for key, value in values.items()]
        database.executemany("INSERT INTO meta VALUES (?, ?)", rows)
        database.executemany(ADD_STEP, map(_step_row, steps))
        database.execute("COMMIT")


def _point(values: tuple[Any, ...]) -> Point | None:
    return None if values[0] is None else values


def _listed(values: Floats) -> str:
    """Finite numbers as JSON, which is how Python writes them."""
    return str(np.asarray(values).tolist())


def _step_row(step: Step) -> tuple[Any, ...]:
    return (step.step, step.kind, step.pose, step.purpose, step.approach, _listed(step.readings))


def _steps(rows: Sequence[tuple[Any, ...]]) -> list[Step]:
    readings = np.array(json.loads(f"[{','.join(row[5] for row in rows)}]"))
    return [
        Step(step, kind, pose, purpose, approach, each)
        for (step, kind, pose, purpose, approach, _), each in zip(rows, readings, strict=True)
    ]
