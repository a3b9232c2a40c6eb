"""Templates of commands and patterns of answers, as the cell file has them for devices that talk in lines."""

import re
import string
from collections.abc import Mapping, Sequence
from typing import Any, Final

from truearm.errors import InputError

NUMBER: Final = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
EXPONENT: Final = re.compile(r"\d[eE][+-]?\d")
DECIMALS: Final = 9
"""Of numbers in fields that name no format: fine enough for rad and m."""
SMALL, USUAL = 1e-7, 45.0
"""Readings: one that a joint has at what should be zero, and one as it has elsewhere."""


class _Decimals(string.Formatter):
    """Fills templates; numbers without a format have decimals, never an exponent."""

    def format_field(self, value: Any, format_spec: str) -> Any:  # noqa: ANN401 - as string.Formatter has it
        if format_spec or not isinstance(value, float):
            return super().format_field(value, format_spec)
        # Adding zero makes a zero of a negative one.
        text = f"{round(value, DECIMALS) + 0.0:.{DECIMALS}f}".rstrip("0")
        return f"{text}0" if text.endswith(".") else text


def filled(template: str, values: Mapping[str, float]) -> str:
    """A command with its numbers: in decimals, where a field names no format.

    Raises:
        InputError: If the template names a value that there is not.
    """
    try:
        return _Decimals().format(template, **values)
    except (KeyError, IndexError, ValueError, AttributeError, TypeError) as error:
        raise InputError(
            f'"{template}" cannot be filled: {error}', rule=f"Known here: {', '.join(values)}"
        ) from None


def check_template(template: str, known: Sequence[str], needed: Sequence[str] = ()) -> None:
    """Raise InputError unless a template can be filled with known numbers, and names all needed ones.

    A format that writes small numbers alone with an exponent, such as g, is not known to be wanted: it is an
    error as well.
    """
    filled(template, dict.fromkeys(known, 0.0))
    named = {name for _, name, _, _ in string.Formatter().parse(template)}
    missing = [name for name in needed if name not in named]
    if missing:
        raise InputError(f'"{template}" leaves out {{{missing[0]}}}', rule=f"It names {', '.join(needed)}")
    small, usual = (filled(template, dict.fromkeys(known, value)) for value in (SMALL, USUAL))
    if len(EXPONENT.findall(small)) > len(EXPONENT.findall(usual)):
        raise InputError(
            f'"{template}" writes small numbers with an exponent: {small}',
            rule="Most controllers read decimals alone",
            way_out="Name decimals, as {q1:.4f}, or an exponent for all numbers, as {q1:.6e}",
        )


def expression(text: str) -> str:
    """A regular expression as it stands in the cell file.

    Raises:
        ValueError: If it is none; for pydantic's validators.
    """
    pattern_of(text, ())
    return text


def numbers_in(pattern: re.Pattern[str], line: str) -> dict[str, float] | None:
    """Numbers of the named groups of a pattern; None if the line is something else or damaged."""
    match = pattern.search(line)
    if match is None:
        return None
    try:
        return {name: float(text) for name, text in match.groupdict().items() if text is not None}
    except ValueError:
        return None


def pattern_of(text: str, needed: tuple[str, ...]) -> re.Pattern[str]:
    """A regular expression that names certain groups.

    Raises:
        ValueError: If it is none, or a group is missing; for pydantic's validators.
    """
    try:
        pattern = re.compile(text)
    except re.error as error:
        raise ValueError(f'"{text}" is no regular expression: {error}') from None
    missing = [name for name in needed if name not in pattern.groupindex]
    if missing:
        raise ValueError(f'"{text}" has no group (?P<{missing[0]}>...); it needs {", ".join(needed)}')
    return pattern


def expression_for(template: str) -> re.Pattern[str]:
    """A pattern that recognises what a template was filled to; the numbers are groups by name."""
    parts = []
    for text, name, _, _ in string.Formatter().parse(template):
        parts.append(re.escape(text))
        if name is not None:
            parts.append(f"(?P<{name}>{NUMBER})")
    return re.compile("".join(parts))
