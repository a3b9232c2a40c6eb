"""Values in KRL text: structures in braces, and frames joined by the geometric operator."""

import re
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.programs.lexing import NUMBER, Reader, Token, tokens
from truearm.programs.source import Source
from truearm.programs.tables import ABSENT, Number
from truearm.rotations import matrix_from_euler
from truearm.types import Transform

TOKENS: Final = re.compile(
    rf'(?P<string>"[^"\r\n]*"?)|(?P<bits>\'[BbHh][0-9A-Fa-f]+\')|(?P<name>[A-Za-z_$][\w$]*)|(?P<number>{NUMBER})|;[^\r\n]*'
    r"|(?P<mark>==|<>|<=|>=|[^\s])"
)
POSE: Final = ("x", "y", "z", "a", "b", "c")
AXES: Final = ("a1", "a2", "a3", "a4", "a5", "a6")
STATE: Final = ("s", "t")
EXTERNAL: Final = ("e1", "e2", "e3", "e4", "e5", "e6")


@dataclass(frozen=True)
class Structure:
    """A structure in braces.

    Attributes:
        at: Offset of its opening brace.
        end: Offset behind its closing one.
        numbers: Components that are numbers, by name in small letters.
        others: Components that are something else, such as variables or sums.
    """

    at: int
    end: int
    numbers: dict[str, Number]
    others: frozenset[str]

    @property
    def is_axes(self) -> bool:
        """Whether it holds axis values."""
        return bool(set(AXES) & (self.numbers.keys() | self.others))

    def problem(self) -> str:
        """Why it is no target that can be changed; empty if it is one."""
        wanted = AXES if self.is_axes else POSE
        computed = self.others & {*wanted, *STATE, *EXTERNAL}
        if computed:
            return f"{', '.join(sorted(computed)).upper()} is computed at run time"
        missing = [name for name in wanted if name not in self.numbers]
        if missing:
            return f"{', '.join(missing).upper()} is omitted and keeps what it was"
        if any(self.numbers[name].value != 0.0 for name in EXTERNAL if name in self.numbers):
            return "external axes"
        return ""

    def target(self) -> list[Number]:
        """The numbers of a target: six axes, or X Y Z A B C S T."""
        if self.is_axes:
            return [self.numbers[name] for name in AXES]
        return [self.numbers.get(name, ABSENT) for name in (*POSE, *STATE)]

    def transform(self) -> Transform | None:
        """The frame, (4, 4) in m; None where not all of it is said."""
        if self.others or not all(name in self.numbers for name in POSE):
            return None
        x, y, z, a, b, c = (self.numbers[name].value for name in POSE)
        frame = np.eye(4)
        frame[:3, :3] = matrix_from_euler(np.deg2rad([a, b, c]), "ZYX")
        frame[:3, 3] = np.array([x, y, z]) * 1e-3
        return frame


@dataclass(frozen=True)
class Named:
    """A variable, with the index of an array's element where it has one.

    Attributes:
        name: In small letters, such as "xp1" or "base_data".
        index: The index; None where there is none, and "?" where it is computed, or they are several.
        at: Offset.
        several: Whether the indices are several, the first of them a number.
    """

    name: str
    index: int | str | None
    at: int
    several: bool = False

    @property
    def key(self) -> str:
        """Name and index as one text."""
        return self.name if self.index is None else f"{self.name}[{self.index}]"


Operand = Structure | Named
Operands = list[Operand]


def line_reader(source: Source, start: int, end: int) -> Reader:
    """The tokens of a line, without its comment."""
    return Reader(source, list(tokens(source.text, TOKENS, start, end)), end)


def structure(reader: Reader) -> Structure:
    """The structure that is next.

    Raises:
        InputError: If it is not closed.
    """
    at = reader.expect("{").start
    numbers: dict[str, Number] = {}
    others: set[str] = set()
    if reader.kind() == "name" and reader.peek(1) == ":":
        reader.take()
        reader.take()
    while reader.peek() != "}":
        name = reader.take()
        if reader.peek() == "[":
            _skip_to(reader, "]")
            reader.expect("]")
        number = _number(reader) if name.kind == "name" else None
        if number is not None and reader.peek() in {",", "}"}:
            numbers[name.text.lower()] = number
        else:
            others.add(name.text.lower())
            _skip_component(reader)
        reader.accept(",")
    return Structure(at, reader.expect("}").end, numbers, frozenset(others - numbers.keys()))


def operands(reader: Reader) -> Operands | None:
    """Operands joined by the geometric operator; None where there is something else among them."""
    found: Operands = []
    while True:
        operand = _operand(reader)
        if operand is None:
            return None
        found.append(operand)
        if not reader.accept(":"):
            return found


def named(reader: Reader) -> Named | None:
    """The variable that is next, if one is."""
    if reader.kind() != "name":
        return None
    name = reader.take()
    if reader.peek() != "[":
        return Named(name.text.lower(), None, name.start)
    reader.expect("[")
    index: int | str = "?"
    several = reader.kind() == "number" and reader.peek(1) == ","
    if reader.kind() == "number" and reader.peek(1) == "]":
        value = float(reader.take().text)
        index = int(value) if value.is_integer() else "?"
    _skip_to(reader, "]")
    reader.expect("]")
    return Named(name.text.lower(), index, name.start, several)


def names_in(found: list[Token]) -> set[str]:
    """All names among tokens, in small letters."""
    return {token.text.lower() for token in found if token.kind == "name"}


def _operand(reader: Reader) -> Operand | None:
    if reader.peek() == "{":
        return structure(reader)
    found = named(reader)
    if found is None or reader.peek() in {"(", ".", "+", "-", "*", "/"}:
        return None
    return found


def _number(reader: Reader) -> Number | None:
    """A number that is next, those written as bits or in hexadecimal digits included."""
    if reader.kind() != "bits":
        return reader.signed_number()
    token = reader.take()
    base = 2 if token.text[1] in "Bb" else 16
    try:
        return Number(token.start, token.end, float(int(token.text[2:-1], base)), 0)
    except ValueError:
        reader.fail(f"{token.text} is no number")
    except OverflowError:
        reader.fail(f"{token.text} is too large for a number")


def _skip_to(reader: Reader, text: str) -> None:
    while reader.peek() != text:
        reader.take()


def _skip_component(reader: Reader) -> None:
    """Go on to the end of a component whose value is no number."""
    depth = 0
    while depth > 0 or reader.peek() not in {",", "}"}:
        text = reader.take().text
        depth += (text in "({[") - (text in ")}]")
