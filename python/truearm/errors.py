"""Errors and notices of truearm: built from what went wrong, read by people.

Every error says what was found, where, which rule it breaks and the way out. The command line shows
the message and exits with status 1, or 2 for :class:`UsageError`.
"""

import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Self

from truearm.lengths import how_far

MAX_ROWS_NAMED = 10
OUTLIERS_NAMED = 5


class TruearmError(Exception):
    """Base of all errors that truearm raises on purpose.

    Attributes:
        what: What was found, with the value.
        where: File, key, column or argument; empty when there is none.
        rule: What it should have been; empty where nothing more is to be said.
        way_out: What the user can do about it; empty where nothing more is to be said.
    """

    def __init__(self, what: str, *, where: str = "", rule: str = "", way_out: str = "") -> None:
        self.what, self.where, self.rule, self.way_out = what, where, rule, way_out
        head = f"{where}: {what}" if where else what
        super().__init__(" ".join(_sentence(part) for part in (head, rule, way_out) if part))

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild, (type(self), self.what, self.where, self.rule, self.way_out)

    def at(self, where: str) -> Self:
        """The same error, found in `where`; a place it already names stays behind it."""
        place = f"{where}, {self.where}" if self.where else where
        return type(self)(self.what, where=place, rule=self.rule, way_out=self.way_out)


class InputError(TruearmError):
    """A file or a value that cannot be used."""


class UsageError(TruearmError):
    """Options or arguments that contradict each other, cannot be read or are of another type."""


class WorkError(TruearmError):
    """The input is well formed, and still the work could not be done."""


class TooFewError(InputError):
    """Measurements that are right, and fewer than the work needs."""


@dataclass(frozen=True)
class Notice:
    """Something the user should know that stops nothing.

    Attributes:
        kind: Short name for programs, such as "limits" or "identical_rows".
        message: The whole sentence for people.
        rows: Data rows it is about, counted from 1 within their files.
    """

    kind: str
    message: str
    rows: tuple[int, ...] = ()

    def __str__(self) -> str:
        return self.message


def in_json(notices: Iterable[Notice]) -> list[dict[str, str]]:
    """Notices as JSON values: what programs and what people read of each."""
    return [{"kind": notice.kind, "message": notice.message} for notice in notices]


def list_rows(rows: Iterable[int], noun: str = "row") -> str:
    """The rows in words, the first ten by number: "row 3", "rows 1, 2 and 5", "rows 1, ... and 7 more"."""
    numbers = [str(row) for row in rows]
    if len(numbers) == 1:
        return f"{noun} {numbers[0]}"
    named, rest = numbers[:MAX_ROWS_NAMED], len(numbers) - MAX_ROWS_NAMED
    if rest > 0:
        return f"{noun}s {', '.join(named)} and {rest} more"
    return f"{noun}s {', '.join(named[:-1])} and {named[-1]}"


def short_names(files: Iterable[str]) -> dict[str, str]:
    """The end of each path that tells it from the others: "m.csv", or "mon/m.csv" beside "tue/m.csv"."""
    parts = {file: Path(file).parts for file in files}
    found = {}
    for file, own in parts.items():
        others = [other for name, other in parts.items() if name != file]
        lengths = range(1, len(own) + 1)
        alike = (any(other[-n:] == own[-n:] for other in others) for n in lengths)
        length = next((n for n, is_alike in zip(lengths, alike, strict=True) if not is_alike), len(own))
        found[file] = Path(*own[-length:]).as_posix()
    return found


def list_outliers(outliers: Sequence[Mapping[str, Any]], files: Iterable[str]) -> str:
    """Rows with their distances in words, the first five: "row 3 (24.98 mm), row 8 (12.10 mm) and 2 more".

    Args:
        outliers: file, row, distance_mm and, with orientation, turn_mrad of each, the worst first.
        files: All files of the data; where they are several, each row has its own named.
    """
    names = short_names(files)
    named = [
        f"row {outlier['row']}{' of ' + names[outlier['file']] if len(names) > 1 else ''}"
        f" ({how_far(outlier['distance_mm'], outlier.get('turn_mrad'))})"
        for outlier in outliers[:OUTLIERS_NAMED]
    ]
    more = f" and {len(outliers) - len(named)} more" if len(outliers) > len(named) else ""
    return f"{', '.join(named)}{more}"


def count_of(count: int, noun: str) -> str:
    """A number with its noun: "1 row", "0 rows", "12 rows"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def rows_in_words(rows: int, poses: int, which: str = "") -> str:
    """How many rows: "12 training rows", or "4 training poses (12 rows)" where poses have several shots."""
    if rows == poses:
        return count_of(rows, f"{which}row")
    return f"{count_of(poses, f'{which}pose')} ({count_of(rows, 'row')})"


def typed(text: object) -> str:
    """A path or name as shells read it as one word: quoted where it holds blanks or what they act on."""
    word = str(text)
    return word if re.fullmatch(r"[\w@%+=:,./-][\w@%+=:,./#-]*", word) else shlex.quote(word)


def list_names(names: Iterable[str], last: str = "and") -> str:
    """Quoted names in words: "a", "b" and "c"."""
    quoted = [f'"{name}"' for name in names]
    if len(quoted) <= 1:
        return "".join(quoted)
    return f"{', '.join(quoted[:-1])} {last} {quoted[-1]}"


def nearest(name: str, known: Sequence[str], count: int = 3) -> list[str]:
    """The known names most like `name`, best first, case ignored; empty when none is like it."""
    by_folded = {candidate.casefold(): candidate for candidate in known}
    found = get_close_matches(name.casefold(), list(by_folded), n=count, cutoff=0.6)
    return [by_folded[folded] for folded in found]


def did_you_mean(name: str, known: Sequence[str]) -> str:
    """A question naming the nearest known names, or nothing."""
    near = nearest(name, known)
    return f"Did you mean {list_names(near, last='or')}?" if near else ""


def _sentence(text: str) -> str:
    return text if text.endswith((".", "?", "!", ":")) else f"{text}."


def _rebuild(kind: type[TruearmError], what: str, where: str, rule: str, way_out: str) -> TruearmError:
    return kind(what, where=where, rule=rule, way_out=way_out)
