"""Values in RAPID text: aggregates in brackets, and the arguments of instructions."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.programs.lexing import NUMBER, Reader, Token, tokens
from truearm.programs.source import Source
from truearm.programs.tables import Number
from truearm.rotations import UNIT_TOLERANCE, transform_from_parts
from truearm.types import Transform

TOKENS: Final = re.compile(
    rf'(?P<string>"[^"\r\n]*"?)|(?P<name>[A-Za-z]\w*)|(?P<number>{NUMBER})|![^\r\n]*'
    r"|(?P<mark>:=|<>|<=|>=|[^\s])"
)
ENDS: Final = re.compile(r'"[^"\r\n]*"?|![^\r\n]*|(?P<end>;)')
UNUSED_AXIS: Final = 8.9e9
DEEPEST: Final = 20
OPERATORS: Final = frozenset({"and", "or", "xor", "not", "div", "mod"})
CLOSING: Final = frozenset({")", "]", "}"})


@dataclass(frozen=True)
class Aggregate:
    """Values in brackets.

    Attributes:
        at: Offset of the opening bracket.
        end: Offset behind the closing one.
        values: Numbers, aggregates, and lists of tokens of what is neither.
    """

    at: int
    end: int
    values: tuple["Value", ...]

    def numbers(self) -> list[Number] | None:
        """All its values, if they are numbers."""
        found = [value for value in self.values if isinstance(value, Number)]
        return found if len(found) == len(self.values) else None


Value = Number | Aggregate | tuple[Token, ...]


@dataclass(frozen=True)
class Argument:
    """One argument of an instruction.

    Attributes:
        tokens: The argument itself; empty where only optional ones are given.
        options: Optional arguments behind it, by name in small letters; no tokens for a switch.
    """

    tokens: tuple[Token, ...]
    options: dict[str, tuple[Token, ...]]


def statements(source: Source) -> Iterator[tuple[int, int]]:
    """Where each statement begins, and the offset behind its semicolon."""
    text, start = source.text, source.first
    for found in ENDS.finditer(text, start):
        if found.lastgroup == "end":
            yield start, found.end()
            start = found.end()
    yield start, len(text)


def statement_reader(source: Source, start: int, end: int) -> Reader:
    """The tokens of a statement, its semicolon left out."""
    found = list(tokens(source.text, TOKENS, start, end))
    if found and found[-1].text == ";":
        found.pop()
    return Reader(source, found, end)


def aggregate(reader: Reader, depth: int = 0) -> Aggregate:
    """The aggregate that is next.

    Raises:
        InputError: If it is not closed.
    """
    at = reader.expect("[").start
    if depth > DEEPEST:
        reader.fail(f"brackets are nested more than {DEEPEST} deep")
    values: list[Value] = []
    while reader.peek() != "]":
        values.append(_value(reader, depth))
        if not reader.accept(","):
            break
    return Aggregate(at, reader.expect("]").end, tuple(values))


def arguments(found: Sequence[Token]) -> list[Argument]:
    r"""The arguments of an instruction, split at commas that stand in no bracket.

    A comma before optional ones means nothing: tG,\WObj:=wT is tG\WObj:=wT.
    """
    given: list[Argument] = []
    for argument in map(_argument, split(found, ",")):
        if given and not argument.tokens:
            given[-1].options.update(argument.options)
        else:
            given.append(argument)
    return given


def split(found: Sequence[Token], *marks: str) -> list[tuple[Token, ...]]:
    """The parts between marks that stand in no bracket."""
    parts: list[list[Token]] = [[]]
    level = 0
    for token in found:
        level += (token.text in "([{") - (token.text in ")]}")
        if level == 0 and token.text in marks:
            parts.append([])
        else:
            parts[-1].append(token)
    return [tuple(part) for part in parts]


def instruction_place(found: Sequence[Token]) -> int:
    """Where the instruction begins behind IF and its condition: where no operator joins it to an operand."""
    for place in range(2, len(found)):
        before, token = found[place - 1], found[place]
        operand = before.kind in {"number", "string"} or before.text in CLOSING or _is_operand(before)
        if operand and (token.text == "%" or _is_operand(token)):
            return place
    return len(found)


def place_of(value: Value) -> int | None:
    """Offset of the first character of a value; None of an empty one."""
    if isinstance(value, Aggregate):
        return value.at
    if isinstance(value, Number):
        return value.start
    return value[0].start if value else None


def same_value(one: Value | None, other: Value | None) -> bool:
    """Whether two values are written alike; names in them are taken for what they are called."""
    if isinstance(one, Aggregate) and isinstance(other, Aggregate):
        pairs = zip(one.values, other.values, strict=False)
        return len(one.values) == len(other.values) and all(same_value(*pair) for pair in pairs)
    if isinstance(one, Number) and isinstance(other, Number):
        return one.value == other.value
    texts = [
        None if isinstance(value, Number | Aggregate) else [token.text.lower() for token in value or ()]
        for value in (one, other)
    ]
    return texts[0] is not None and texts[0] == texts[1]


def pose_of(value: Value | None) -> tuple[list[Number], Transform] | None:
    """Seven numbers of a pose [[x,y,z],[q1,q2,q3,q4]] and the pose (4, 4), m; None if it is none."""
    if not isinstance(value, Aggregate) or len(value.values) < 2:
        return None
    parts = [part.numbers() for part in value.values[:2] if isinstance(part, Aggregate)]
    if len(parts) != 2 or parts[0] is None or parts[1] is None or (len(parts[0]), len(parts[1])) != (3, 4):
        return None
    quaternion = np.array([number.value for number in parts[1]])
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1.0) > UNIT_TOLERANCE:
        return None
    place = np.array([number.value for number in parts[0]]) * 1e-3
    return [*parts[0], *parts[1]], transform_from_parts(place, quaternion / length)


def truth(value: Value | None) -> bool | None:
    """TRUE or FALSE; None if it is neither."""
    if not isinstance(value, tuple) or isinstance(value, Number) or len(value) != 1:
        return None
    return {"true": True, "false": False}.get(value[0].text.lower())


def _value(reader: Reader, depth: int) -> Value:
    if reader.peek() == "[":
        return aggregate(reader, depth + 1)
    number = reader.signed_number()
    if number is not None and reader.peek() in {",", "]"}:
        return number
    others: list[Token] = []
    level = 0
    while level > 0 or reader.peek() not in {",", "]"}:
        token = reader.take()
        level += (token.text in "([{") - (token.text in ")]}")
        others.append(token)
    return tuple(others)


def _is_operand(token: Token) -> bool:
    return token.kind == "name" and token.text.lower() not in OPERATORS


def _argument(part: Sequence[Token]) -> Argument:
    main, *rest = split(part, "\\")
    options = {}
    for option in rest:
        if option:
            given = option[2:] if len(option) > 1 and option[1].text == ":=" else option[1:]
            options[option[0].text.lower()] = tuple(given)
    return Argument(main, options)
