"""A program's text: every byte one character, so that spans of text are spans of bytes."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NoReturn

from truearm.errors import InputError
from truearm.files import read_bytes


@dataclass(frozen=True, eq=False)
class Source:
    """One file of a program.

    Attributes:
        path: Where it was read.
        text: Its bytes decoded as Latin-1, whatever their encoding: encoding them again gives the same bytes.
    """

    path: Path
    text: str

    @classmethod
    def load(cls, path: Path) -> "Source":
        """The file at `path`.

        Raises:
            InputError: If it cannot be read, or is no program but binary data or text in UTF-16.
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
        return cls(path, content.decode("latin-1"))

    @cached_property
    def line_starts(self) -> Sequence[int]:
        """Offset of the first character of every line; lines end with LF, CR LF or CR."""
        starts, text, at = [0], self.text, 0
        mark = "\r" if "\n" not in text and "\r" in text else "\n"
        while (at := text.find(mark, at) + 1) > 0:
            starts.append(at)
        return starts

    @property
    def newline(self) -> str:
        """How the first line ends."""
        at = self.text.find("\n")
        if at < 0:
            return "\r" if "\r" in self.text else "\n"
        return "\r\n" if self.text[:at].endswith("\r") else "\n"

    def place(self, offset: int) -> tuple[int, int]:
        """Line and column of an offset, both from 1."""
        line = bisect_right(self.line_starts, offset)
        return line, offset - self.line_starts[line - 1] + 1

    def line_text(self, line: int) -> str:
        """Line `line`, from 1, without its end."""
        starts = self.line_starts
        end = starts[line] if line < len(starts) else len(self.text)
        return self.text[starts[line - 1] : end].rstrip("\r\n")

    def fail(self, offset: int, what: str, *, rule: str = "", way_out: str = "") -> NoReturn:
        """Raise InputError that names file, line and column of `offset`."""
        line, column = self.place(offset)
        where = f"{self.path}, line {line}, column {column}"
        raise InputError(what, where=where, rule=rule, way_out=way_out)
