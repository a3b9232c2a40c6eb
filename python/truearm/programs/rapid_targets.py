"""The targets of RAPID text: declared ones, written-out ones, and those with constant offsets."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.programs.environment import Transform
from truearm.programs.folding import constant
from truearm.programs.lexing import Reader, Token
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
from truearm.programs.tables import Number, TargetTable
from truearm.rotations import matrix_from_euler

OF_JOINTS, OF_POSES = 0, 1
TARGET_KINDS: Final = {"robtarget": OF_POSES, "jointtarget": OF_JOINTS}
OFFSETS: Final = frozenset({"offs", "reltool"})
NOT_HERE: Final = "it is not declared in this module"
OTHER_ROUTINE: Final = "it is declared in another routine alone"
COMPUTED: Final = "its target is computed at run time"
DIMENSIONS: Final = "arrays of more dimensions than one are not read"
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
    """Finds targets, and keeps each once."""

    def __init__(self, declarations: Declarations, source: Source, table: TargetTable) -> None:
        self._declarations, self._source, self._table = declarations, source, table
        self.numbers: dict[str, int] = {}

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
        numbers = _of_joints(value) if layout == OF_JOINTS else _of_pose(value)
        if isinstance(numbers, str):
            return numbers
        at = value.at if isinstance(value, Aggregate) else numbers[0].start
        number = self._table.add(0, at, layout, numbers, name)
        if name:
            self.numbers[name] = number
        return number

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
        place = constant(index, self._declarations.numbers)
        if place is not None:
            return self._meant(self.stored(f"{name}{{{place:.0f}}}"))
        keys = [key for key in self._declarations.data if key.startswith(f"{name}{{")]
        return self._meant(*(self.stored(key) for key in keys))

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


def _parts(value: Value, counts: tuple[int, ...]) -> list[list[Number]] | str:
    """Lists of numbers of an aggregate of aggregates, or why it has none."""
    if not isinstance(value, Number | Aggregate) and [token.kind for token in value] == ["name"]:
        return f"it is a copy of {value[0].text}, without numbers of its own"
    if not isinstance(value, Aggregate) or len(value.values) != len(counts):
        return "it is not written out"
    found = []
    for part, count in zip(value.values, counts, strict=True):
        numbers = part.numbers() if isinstance(part, Aggregate) else None
        if numbers is None or len(numbers) != count:
            return "not all of its components are numbers"
        found.append(numbers)
    return found


def _of_joints(value: Value) -> list[Number] | str:
    found = _parts(value, (6, 6))
    if isinstance(found, str):
        return found
    return EXTERNAL if any(number.value < UNUSED_AXIS for number in found[1]) else found[0]


def _of_pose(value: Value) -> list[Number] | str:
    found = _parts(value, (3, 4, 4, 6))
    if isinstance(found, str):
        return found
    if pose_of(value) is None:
        return "its quaternion is not of unit length"
    if any(number.value < UNUSED_AXIS for number in found[3]):
        return EXTERNAL
    return [*found[0], *found[1], *found[2]]
