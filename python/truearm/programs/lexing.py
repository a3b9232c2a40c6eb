"""Words, numbers and marks of a program's text, each with its place; the same for languages alike enough."""

import re
from collections.abc import Iterator
from math import isfinite
from re import Pattern
from typing import Final, NamedTuple, NoReturn

from truearm.programs.source import Source
from truearm.programs.tables import Number

NUMBER: Final = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![\w.])"
_DIGITS: Final = re.compile(r"[+-]?\s*(?:\d*)\.?(\d*)(?:[eE]([+-]?\d+))?")


class Token(NamedTuple):
    """A piece of text.

    Attributes:
        kind: "name", "number", "string" or "mark".
        text: As it is written.
        start: Offset of its first character.
        end: Offset behind its last one.
    """

    kind: str
    text: str
    start: int
    end: int


def tokens(text: str, pattern: Pattern[str], start: int, end: int) -> Iterator[Token]:
    """The pieces of a part of a text; blanks and comments are left out.

    Args:
        text: The whole text.
        pattern: Groups named like the kinds of tokens; what matches no group is left out.
        start: Where the part begins.
        end: Where it ends.
    """
    for found in pattern.finditer(text, start, end):
        kind = found.lastgroup
        if kind is not None:
            yield Token(kind, found.group(), found.start(), found.end())


class Reader:
    """Goes through tokens of one statement."""

    def __init__(self, source: Source, found: list[Token], end: int) -> None:
        self.source, self._tokens, self._end = source, found, end
        self._at = 0

    @property
    def done(self) -> bool:
        """Whether nothing is left."""
        return self._at >= len(self._tokens)

    @property
    def offset(self) -> int:
        """Where the next token begins, or the statement ends."""
        if not self.done:
            return self._tokens[self._at].start
        return self._tokens[-1].end if self._tokens else self._end

    def peek(self, ahead: int = 0) -> str:
        """The next token in small letters; empty at the end."""
        place = self._at + ahead
        return self._tokens[place].text.lower() if place < len(self._tokens) else ""

    def kind(self, ahead: int = 0) -> str:
        """The kind of the next token; empty at the end."""
        place = self._at + ahead
        return self._tokens[place].kind if place < len(self._tokens) else ""

    def take(self) -> Token:
        """The next token.

        Raises:
            InputError: If the statement is at its end.
        """
        if self.done:
            self.fail("the statement ends too early")
        self._at += 1
        return self._tokens[self._at - 1]

    def accept(self, *texts: str) -> bool:
        """Whether the next token is one of these, in small letters; if so it is taken."""
        if self.peek() in texts:
            self._at += 1
            return True
        return False

    def expect(self, text: str) -> Token:
        """The next token, which must be this one, in small letters."""
        if self.peek() != text:
            self.fail(f'"{self.peek() or "the end"}" stands where "{text}" is expected')
        return self.take()

    def rest(self) -> list[Token]:
        """All that is left."""
        return self._tokens[self._at :]

    def signed_number(self) -> Number | None:
        """A number with its sign, if one is next; it is taken then.

        Raises:
            InputError: If no number is that large.
        """
        sign = 1 if self.peek() in {"-", "+"} else 0
        if self.kind(sign) != "number":
            return None
        first = self._tokens[self._at]
        last = self._tokens[self._at + sign]
        self._at += sign + 1
        value = float(last.text) * (-1.0 if first.text == "-" else 1.0)
        if not isfinite(value):
            self.source.fail(last.start, f"{last.text} is too large for a number")
        return Number(first.start, last.end, value, decimals_of(last.text))

    def fail(self, what: str) -> NoReturn:
        """Raise InputError with the place."""
        self.source.fail(self.offset, what)


def decimals_of(text: str) -> int:
    """Digits behind the point of a number's text; none where a negative exponent puts them out of sight."""
    found = _DIGITS.fullmatch(text)
    exponent = 0.0 if found is None else float(found.group(2) or 0)
    if found is None or exponent < 0.0:
        return 0
    return int(max(0.0, len(found.group(1)) - exponent))
