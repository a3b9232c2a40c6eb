"""The targets of RAPID text: declared ones, written-out ones, and those with constant offsets."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.programs.folding import constant
from truearm.programs.lexing import Reader, Token
from truearm.programs.listing import DIMENSIONS
from truearm.programs.rapid_data import TWICE, Declarations
from truearm.programs.rapid_values import (
    UNUSED_AXIS,
    Aggregate,
    Argument,
    Value,
    aggregate,
    arguments,
    pose_of,
)
from truearm.programs.source import Source
from truearm.programs.tables import ABSENT, Number, TargetTable
from truearm.rotations import matrix_from_euler
from truearm.types import Transform

OF_JOINTS, OF_POSES = 0, 1
PARTS: Final = {
    OF_JOINTS: (("robjoint", 6), ("extjoint", 6)),
    OF_POSES: (("pos", 3), ("orient", 4), ("confdata", 4), ("extjoint", 6)),
}
"""Types of a target's components, and how many numbers each has."""
SHARED: Final = frozenset({"confdata", "extjoint"})
"""Components that may be named data: they need not be changed for each target."""
TARGET_KINDS: Final = {"robtarget": OF_POSES, "jointtarget": OF_JOINTS}
OFFSETS: Final = frozenset({"offs", "reltool"})
NOT_HERE: Final = "it is not declared in this module"
OTHER_ROUTINE: Final = "it is declared in another routine alone"
COMPUTED: Final = "its target is computed at run time"
EXTERNAL: Final = "external axes"
DEEPEST: Final = 10


@dataclass(frozen=True, eq=False)
class Meant:
    """What a target argument means.

    Attributes:
        targets: Numbers of targets; several where an array is indexed at run time.
        before: Offset in the work object, (4, 4).
        after: Offset in the tool, (4, 4).
        problem: Why the offset is not known; empty if it is.
    """

    targets: tuple[int, ...]
    before: Transform
    after: Transform
    problem: str = ""


