"""Templates of commands and patterns of answers, as the cell file has them for devices that talk in lines."""

import re
import string
from collections.abc import Mapping, Sequence
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
    except (KeyError, IndexError, ValueError, AttributeError, TypeError) as error:
        raise InputError(
            f'"{template}" cannot be filled: {error}', rule=f"Known here: {', '.join(values)}"
        ) from None


def check_template(template: str, known: Sequence[str], needed: Sequence[str] = ()) -> None:
    """Raise InputError unless a template can be filled with known numbers, and names all needed ones."""
    filled(template, dict.fromkeys(known, 0.0))
    named = {name for _, name, _, _ in string.Formatter().parse(template)}
    missing = [name for name in needed if name not in named]
    if missing:
        raise InputError(f'"{template}" leaves out {{{missing[0]}}}', rule=f"It names {', '.join(needed)}")


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
