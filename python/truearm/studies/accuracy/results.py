"""Results as they are kept: one JSON line each, written as soon as it is there, so that a study can go on."""

import hashlib
import json
from collections.abc import Collection, Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from truearm.errors import InputError
from truearm.files import read_text, write_whole

Record = dict[str, Any]
Key = tuple[str, ...]

LINES_NAME: Final = "results.jsonl"
MARK: Final = "found_anew_by"
"""In a line: the request to find results anew that it answers."""
DIGITS: Final = 5
"""Significant digits of a result's numbers: far more than seeds agree in."""
KNOWN_BY: Final = ("set", "data", "split", "detail", "size", "seed", "quick", "method")


def key_of(record: Mapping[str, Any]) -> Key:
    """What a result is known by; one that does not say which rows it is of is none that is asked for."""
    return (*(str(record[name]) for name in KNOWN_BY), str(record.get("rows", "")))


class Kept:
    """The results of a directory; of several lines of a result the last one counts.

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
        self._marks: dict[Key, str] = {}
        self._anew, self._request = frozenset[Key](), ""
        lines = read_text(self._path).splitlines(keepends=True) if self._path.exists() else []
        self._cut_off = bool(lines) and not lines[-1].endswith("\n")
        for number, line in enumerate(lines[:-1] if self._cut_off else lines, start=1):
            record = _parsed(line, f"{self._path}, line {number}")
            mark = record.pop(MARK, "")
            self._put(record, mark)
        self._lines = len(lines)

    def find_anew(self, keys: Collection[Key]) -> None:
        """Let results of these keys be there only where they answer this request.

        A request is its keys and the version. One that was interrupted goes on: earlier results stay in the
        file until those that replace them come. One that has all its results begins again.
        """
        self._anew, self._request = frozenset(keys), _request(keys)
        if all(self._marks.get(key) == self._request for key in self._anew):
            for key in self._anew:
                del self._marks[key]
            self._write()

    def is_there(self, key: Key) -> bool:
        """Whether there is a result, found anew where that is asked for."""
        return key in self.records and (key not in self._anew or self._marks.get(key) == self._request)

    def add(self, records: Iterable[Record]) -> None:
        """Keep further results, in the file too."""
        if self._cut_off:
            self._write()
        with self._path.open("a", encoding="utf-8") as file:
            for record in map(_rounded, records):
                key = self._put(record, self._request if key_of(record) in self._anew else "")
                file.write(self._line(key))
                self._lines += 1

    def tidy(self) -> None:
        """Leave one line of each result in the file."""
        if self._lines > len(self.records):
            self._write()

    def _put(self, record: Record, mark: str) -> Key:
        key = key_of(record)
        self.records[key] = record
        self._marks.pop(key, None)
        if mark:
            self._marks[key] = mark
        return key

    def _line(self, key: Key) -> str:
        marked = {MARK: self._marks[key]} if key in self._marks else {}
        return json.dumps({**self.records[key], **marked}, allow_nan=False) + "\n"

    def _write(self) -> None:
        write_whole(self._path, "".join(map(self._line, self.records)))
        self._cut_off, self._lines = False, len(self.records)


def _rounded(record: Mapping[str, Any]) -> Record:
    """A result with as many digits as are kept."""
    found: Record = json.loads(
        json.dumps(record, allow_nan=False), parse_float=lambda text: float(f"{float(text):.{DIGITS}g}")
    )
    return found


def _request(keys: Iterable[Key]) -> str:
    """Short hash of the results that are asked for anew, and of the version that is to find them."""
    content = json.dumps([version("truearm"), *sorted(keys)])
    return hashlib.sha256(content.encode()).hexdigest()[:12]


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
