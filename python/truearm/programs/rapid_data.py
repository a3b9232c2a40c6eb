"""Data that a RAPID module declares: targets, tools, work objects, numbers; and what is assigned to."""

import re
from dataclasses import dataclass, field
from typing import Final

from truearm.programs.folding import constant
from truearm.programs.lexing import Reader, Token
from truearm.programs.rapid_values import Aggregate, Value, aggregate, statement_reader, statements
from truearm.programs.source import Source

DECLARING: Final = re.compile(r"\b(?:const|pers|var)\s+\w+\s+\w", re.IGNORECASE)
ASSIGNING: Final = re.compile(r"(?<![\\\w])([A-Za-z]\w*)(?:\s*\{[^}]*\}|\.\w+)*\s*:=")
MOVING: Final = re.compile(r"\s*Move[A-Z]")
KINDS: Final = frozenset({"robtarget", "jointtarget", "tooldata", "wobjdata", "loaddata", "pose", "num"})


@dataclass(frozen=True)
class Datum:
    """A declared value.

    Attributes:
        kind: Its type, in small letters.
        value: What it is; None where it has no value or one that is computed.
        fixed: Whether it is a constant.
    """

    kind: str
    value: Value | None
    fixed: bool


@dataclass
class Declarations:
    """What the modules declare.

    Attributes:
        data: Values by name in small letters; an element of an array as "name{3}".
        kinds: Types by name, arrays included.
        twice: Names that are declared more than once.
        assigned: Names that are assigned to.
        numbers: Values of constant numbers.
    """

    data: dict[str, Datum] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    twice: set[str] = field(default_factory=set)
    assigned: set[str] = field(default_factory=set)
    numbers: dict[str, float] = field(default_factory=dict)

    def gather(self, source: Source) -> None:
        """Take what a module declares.

        Raises:
            InputError: If an aggregate is not closed; names line and column.
        """
        for start, end in statements(source.text):
            if DECLARING.search(source.text, start, end):
                if self._declare(statement_reader(source, start, end)):
                    continue
            elif MOVING.match(source.text, start, end):
                continue
            reader = statement_reader(source, start, end)
            self.assigned |= _assigned(reader.rest())

    def changes(self, name: str) -> bool:
        """Whether what is known of a name may not hold at run time."""
        return name in self.assigned or name in self.twice

    def _declare(self, reader: Reader) -> bool:
        while not reader.done and reader.peek() not in {"const", "pers", "var"}:
            reader.take()
        if reader.done:
            return False
        fixed = reader.take().text.lower() == "const"
        kind, name = reader.take().text.lower(), reader.take().text.lower()
        if kind not in KINDS:
            return True
        if name in self.kinds:
            self.twice.add(name)
        self.kinds[name] = kind
        array = reader.accept("{")
        while array and not reader.accept("}"):
            reader.take()
        value = self._value(reader) if reader.accept(":=") else None
        self._keep(name, kind, value, fixed=fixed, array=array)
        return True

    def _value(self, reader: Reader) -> Value | None:
        if reader.peek() == "[":
            return aggregate(reader)
        return tuple(reader.rest())

    def _keep(self, name: str, kind: str, value: Value | None, *, fixed: bool, array: bool) -> None:
        if array and isinstance(value, Aggregate):
            for index, element in enumerate(value.values, start=1):
                self.data[f"{name}{{{index}}}"] = Datum(kind, element, fixed)
            return
        self.data[name] = Datum(kind, value, fixed)
        if kind == "num" and fixed and isinstance(value, tuple) and not isinstance(value, Aggregate):
            found = constant([token for token in value if isinstance(token, Token)], self.numbers)
            if found is not None:
                self.numbers[name] = found


def _assigned(found: list[Token]) -> set[str]:
    """Names on the left of := that are no optional arguments."""
    names = set()
    for place, token in enumerate(found):
        if token.text != ":=":
            continue
        first = place - 1
        while (first > 0 and found[first].text in "}.{") or (first > 0 and found[first - 1].text in ".{"):
            first -= 1
        if found[first].kind == "name" and (first == 0 or found[first - 1].text != "\\"):
            names.add(found[first].text.lower())
    return names
