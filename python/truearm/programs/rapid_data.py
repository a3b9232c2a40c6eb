"""Data that a RAPID module declares: targets, tools, work objects, numbers; and what is assigned to."""

import re
from collections import ChainMap
from collections.abc import Mapping, Set
from dataclasses import dataclass, field, replace
from typing import Final

from truearm.programs.folding import constant
from truearm.programs.lexing import Reader, Token
from truearm.programs.rapid_routines import ENDINGS, Routine, begun, changed
from truearm.programs.rapid_values import (
    Aggregate,
    Value,
    aggregate,
    same_value,
    statement_reader,
    statements,
)
from truearm.programs.source import Source

MOVING: Final = re.compile(r"\s*Move[A-Z]\w*\b(?!\s*(?::=|[.{]))")
STORAGE: Final = frozenset({"const", "pers", "var"})
TARGETS: Final = frozenset({"robtarget", "jointtarget"})
KINDS: Final = TARGETS | {"tooldata", "wobjdata", "loaddata", "pose", "num", "confdata", "extjoint"}
TWICE: Final = "is declared more than once"
MODULE: Final = ""
ROUNDS: Final = 20


@dataclass(frozen=True)
class Datum:
    """A declared value.

    Attributes:
        kind: Its type, in small letters.
        value: What it is; None where it has no value or one that is computed.
        fixed: Whether it is a constant.
        dimensions: Of the array that it is an element or a part of; 0 for what is in none.
    """

    kind: str
    value: Value | None
    fixed: bool
    dimensions: int = 0


@dataclass
class _Declared:
    """All declarations of one name: its values, None for a parameter or a loop's variable, and where."""

    values: list[Datum | None] = field(default_factory=list)
    routines: set[str] = field(default_factory=set)


