"""A program's text: every byte one character, so that spans of text are spans of bytes."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final, NoReturn

import numpy as np

from truearm.errors import InputError
from truearm.files import read_bytes

LONGEST: Final = 2**31 - 1
GIBIBYTE: Final = 2**30

BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"


@dataclass(frozen=True, eq=False)
class Source:
    """One file of a program.

    Attributes:
        path: Where it was read.
        content: Its bytes.
    """

    path: Path
    content: bytes

    @property
    def first(self) -> int:
        """Where the text begins: behind a byte order mark."""
        return len(BYTE_ORDER_MARK) if self.content.startswith(BYTE_ORDER_MARK) else 0

    @classmethod
    def of(cls, path: Path, text: str) -> "Source":
        """A file that holds `text`, of Latin-1 characters."""
        return cls(path, text.encode("latin-1"))

    @classmethod
    def load(cls, path: Path) -> "Source":
        """The file at `path`.

        Raises:
            InputError: If it cannot be read, is too long, or is no program but binary data or text in UTF-16.
        """
        content = read_bytes(path)
        if content.startswith((b"\xff\xfe", b"\xfe\xff")):
            raise InputError("this is UTF-16 text", where=str(path), way_out="Save it as Latin-1 or UTF-8")
        if b"\x00" in content:
            raise InputError(
                "this is binary data, not the text of a program",
                where=str(path),
                way_out="Export the program as text",
            )
        if len(content) > LONGEST:
            raise InputError(
                f"this is a file of {len(content) / GIBIBYTE:.1f} GiB",
                where=str(path),
                rule="A program has less than 2 GiB",
                way_out="Split it",
            )
        return cls(path, content)

    @cached_property
    def text(self) -> str:
        """The bytes decoded as Latin-1, whatever their encoding: encoding them again gives the same bytes."""
        return self.content.decode("latin-1")

    @cached_property
    def text_with_line_feeds(self) -> str:
        """The text; where lines end with CR alone LF stands for it, so that offsets are the same."""
        return self.text if "\n" in self.text else self.text.replace("\r", "\n")

    def part(self, start: int, end: int) -> str:
        """The text from one offset to another, without decoding all of it."""
        return self.content[start:end].decode("latin-1")

    @cached_property
    def line_starts(self) -> Sequence[int]:
        """Offset of the first character of every line; lines end with LF, CR LF or CR."""
        content = self.content
        mark = b"\r" if b"\n" not in content and b"\r" in content else b"\n"
        ends = np.flatnonzero(np.frombuffer(content, dtype=np.uint8) == mark[0])
        return [0, *(ends + 1).tolist()]

    @property
    def newline(self) -> str:
        """How the first line ends."""
        at = self.content.find(b"\n")
        if at < 0:
            return "\r" if b"\r" in self.content else "\n"
        return "\r\n" if self.content[:at].endswith(b"\r") else "\n"

    def place(self, offset: int) -> tuple[int, int]:
        """Line and column of an offset, both from 1."""
        line = bisect_right(self.line_starts, offset)
        return line, offset - self.line_starts[line - 1] + 1

    def line_text(self, line: int) -> str:
        """Line `line`, from 1, without its end."""
        starts = self.line_starts
        end = starts[line] if line < len(starts) else len(self.content)
        return self.part(starts[line - 1], end).rstrip("\r\n")

    def fail(self, offset: int, what: str, *, rule: str = "", way_out: str = "") -> NoReturn:
        """Raise InputError that names file, line and column of `offset`."""
        line, column = self.place(offset)
        where = f"{self.path}, line {line}, column {column}"
        raise InputError(what, where=where, rule=rule, way_out=way_out)
