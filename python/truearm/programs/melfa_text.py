"""MELFA BASIC's lines, and the position and joint constants in them."""

import re
from collections.abc import Iterator, Sequence
from math import isfinite
from typing import Final, NamedTuple

from truearm.programs.source import Source
from truearm.programs.tables import ABSENT, Number

JOINTS, POSE = 0, 1
SLOTS: Final = 6
EMPTY_SLOT: Final = 3
_NUMBERED: Final = re.compile(r"\s*(\d{1,9})(?=[ \t*])")
_LABEL: Final = re.compile(r"\s*\*\w+")
_PARTS: Final = re.compile(r"(?<![\w.])(Then|Else|EndIf)\b|:", re.IGNORECASE)
_STRING_OR_REMARK: Final = re.compile(r"\"[^\"\n]*\"?|'[^\n]*|(?<![\w.])Rem\b[^\n]*", re.IGNORECASE)
_ELEMENT: Final = re.compile(r"\s*([+-]?(?:\d+\.?(\d*)|\.(\d+))(?:[eE][+-]?\d+)?)?\s*\Z")
_CONSTANT: Final = re.compile(r"\s*\(([^()]*)\)\s*(?:\(([^()]*)\))?\s*\Z")
NAME: Final = r"[A-Za-z]\w*(?:\(\s*\d+(?:\s*,\s*\d+)*\s*\))?"
_ASSIGNMENT: Final = re.compile(
    r"\s*(?!(?:If|ElseIf|While|Wait|Select|Case|For)\b)"
    r"([A-Za-z]\w*)[%!#&$]?\s*(\((?:[^()]|\([^()]*\))*\))?\s*(\.\s*\w+)?\s*=(?!=)",
    re.IGNORECASE,
)
_MOTION: Final = re.compile(
    r"(?<![\w.*])(Mov|Mvs|Mvc|Mvr[23]?|Mva|E?Mv(?!Tune\b)[A-Za-z]+|Jrc|Mxt)(?=[\s(,])", re.IGNORECASE
)
_WHOLE: Final = re.compile(NAME)
_END_OF_TARGETS: Final = re.compile(r"(?<![\w.])(Type|Wth|WthIf)\b", re.IGNORECASE)


class Statement(NamedTuple):
    """A statement of a line without the line's number; strings and remarks are blanked out.

    Attributes:
        at: Offset of its first character.
        text: As long as it is in the program; a label is a statement of its own.
        part: Which one of its line it is, from 0.
        lead: "then" or "else" before it, or "endif", in small letters; empty without.
        number: Its line's number; none without.
    """

    at: int
    text: str
    part: int = 0
    lead: str = ""
    number: int | None = None


class Move(NamedTuple):
    """A motion in a statement.

    Attributes:
        at: Offset of its word.
        word: Its word as it is written.
        pieces: What stands between the commas behind it.
        added: What is done or told besides: Type, Wth and WthIf.
    """

    at: int
    word: str
    pieces: list[str]
    added: str


class Assignment(NamedTuple):
    """An assignment.

    Attributes:
        name: Of the variable without blanks, the index of an element included.
        whole: Whether all of a variable is assigned, and which one is certain: no component, no element whose
            index is computed.
        at: Offset of the value.
        text: The value.
    """

    name: str
    whole: bool
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


def lines(source: Source) -> Iterator[tuple[int, str]]:
    """Offset and text of each line, without its end; a byte order mark is no part of the first one."""
    for number, start in enumerate(source.line_starts, start=1):
        skipped = source.first if number == 1 else 0
        yield start + skipped, source.line_text(number)[skipped:]


def statements(source: Source) -> Iterator[Statement]:
    """The statements of a program, in the order of the text."""
    for at, line in lines(source):
        numbered = _NUMBERED.match(line)
        start = numbered.end() if numbered is not None else 0
        text = without_remark(line)
        number = int(numbered.group(1)) if numbered is not None else None
        for part, (first, last, lead) in enumerate(_parts(text, start)):
            yield Statement(at + first, text[first:last], part, lead, number)


def _parts(line: str, start: int) -> list[tuple[int, int, str]]:
    """Where the statements of a line begin and end, and the words before them; none without a statement."""
    parts, lead = list[tuple[int, int, str]](), ""
    label = _LABEL.match(line, start)
    if label is not None:
        parts.append((*label.span(), ""))
        start = label.end()
    for mark in _PARTS.finditer(line, start):
        if lead or line[start : mark.start()].strip():
            parts.append((start, mark.start(), lead))
        start, lead = mark.end(), (mark.group(1) or "").casefold()
    if lead or line[start:].strip():
        parts.append((start, len(line), lead))
    return parts


def without_remark(line: str) -> str:
    """A line with strings and remarks blanked out."""
    return _STRING_OR_REMARK.sub(lambda one: " " * len(one.group()), line)


def moves(statement: Statement) -> list[Move]:
    """The motions of a statement."""
    text, found = statement.text, []
    words = list(_MOTION.finditer(text))
    for word, behind in zip(words, [*words[1:], None], strict=False):
        end = len(text) if behind is None else behind.start()
        mark = _END_OF_TARGETS.search(text, word.end(), end)
        last = end if mark is None else mark.start()
        pieces = split(text[word.end() : last])
        found.append(Move(statement.at + word.start(), word.group(), pieces, text[last:end]))
    return found


def split(text: str) -> list[str]:
    """The pieces between commas that are in no brackets."""
    pieces, depth, start = [], 0, 0
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth == 0:
            pieces.append(text[start:place])
            start = place + 1
    return [*pieces, text[start:]]


def name_of(text: str) -> str:
    """A variable's name as it is compared: case and blanks do not matter."""
    return re.sub(r"\s", "", text).casefold()


def array_of(name: str) -> str:
    """The array that an element is of; the name itself of what is none."""
    return name.partition("(")[0]


def assignment(statement: Statement) -> Assignment | None:
    """The assignment that a statement is; None if it is none."""
    found = _ASSIGNMENT.match(statement.text)
    if found is None:
        return None
    name = re.sub(r"\s", "", found.group(1) + (found.group(2) or ""))
    whole = found.group(3) is None and _WHOLE.fullmatch(name) is not None
    return Assignment(name, whole, statement.at + found.end(), statement.text[found.end() :])


def constant(text: str, at: int, *, joints: bool, joint_count: int) -> Constant | None:
    """The constant that `text`, at an offset, is; None if it is something else.

    Args:
        text: The text behind the equals sign.
        at: Its offset.
        joints: Whether it is of joints, which its variable's name says.
        joint_count: Joints of the arm: five leave the fourth slot empty, four the last two.
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
    five = joint_count == SLOTS - 1
    slots = [slot for slot in range(SLOTS) if slot != EMPTY_SLOT] if five else list(range(joint_count))
    if joint_count > SLOTS:
        return Constant(JOINTS, (), f"it has six slots, and the arm {joint_count} joints")
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
        if found is None or not isfinite(float(found.group(1) or 0.0)):
            return None
        if found.group(1) is None:
            numbers.append(ABSENT)
        else:
            first, last = (at + start + edge for edge in found.span(1))
            decimals = len(found.group(2) or found.group(3) or "")
            numbers.append(Number(first, last, float(found.group(1)), decimals))
        start += len(piece) + 1
    return numbers