class Declarations:
    """What a module declares.

    Attributes:
        data: Values by name in small letters; an element of an array as "name{3}".
        twice: Names that are declared more than once, and not as one constant.
        assigned: Names that are assigned to.
        numbers: Values of the constant numbers that are known in the routine that is being read.
        routines: The routines, by name in small letters.
    """

    def __init__(self) -> None:
        self.data: dict[str, Datum] = {}
        self._kinds: dict[str, str] = {}
        self.twice: Set[str] = frozenset()
        self.assigned: set[str] = set()
        self.numbers: Mapping[str, float] = {}
        self.routines: dict[str, Routine] = {}
        self._declared: dict[str, _Declared] = {}
        self._known: dict[str, dict[str, float]] = {MODULE: {}}
        self._given: Set[str] = frozenset()
        self._routine = MODULE

    def gather(self, source: Source) -> None:
        """Take what a module declares.

        Raises:
            InputError: If an aggregate is not closed; names line and column.
        """
        for start, end in statements(source):
            if not MOVING.match(source.text, start, end):
                self._statement(statement_reader(source, start, end))
        known = self._evaluate()
        self.twice = frozenset(n for n in self._declared if n not in known and self._is_doubtful(n))
        self.enter(MODULE)

    def enter(self, routine: str) -> None:
        """What follows stands in a routine, or in none: names of other routines mean nothing there."""
        self._routine = routine
        self.numbers = ChainMap(self._known.get(routine, {}), self._known[MODULE])

    def visible(self, name: str) -> bool:
        """Whether a name is not one that other routines alone declare."""
        declared = self._declared.get(name)
        return declared is None or not declared.routines.isdisjoint({MODULE, self._routine})

    def give(self, gifts: Set[tuple[str, str]]) -> None:
        """Names are given to instructions, routines and functions: tuples of one of these and a name."""
        self._given = changed(gifts, self.routines, self.assigned)

    def doubt(self, name: str) -> str:
        """Why what is known of a name may not hold at run time, in words behind it; empty if it does."""
        if name in self.twice:
            return TWICE
        if name in self.assigned:
            return "is changed at run time"
        if name in self._given:
            return "is given to an instruction or routine that may change it"
        return ""

    def _statement(self, reader: Reader) -> None:
        """What a statement declares, and what it assigns to; headers of routines stand before it."""
        others: list[Token] = []
        while not reader.done:
            routine = begun(reader)
            if routine is not None:
                self._begin(routine)
            elif reader.peek() in STORAGE and reader.kind(1) == reader.kind(2) == "name":
                self._declare(reader)
                break
            else:
                if reader.peek() in ENDINGS:
                    self._routine = MODULE
                elif reader.peek() == "for" and reader.kind(1) == "name":
                    self._note(reader.peek(1), None)
                others.append(reader.take())
        self.assigned |= _assigned(others)

    def _begin(self, routine: Routine) -> None:
        self._routine = routine.name
        self.routines[routine.name] = routine
        for name in routine.parameters:
            self._note(name, None)

    def _note(self, name: str, datum: Datum | None) -> None:
        declared = self._declared.setdefault(name, _Declared())
        declared.values.append(datum)
        declared.routines.add(self._routine)

    def _declare(self, reader: Reader) -> None:
        fixed = reader.take().text.lower() == "const"
        kind, name = reader.take().text.lower(), reader.take().text.lower()
        dimensions = int(reader.accept("{"))
        while dimensions and not reader.accept("}"):
            dimensions += reader.take().text == ","
        known = kind in KINDS and reader.accept(":=")
        datum = Datum(kind, self._value(reader) if known else None, fixed, dimensions)
        self._note(name, datum)
        if kind in TARGETS or (kind in KINDS and self._kinds.get(name) not in TARGETS):
            self._kinds[name] = kind
            self._keep(name, datum)

    def _value(self, reader: Reader) -> Value:
        if reader.peek() == "[":
            return aggregate(reader)
        return tuple(reader.rest())

    def _keep(self, name: str, datum: Datum) -> None:
        if datum.dimensions and isinstance(datum.value, Aggregate):
            for index, element in enumerate(datum.value.values, start=1):
                self.data[f"{name}{{{index}}}"] = replace(datum, value=element)
            return
        self.data[name] = datum

    def _evaluate(self) -> Mapping[str, float]:
        """The values of constant numbers: of those whose declarations all have the same one."""
        found: dict[str, float] = {}
        pending = [name for name, declared in self._declared.items() if all(map(_is_number, declared.values))]
        for _ in range(ROUNDS):
            for name in pending:
                value = self._number(self._declared[name], found)
                if value is not None:
                    found[name] = value
            left = [name for name in pending if name not in found]
            if len(left) == len(pending):
                break
            pending = left
        for name, value in found.items():
            for routine in self._declared[name].routines:
                self._known.setdefault(routine, {})[name] = value
        return found

    def _number(self, declared: _Declared, known: Mapping[str, float]) -> float | None:
        """The one value of all declarations of a number; None where they have not the same."""
        values = set()
        for datum in declared.values:
            value = datum.value if datum is not None and isinstance(datum.value, tuple) else ()
            words = [token for token in value if isinstance(token, Token)]
            seen = all(self._sees(declared, token.text.lower()) for token in words if token.kind == "name")
            values.add(constant(words, known) if seen else None)
        return values.pop() if len(values) == 1 else None

    def _sees(self, declared: _Declared, name: str) -> bool:
        """Whether a name means the same wherever another one is declared."""
        other = self._declared.get(name)
        return other is None or MODULE in other.routines or declared.routines <= other.routines

    def _is_doubtful(self, name: str) -> bool:
        """Whether declarations of a name differ; a target has a place in the text, and can be only one."""
        first, *others = self._declared[name].values
        if not others:
            return False
        if first is None or first.kind in TARGETS or not first.fixed:
            return True
        return any(
            other is None
            or (other.kind, other.fixed) != (first.kind, True)
            or not same_value(first.value, other.value)
            for other in others
        )


def _is_number(datum: Datum | None) -> bool:
    return datum is not None and datum.kind == "num" and datum.fixed


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