class RapidTargets:
    """Finds targets, and keeps each once.

    Attributes:
        numbers: Of declared targets, by name.
        shared: Data that components of targets are, by the target's number: their names by their types.
    """

    def __init__(self, declarations: Declarations, source: Source, table: TargetTable) -> None:
        self._declarations, self._source, self._table = declarations, source, table
        self.numbers: dict[str, int] = {}
        self.shared: dict[int, dict[str, str]] = {}

    def meant(self, found: Sequence[Token], depth: int = 0) -> Meant | str:
        """What the tokens of an argument mean, or why they are no target that is known."""
        if not found or depth > DEEPEST:
            return COMPUTED
        head = found[0].text.lower()
        if head == "[":
            return self._written(found)
        if _is_offset(found):
            return self._offset(head, arguments(found[2:-1]), depth)
        if len(found) > 1 and found[1].text != "{":
            return COMPUTED
        if not self._declarations.visible(head):
            return OTHER_ROUTINE
        return self._element(head, found[2:-1]) if len(found) > 1 else self._meant(self.stored(head))

    def doubt(self, targets: Sequence[int], *, heeded: bool) -> str:
        """Why targets with named components cannot be changed; empty if they can.

        Args:
            targets: Their numbers.
            heeded: Whether the controller may heed configuration data where they are gone to.
        """
        for target in targets:
            for kind, name in self.shared.get(target, {}).items():
                doubt = self._declarations.doubt(name)
                if doubt:
                    return f'"{name}" in it {doubt}'
                if kind == "confdata" and heeded:
                    return f'its configuration data is "{name}", as that of others may be, and is heeded'
        return ""

    @staticmethod
    def besides(found: Sequence[Token]) -> Sequence[Token]:
        """The tokens of an argument but for the name of the target that it goes to."""
        others: list[Token] = []
        for _ in range(DEEPEST):
            if not _is_offset(found):
                break
            inner = arguments(found[2:-1])[0].tokens
            others += found[2 + len(inner) : -1]
            found = inner
        if len(found) > 1 and found[1].text == "{":
            found = found[1:]
        return others if len(found) == 1 else [*found, *others]

    def stored(self, name: str) -> int | str:
        """The number of a declared target, or why it has none."""
        if name in self.numbers:
            return self.numbers[name]
        datum = self._declarations.data.get(name)
        if datum is None or datum.kind not in TARGET_KINDS:
            return NOT_HERE
        if datum.dimensions > 1:
            return DIMENSIONS
        if datum.value is None:
            return COMPUTED
        return self._add(datum.kind, datum.value, name)

    def _add(self, kind: str, value: Value, name: str) -> int | str:
        layout = TARGET_KINDS[kind]
        shared: dict[str, str] = {}
        numbers = self._numbers(layout, value, shared)
        if isinstance(numbers, str):
            return numbers
        at = value.at if isinstance(value, Aggregate) else numbers[0].start
        number = self._table.add(0, at, layout, numbers, name)
        if name:
            self.numbers[name] = number
        if shared:
            self.shared[number] = shared
        return number

    def _numbers(self, layout: int, value: Value, shared: dict[str, str]) -> list[Number] | str:
        """The numbers of a target in its layout, or why they are not known; named components in `shared`."""
        parts = self._parts(value, PARTS[layout], shared)
        if isinstance(parts, str):
            return parts
        if layout == OF_POSES and pose_of(value) is None:
            return "its quaternion is not of unit length"
        if any(number.value < UNUSED_AXIS for number in parts[-1]):
            return EXTERNAL
        if "confdata" in shared:
            parts[2] = [ABSENT] * 4
        return [number for part in parts[:-1] for number in part]

    def _parts(
        self, value: Value, parts: Sequence[tuple[str, int]], shared: dict[str, str]
    ) -> list[list[Number]] | str:
        """Lists of numbers of an aggregate of aggregates, or why it has none."""
        if not isinstance(value, Number | Aggregate) and [token.kind for token in value] == ["name"]:
            return f"it is a copy of {value[0].text}, without numbers of its own"
        if not isinstance(value, Aggregate) or len(value.values) != len(parts):
            return "it is not written out"
        found = []
        for part, (kind, count) in zip(value.values, parts, strict=True):
            numbers = part.numbers() if isinstance(part, Aggregate) else self._named(part, kind, shared)
            if numbers is None or len(numbers) != count:
                return "not all of its components are numbers"
            found.append(numbers)
        return found

    def _named(self, part: Value, kind: str, shared: dict[str, str]) -> list[Number] | None:
        """The numbers of a component that is the name of declared data; None if it is none."""
        if isinstance(part, Number | Aggregate) or len(part) != 1 or kind not in SHARED:
            return None
        name = part[0].text.lower()
        datum = self._declarations.data.get(name)
        if datum is None or datum.kind != kind or not self._declarations.visible(name):
            return None
        shared[kind] = name
        return datum.value.numbers() if isinstance(datum.value, Aggregate) else None

    def _written(self, found: Sequence[Token]) -> Meant | str:
        value = aggregate(Reader(self._source, list(found), found[-1].end))
        kind = "jointtarget" if len(value.values) == 2 else "robtarget"
        return self._meant(self._add(kind, value, ""))

    @staticmethod
    def _meant(*numbers: int | str) -> Meant | str:
        """Those of some targets that are known; if none is, why the first is not."""
        targets = tuple(number for number in numbers if not isinstance(number, str))
        why = next((number for number in numbers if isinstance(number, str)), NOT_HERE)
        return Meant(targets, np.eye(4), np.eye(4)) if targets else why

    def _element(self, name: str, index: Sequence[Token]) -> Meant | str:
        place, data = constant(index, self._declarations.numbers), self._declarations.data
        if place is None:
            keys = [key for key in data if key.startswith(f"{name}{{")]
        else:
            keys = [key for key in (f"{name}{{{place:.0f}}}",) if key in data]
        return self._meant(*(self.stored(key) for key in keys or [name]))

    def _offset(self, function: str, given: list[Argument], depth: int) -> Meant | str:
        inner = self.meant(given[0].tokens, depth + 1) if given else COMPUTED
        if isinstance(inner, str):
            return inner
        known = self._declarations.numbers
        parts = [constant(argument.tokens, known) for argument in given[1:4]]
        turns = {name: constant(tokens, known) for name, tokens in given[-1].options.items()}
        shift = [part for part in parts if part is not None]
        angles = {name: turn for name, turn in turns.items() if turn is not None}
        if len(shift) != 3 or len(given) != 4 or len(angles) < len(turns):
            return Meant(inner.targets, inner.before, inner.after, self._why_not(given[1:]))
        moved = np.eye(4)
        moved[:3, 3] = np.array(shift) * 1e-3
        if function == "offs":
            return Meant(inner.targets, moved @ inner.before, inner.after, inner.problem)
        order = [angles.get(name, 0.0) for name in ("rx", "ry", "rz")]
        moved[:3, :3] = matrix_from_euler(np.deg2rad(order), "XYZ")
        return Meant(inner.targets, inner.before, inner.after @ moved, inner.problem)

    def _why_not(self, given: Sequence[Argument]) -> str:
        """Why an offset is not known."""
        for argument in given:
            for token in (*argument.tokens, *(token for more in argument.options.values() for token in more)):
                if token.text.lower() in self._declarations.twice:
                    return f'"{token.text}" in its offset {TWICE}'
        return "its offset is computed at run time"


def _is_offset(found: Sequence[Token]) -> bool:
    return len(found) > 2 and found[0].text.lower() in OFFSETS and found[1].text == "("
