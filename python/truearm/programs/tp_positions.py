"""The sections of a FANUC listing and its positions, /POS: where their numbers are and what they are of."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from typing import Final

from truearm.programs.program import LineCount
from truearm.programs.source import Source
from truearm.programs.tables import ABSENT, Number
from truearm.programs.tp_configuration import LETTERS, MOST_TURNS

JOINTS, POSE = 0, 1
_SECTION: Final = re.compile(r"^/(PROG|ATTR|APPL|MN|POS|END)\b[^\n]*(?:\n|\Z)", re.MULTILINE)
_POSITION: Final = re.compile(r"^P\[(\d{1,9})(?::[^\]\r\n]*)?\]\s*\{(.*?)^\s*\};?", re.MULTILINE | re.DOTALL)
_OPENING: Final = re.compile(r"^P\[(\d+)", re.MULTILINE)
_GROUP: Final = re.compile(r"\bGP(\d+)\s*:")
_FIELD: Final = re.compile(
    r"\b([XYZWPR]|[JE]\d)\s*=\s*([+-]?(?:\d+\.?(\d*)|\.(\d+))(?:[eE][+-]?\d+)?|\*+)\s*(mm|deg|inch)?"
)
_FRAME: Final = re.compile(r"\b(UF|UT)\s*:\s*(\d+|F)\b")
_CONFIG: Final = re.compile(
    r"\bCONFIG\s*:\s*'\s*(\w)\s*(\w)\s*(\w)\s*,\s*([+-]?\d+)\s*,\s*([+-]?\d+)\s*,\s*([+-]?\d+)\s*'"
)
_NO_GROUP: Final = "it has no motion group 1 (GP1), whose arm is corrected"
_NO_CONFIG: Final = (
    f"its CONFIG is not three letters N/F U/D T/B and three turn numbers of at most {MOST_TURNS}"
)
_CARTESIAN: Final = "XYZWPR"
CURRENT: Final = "F"


_LINE_COUNT: Final = re.compile(r"^LINE_COUNT[ \t]*=[ \t]*(\d{1,9})\b", re.MULTILINE)


@dataclass(frozen=True)
class Position:
    """One position.

    Attributes:
        number: Its number.
        at: Offset of its name.
        layout: JOINTS or POSE.
        numbers: Its numbers in the order of the layout.
        frame: Number of its user frame; F for the current one.
        tool: Number of its tool frame; F for the current one.
        problem: Why it cannot be changed with certainty; empty if it can.
        sure: Whether it certainly is the one of its number.
    """

    number: int
    at: int
    layout: int
    numbers: tuple[Number, ...]
    frame: str
    tool: str
    problem: str = ""
    sure: bool = True


def line_count(source: Source) -> LineCount | None:
    """Where /ATTR says how many lines /MN has."""
    lines = section(source, "MN")
    found = _LINE_COUNT.search(source.text_with_line_feeds, 0, lines[0])
    return None if found is None else LineCount(*found.span(1), lines)


def section(source: Source, name: str) -> tuple[int, int]:
    """Where a section's text begins, and where it ends.

    Raises:
        InputError: If there is none.
    """
    marks = list(_SECTION.finditer(source.text_with_line_feeds))
    for mark, behind in zip(marks, [*marks[1:], None], strict=False):
        if mark.group(1) == name:
            return mark.end(), len(source.text) if behind is None else behind.start()
    return source.fail(
        0, f"there is no section /{name}", rule="A FANUC listing has /PROG, /ATTR, /MN, /POS and /END"
    )


def positions(source: Source, start: int, end: int, joint_count: int) -> Iterator[Position]:
    """The positions between two offsets.

    Raises:
        InputError: If one does not end; names line and column.
    """
    text, behind = source.text_with_line_feeds, start
    while (opening := _OPENING.search(text, behind, end)) is not None:
        found = _POSITION.match(text, opening.start(), end)
        if found is None:
            source.fail(opening.start(), f"position P[{opening.group(1)}] is not closed with }}")
        yield _position(text, found, joint_count)
        behind = found.end()


def position_text(source: Source, at: int) -> str | None:
    """The whole text of the position at an offset; None if more motion groups than one are in it."""
    found = _POSITION.match(source.text_with_line_feeds, at)
    if found is None or len(_GROUP.findall(found.group())) > 1:
        return None
    return source.part(*found.span())


def _position(text: str, found: re.Match[str], joint_count: int) -> Position:
    group = _first_group(text, *found.span(2))
    start, end = group or (0, 0)
    fields = {one.group(1): one for one in _FIELD.finditer(text, start, end)}
    frames = {one.group(1): one.group(2) for one in _FRAME.finditer(text, start, end)}
    config = _CONFIG.search(text, start, end)
    cartesian = any(name in fields for name in _CARTESIAN)
    names = list(_CARTESIAN) if cartesian else [f"J{joint + 1}" for joint in range(joint_count)]
    problem = _NO_GROUP if group is None else _problem(fields, names, joint_count)
    width = len(names) + (len(LETTERS) + 3 if cartesian else 0)
    numbers: tuple[Number, ...] = (ABSENT,) * width
    if not problem:
        numbers = tuple(_number(fields[name]) for name in names)
        digits = _digits(config) if cartesian else ()
        problem = "" if digits is not None else _NO_CONFIG
        numbers = (ABSENT,) * width if digits is None else numbers + digits
    return Position(
        int(found.group(1)),
        found.start(),
        POSE if cartesian else JOINTS,
        numbers,
        frames.get("UF", CURRENT),
        frames.get("UT", CURRENT),
        problem,
    )


def _first_group(text: str, start: int, end: int) -> tuple[int, int] | None:
    """The part of a position that is of motion group 1: all where no group is named; None without it."""
    marks = list(_GROUP.finditer(text, start, end))
    for mark, behind in zip(marks, [*marks[1:], None], strict=False):
        if mark.group(1) == "1":
            return mark.end(), end if behind is None else behind.start()
    return (start, end) if not marks else None


def _problem(fields: dict[str, re.Match[str]], names: list[str], joint_count: int) -> str:
    """Why the numbers of a position cannot be changed; empty if they can."""
    outside = sorted(set(fields) - set(names))
    if any(name.startswith("E") for name in outside):
        return f"external axis {outside[0]} moves with the arm"
    if outside:
        return f"it states {outside[0]}, and the arm has {joint_count} joints"
    missing = [name for name in names if name not in fields]
    if missing:
        return f"it does not state {missing[0]}"
    return next((why for name, found in fields.items() if (why := _why_unreadable(name, found))), "")


def _why_unreadable(name: str, found: re.Match[str]) -> str:
    """Why a number is none in mm and deg; empty if it is one."""
    if "*" in found.group(2):
        return "it is not taught"
    if not isfinite(float(found.group(2))):
        return f"its {name} is too large for a number"
    return "" if found.group(5) in {None, _unit(name)} else "it is not in mm and deg"


def _unit(name: str) -> str:
    return "mm" if name in "XYZ" else "deg"


def _number(found: re.Match[str]) -> Number:
    start, end = found.span(2)
    decimals = len(found.group(3) or found.group(4) or "")
    return Number(start, end, float(found.group(2)), decimals)


def _digits(config: re.Match[str] | None) -> tuple[Number, ...] | None:
    """Letters and turn numbers; None if they are others than we know."""
    if config is None:
        return None
    letters = []
    for place, known in enumerate(LETTERS, start=1):
        index = known.find(config.group(place).upper())
        if index < 0:
            return None
        letters.append(Number(*config.span(place), float(index), 0))
    turned = [Number(*config.span(place), float(config.group(place)), 0) for place in (4, 5, 6)]
    return (*letters, *turned) if all(abs(number.value) <= MOST_TURNS for number in turned) else None
