"""What is wrong in a session file that was damaged, or in values that were changed by hand."""

import json
import math
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

from truearm.cell.shown import shown
from truearm.errors import InputError

Rows = Callable[[str], list[tuple[Any, ...]]]

RECOVER: Final = "Go on from a copy of it, or recover what can be read of it: sqlite3 FILE .recover"
PUT_BACK: Final = "Put back what was there, or go on from a copy of the file"
# The file itself may be whole: it is in use, or the disk or the rights to it are what is wrong.
NOT_DAMAGE: Final = (
    sqlite3.SQLITE_BUSY,
    sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_FULL,
    sqlite3.SQLITE_IOERR,
    sqlite3.SQLITE_LOCKED,
    sqlite3.SQLITE_PERM,
    sqlite3.SQLITE_READONLY,
)
PRIMARY: Final = 0xFF
NO_FILES: Final = (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY)
"""The files that SQLite needs beside it cannot be made."""
COPY: Final = "Copy it, with the files of its name and -wal and -shm, to where files can be written"
NUMBERS: Final = "a list of numbers, one a joint, in JSON"
# How many readings the first step has: one a joint.
JOINTS: Final = "(SELECT json_array_length(readings) FROM steps ORDER BY step LIMIT 1)"


class Rule(NamedTuple):
    """What values of a column have to be.

    Attributes:
        table: The table.
        column: The column.
        bad: A condition in SQL that rows fulfil whose value is none of these.
        words: What they have to be, in words.
    """

    table: str
    column: str
    bad: str
    words: str


def _no(kinds: str, *columns: str) -> str:
    """A condition: one of the columns has a value of another type."""
    listed = ", ".join(f"'{kind}'" for kind in kinds.split())
    return " OR ".join(f"typeof({column}) NOT IN ({listed})" for column in columns)


def _no_list(column: str, kinds: str, also: str) -> str:
    """A condition: the column is no JSON list of values of certain types, or something else is wrong."""
    listed = ", ".join(f"'{kind}'" for kind in kinds.split())
    other = f"EXISTS (SELECT 1 FROM json_each({column}) each WHERE each.type NOT IN ({listed}))"  # noqa: S608
    return (
        f"CASE WHEN typeof({column}) != 'text' OR NOT json_valid({column}) THEN 1 "
        f"WHEN json_type({column}) != 'array' THEN 1 ELSE {other} OR {also} END"
    )


def _joints(table: str, column: str) -> Rule:
    """A column holds one number for each joint."""
    bad = _no_list(column, "integer real", f"json_array_length({column}) != {JOINTS}")
    return Rule(table, column, bad, NUMBERS)


OF_STEP: Final = "(SELECT count(*) FROM readings AS own WHERE own.step = readings.step)"
RULES: Final = (
    Rule("steps", "kind", "kind NOT IN ('registration', 'pose', 'check')", "registration, pose or check"),
    Rule("steps", "pose", f"{_no('integer', 'pose')} OR pose < 0", "a whole number, from 0"),
    Rule("steps", "purpose", _no("text", "purpose"), "text"),
    Rule("steps", "approach", "approach NOT IN (1, -1, 0)", "1, -1 or 0"),
    _joints("steps", "readings"),
    Rule("readings", "step", "step NOT IN (SELECT step FROM steps)", "a step of the session"),
    Rule(
        "readings",
        "attempt",
        f"{_no('integer', 'attempt')} OR attempt < 1 OR attempt > {OF_STEP}",
        "a whole number, counted from 1 within its step",
    ),
    Rule("readings", "valid", "valid NOT IN (0, 1)", "0 or 1"),
    *(
        Rule(
            "readings",
            column,
            f"(typeof({column}) != 'real' AND (valid OR typeof({column}) != 'null')) "
            f"OR (valid AND abs({column}) = 9e999)",
            "a finite number, or empty where the reading is not valid",
        )
        for column in ("x_m", "y_m", "z_m")
    ),
    *(
        Rule("readings", column, f"typeof({column}) != typeof(qw) OR {_no('real null', column)}", "a number")
        for column in ("qw", "qx", "qy", "qz")
    ),
    Rule("readings", "sigma_m", _no("real", "sigma_m"), "a number"),
    Rule("readings", "temperature_c", _no("real null", "temperature_c"), "a number, or empty"),
    Rule("readings", "reason", _no("text", "reason"), "text"),
    Rule("readings", "raw", _no("text", "raw"), "text"),
    _joints("readings", "joints"),
    Rule("outcomes", "step", "step NOT IN (SELECT step FROM steps)", "a step of the session"),
    Rule("outcomes", "outcome", "outcome NOT IN ('measured', 'skipped')", "measured or skipped"),
    Rule("outcomes", "reason", _no("text", "reason"), "text"),
    Rule("outcomes", "time_s", _no("real", "time_s"), "a number"),
    Rule(
        "outcomes",
        "attempts",
        _no_list(
            "attempts",
            "integer",
            "outcome = 'measured' AND (json_array_length(attempts) = 0 OR EXISTS ("
            "SELECT 1 FROM json_each(attempts) each LEFT JOIN readings "
            "ON readings.step = outcomes.step AND readings.attempt = each.value "
            "WHERE readings.valid IS NOT 1))",
        ),
        "a list in JSON of attempts of that step whose readings are valid, one at least where it is measured",
    ),
    Rule("registration", "residual_mm", _no("real", "residual_mm"), "a number"),
    Rule("registration", "poses", _no("integer", "poses"), "a whole number"),
    Rule("stretches", "model", _no("text", "model"), "text"),
    *(
        Rule("stretches", column, _no("real", column), "a number")
        for column in ("mean_mm", "p95_mm", "expected_mm")
    ),
    Rule("events", "step", _no("integer null", "step"), "a whole number, or empty"),
    Rule("events", "kind", _no("text", "kind"), "text"),
    Rule("events", "message", _no("text", "message"), "text"),
)
KEYS: Final = {"registration": "id", "stretches": "measured", "events": "id"}
"""By what rows are named, where that is no step."""
YEAR_9000_S: Final = 2.2e11
# NaN and Infinity, which drivers may give, are no JSON for SQLite: such rows are looked at again.
DOUBTED_FEATURES: Final = (
    "SELECT step, features FROM readings WHERE features != '{}' AND CASE "
    "WHEN typeof(features) != 'text' OR NOT json_valid(features) THEN 1 "
    "WHEN json_type(features) != 'object' THEN 1 "
    "ELSE EXISTS (SELECT 1 FROM json_each(features) each WHERE each.type NOT IN ('integer', 'real')) END"
)


