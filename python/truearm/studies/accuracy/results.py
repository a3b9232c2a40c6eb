"""Results as they are kept: one JSON line each, written as soon as it is there, so that a study can go on."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from truearm.errors import InputError
from truearm.files import read_text, write_whole

Record = dict[str, Any]
Key = tuple[str, ...]

LINES_NAME: Final = "results.jsonl"
KNOWN_BY: Final = ("set", "data", "split", "detail", "size", "seed", "quick", "method")


def key_of(record: Mapping[str, Any]) -> Key:
    """What a result is known by; one that does not say which rows it is of is none that is asked for."""
    return (*(str(record[name]) for name in KNOWN_BY), str(record.get("rows", "")))


class Kept:
    """The results of a directory.

    Attributes:
        records: By their keys.
    """

    def __init__(self, directory: Path) -> None:
        """Read what is there, but for a last line that an interruption cut off.

        Raises:
            InputError: If a line is none of ours.
        """
        self._path = directory / LINES_NAME
        self.records: dict[Key, Record] = {}
        lines = read_text(self._path).splitlines(keepends=True) if self._path.exists() else []
        self._cut_off = bool(lines) and not lines[-1].endswith("\n")
        for number, line in enumerate(lines[:-1] if self._cut_off else lines, start=1):
            record = _parsed(line, f"{self._path}, line {number}")
            self.records[key_of(record)] = record

    def add(self, records: Iterable[Record]) -> None:
        """Keep further results, in the file too."""
        if self._cut_off:
            self._write()
        with self._path.open("a", encoding="utf-8") as file:
            for record in records:
                file.write(json.dumps(record, allow_nan=False) + "\n")
                self.records[key_of(record)] = record

    def forget(self, methods: Iterable[str]) -> None:
        """Take the results of methods away, so that they are found again."""
        gone = set(methods)
        self.records = {key: record for key, record in self.records.items() if record["method"] not in gone}
        if self._path.exists():
            self._write()

    def _write(self) -> None:
        lines = [json.dumps(record, allow_nan=False) + "\n" for record in self.records.values()]
        write_whole(self._path, "".join(lines))
        self._cut_off = False


def _parsed(line: str, where: str) -> Record:
    try:
        record: Record = json.loads(line)
        key_of(record)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"this is no result of the study ({error})",
            where=where,
            way_out="Name another directory with -o, or take the file away",
        ) from None
    return record
