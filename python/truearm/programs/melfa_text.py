"""MELFA BASIC's lines, and the position and joint constants in them."""

import re
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from truearm.programs.source import Source
from truearm.programs.tables import ABSENT, Number

JOINTS, POSE = 0, 1
SLOTS: Final = 6
EMPTY_SLOT: Final = 3
_LINE: Final = re.compile(r"[^\n]*\n?")
_NUMBERED: Final = re.compile(r"\s*\d+(?=[ \t*])")
_STRING_OR_REMARK: Final = re.compile(r"\"[^\"\n]*\"?|'[^\n]*|(?<![\w.])Rem\b[^\n]*", re.IGNORECASE)
_ELEMENT: Final = re.compile(r"\s*([+-]?(?:\d+\.?(\d*)|\.(\d+))(?:[eE][+-]?\d+)?)?\s*\Z")
_CONSTANT: Final = re.compile(r"\s*\(([^()]*)\)\s*(?:\(([^()]*)\))?\s*\Z")
NAME: Final = r"[A-Za-z]\w*(?:\(\s*\d+(?:\s*,\s*\d+)*\s*\))?"
_ASSIGNMENT: Final = re.compile(rf"\s*({NAME})\s*=(?!=)")


class Statement(NamedTuple):
    """One line without its number; strings and remarks are blanked out.

    Attributes:
        at: Offset of its first character.
        text: As long as it is in the program.
    """

    at: int
    text: str


class Constant(NamedTuple):
    """A position or joint constant.

    Attributes:
        layout: JOINTS or POSE.
        numbers: Its numbers in the order of the layout; none where they cannot be read.
        problem: Why it cannot be changed with certainty; empty if it can.
    """

    layout: int
    numbers: tuple[Number, ...]
    problem: str = ""


def statements(source: Source) -> Iterator[Statement]:
    """The lines of a program that hold something."""
    for found in _LINE.finditer(source.text):
        line = found.group().rstrip("\r\n")
        numbered = _NUMBERED.match(line)
        start = numbered.end() if numbered is not None else 0
        text = without_remark(line[start:])
        if text.strip():
            yield Statement(found.start() + start, text)


def without_remark(line: str) -> str:
    """A line with strings and remarks blanked out."""
    return _STRING_OR_REMARK.sub(lambda one: " " * len(one.group()), line)


def assignment(statement: Statement) -> tuple[str, int, str] | None:
    """Name without blanks, offset of the value and value of an assignment; None if it is none."""
    found = _ASSIGNMENT.match(statement.text)
    if found is None:
        return None
    name = re.sub(r"\s", "", found.group(1))
    return name, statement.at + found.end(), statement.text[found.end() :]


def constant(text: str, at: int, *, joints: bool, joint_count: int) -> Constant | None:
    """The constant that `text`, at an offset, is; None if it is something else.

    Args:
        text: The text behind the equals sign.
        at: Its offset.
        joints: Whether it is of joints, which its variable's name says.
        joint_count: Joints of the arm: five leave the fourth slot empty.
    """
    found = _CONSTANT.match(text)
    if found is None:
        return None
    values = _numbers(text, at, found.span(1))
    flags = _numbers(text, at, found.span(2)) if found.group(2) is not None else None
    if values is None or (found.group(2) is not None and flags is None):
        return Constant(JOINTS if joints else POSE, (), "a number in it is computed or not decimal")
    if joints:
        return _joints(values, joint_count)
    return _pose(values, flags)


def _joints(values: Sequence[Number], joint_count: int) -> Constant:
    slots = [slot for slot in range(SLOTS) if joint_count == SLOTS or slot != EMPTY_SLOT]
    if len(values) < SLOTS:
        return Constant(JOINTS, (), f"it has {len(values)} numbers, not one for each of six slots")
    outside = [number for slot, number in enumerate(values) if slot not in slots]
    if any(number is not ABSENT and number.value != 0.0 for number in outside):
        return Constant(JOINTS, (), "an additional axis, or a joint that the arm has not, is not at zero")
    chosen = tuple(values[slot] for slot in slots)
    return Constant(JOINTS, chosen, "a joint is left out" if ABSENT in chosen else "")


def _pose(values: Sequence[Number], flags: Sequence[Number] | None) -> Constant:
    if len(values) < SLOTS or ABSENT in values[:SLOTS]:
        return Constant(POSE, (), "it does not state X, Y, Z, A, B and C")
    if any(number is not ABSENT and number.value != 0.0 for number in values[SLOTS:]):
        return Constant(POSE, (), "an additional axis, L1 or L2, is not at zero")
    if flags is None or len(flags) != 2 or ABSENT in flags:
        problem = "it states no structure flags, and their default depends on the model of the arm"
        return Constant(POSE, (*values[:SLOTS], ABSENT, ABSENT), problem)
    return Constant(POSE, (*values[:SLOTS], *flags))


def _numbers(text: str, at: int, span: tuple[int, int]) -> list[Number] | None:
    """The numbers between commas, ABSENT for what is empty; None if something is no number."""
    numbers, start = [], span[0]
    for piece in text[span[0] : span[1]].split(","):
        found = _ELEMENT.match(piece)
        if found is None:
            return None
        if found.group(1) is None:
            numbers.append(ABSENT)
        else:
            first, last = (at + start + edge for edge in found.span(1))
            decimals = len(found.group(2) or found.group(3) or "")
            numbers.append(Number(first, last, float(found.group(1)), decimals))
        start += len(piece) + 1
    return numbers
