"""Arithmetic on numbers that are known before the program runs."""

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Final

from truearm.programs.lexing import Token

DEEPEST: Final = 50

Functions = Mapping[str, Callable[[float], float]]


def constant(
    found: Sequence[Token], known: Mapping[str, float], functions: Functions | None = None
) -> float | None:
    """The value of an expression of numbers, known names, + - * / and parentheses; None for any other, and
    where it is too large for a number.

    Args:
        found: Its tokens.
        known: Values of names, in small letters.
        functions: Functions of one number, by name in small letters.
    """
    folder = _Folder(found, known, functions or {})
    value = folder.sum(0)
    return value if value is not None and isfinite(value) and folder.at == len(found) else None


class _Folder:
    def __init__(self, found: Sequence[Token], known: Mapping[str, float], functions: Functions) -> None:
        self._tokens, self._known, self._functions = found, known, functions
        self.at = 0

    def _peek(self) -> str:
        return self._tokens[self.at].text.lower() if self.at < len(self._tokens) else ""

    def sum(self, depth: int) -> float | None:
        value = self._product(depth)
        while value is not None and self._peek() in {"+", "-"}:
            sign = 1.0 if self._tokens[self.at].text == "+" else -1.0
            self.at += 1
            more = self._product(depth)
            value = None if more is None else value + sign * more
        return value

    def _product(self, depth: int) -> float | None:
        value = self._signed(depth)
        while value is not None and self._peek() in {"*", "/"}:
            operator = self._peek()
            self.at += 1
            more = self._signed(depth)
            if more is None or (operator == "/" and more == 0.0):
                return None
            value = value * more if operator == "*" else value / more
        return value

    def _signed(self, depth: int) -> float | None:
        sign = 1.0
        while self._peek() in {"+", "-"}:
            sign = -sign if self._peek() == "-" else sign
            self.at += 1
        value = self._atom(depth)
        return None if value is None else sign * value

    def _atom(self, depth: int) -> float | None:
        if self.at >= len(self._tokens) or depth > DEEPEST:
            return None
        token = self._tokens[self.at]
        self.at += 1
        if token.kind == "number":
            return float(token.text)
        if token.text == "(":
            return self._closed(depth)
        if token.kind == "name" and self._peek() == "(":
            function = self._functions.get(token.text.lower())
            self.at += 1
            argument = self._closed(depth)
            return None if function is None or argument is None else function(argument)
        return self._known.get(token.text.lower()) if token.kind == "name" else None

    def _closed(self, depth: int) -> float | None:
        value = self.sum(depth + 1)
        if self._peek() != ")":
            return None
        self.at += 1
        return value