def unreadable(error: sqlite3.DatabaseError | UnicodeDecodeError, path: Path) -> InputError:
    """The error to raise where a session file cannot be read."""
    code = getattr(error, "sqlite_errorcode", 0) & PRIMARY
    if code in NOT_DAMAGE:
        way_out = COPY if code in NO_FILES else ""
        return InputError(f"the session cannot be read: {error}", where=str(path), way_out=way_out)
    what = "it holds bytes that are not UTF-8" if isinstance(error, UnicodeDecodeError) else error
    return InputError(f"the session file is damaged: {what}", where=str(path), way_out=RECOVER)


def check_values(rows: Rows, path: Path) -> None:
    """See that all values of a session are what truearm writes, so that nothing fails later on one.

    Args:
        rows: Gives the rows of a query.
        path: The file, for messages.

    Raises:
        InputError: If one is not, or the file cannot be read.
    """
    for rule in RULES:
        key = KEYS.get(rule.table, "step")
        # Names and conditions are those above.
        query = f"SELECT {key}, {rule.column} FROM {rule.table} WHERE {rule.bad} LIMIT 1"  # noqa: S608
        for place, value in rows(query):
            raise _wrong(path, f"{rule.table}, {key} {place}", rule.column, value, rule.words)
    for step, text in rows(DOUBTED_FEATURES):
        if not _is_numbers_by_name(value_of(text)):
            raise _wrong(path, f"readings, step {step}", "features", text, "numbers by name in JSON")
    for (text,) in rows("SELECT world_from_base FROM registration"):
        if not _is_frame(value_of(text)):
            raise _wrong(path, "registration", "world_from_base", text, "4 rows of 4 numbers in JSON")
    for key, text in rows("SELECT key, value FROM meta"):
        if not (_is_json(text) and HEAD.get(str(key), _is_any)(value_of(text))):
            raise _wrong(path, "meta", str(key), text, "JSON, as truearm measure writes it")


def value_of(text: object) -> Any:  # noqa: ANN401 - a JSON value
    """The value that JSON says; None where it is none."""
    try:
        return json.loads(text) if isinstance(text, str) else None
    except (ValueError, RecursionError):
        return None


def _is_json(text: object) -> bool:
    return text == "null" or value_of(text) is not None


def _is_any(value: object) -> bool:
    del value
    return True


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_numbers_by_name(value: object) -> bool:
    return isinstance(value, dict) and all(map(_is_number, value.values()))


def _is_frame(value: object) -> bool:
    return (
        isinstance(value, list)
        and len(value) == 4
        and all(isinstance(row, list) and len(row) == 4 for row in value)
        and all(_is_number(number) and math.isfinite(number) for row in value for number in row)
    )


def _is_moment(value: object) -> bool:
    return isinstance(value, int | float) and _is_number(value) and 0.0 <= value < YEAR_9000_S


HEAD: Final[dict[str, Callable[[object], bool]]] = {
    "arm": lambda value: isinstance(value, dict) and "name" in value,
    "created_s": _is_moment,
    "drift_mm": _is_number,
    "group": lambda value: value is None or isinstance(value, str),
}
"""Values of the head that are more than compared or shown."""


def _wrong(path: Path, place: str, column: str, value: object, words: str) -> InputError:
    return InputError(
        f"{column} is {shown(value)}", where=f"{path}, {place}", rule=f"It is {words}", way_out=PUT_BACK
    )
