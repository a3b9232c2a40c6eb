"""Templates of commands and patterns of answers, as the cell file has them for devices that talk in lines."""

import re
import string
from collections.abc import Mapping
from typing import Final

from truearm.errors import InputError

NUMBER: Final = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"


def filled(template: str, values: Mapping[str, float]) -> str:
    """A command with its numbers.

    Raises:
        InputError: If the template names a value that there is not.
    """
    try:
        return template.format(**values)
    except (KeyError, IndexError, ValueError) as error:
        raise InputError(
            f'"{template}" cannot be filled: {error}', rule=f"Known here: {', '.join(values)}"
        ) from None


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
