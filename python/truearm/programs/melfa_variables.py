"""The position and joint variables of a MELFA BASIC program: what they hold, and what is done to them."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from truearm.programs.layouts import EulerPose
from truearm.programs.melfa_text import (
    NAME,
    POSE,
    SLOTS,
    Assignment,
    Constant,
    Move,
    Statement,
    array_of,
    assignment,
    constant,
    name_of,
)
from truearm.programs.source import Source
from truearm.types import Transform

FLAGS: Final = 2
FLAGGED: Final = EulerPose(columns=(2, 1, 0), configuration=FLAGS)
SETTING: Final = re.compile(
    r"\s*(Tool|Base|Cnt)\b\s*(.*?)\s*\Z|\s*M_Tool\s*(?:\([^)]*\))?\s*=\s*(.*?)\s*\Z", re.IGNORECASE
)
COMBINED: Final = re.compile(
    rf"\s*({NAME})\s*([*/+-])\s*({NAME}|\([^()]*\)\s*(?:\([^()]*\))?)\s*\Z", re.IGNORECASE
)
_DECLARED: Final = re.compile(r"\s*(?:Def\s+(Pos|Jnt)|Dim)\b(.*)", re.IGNORECASE)
_READING: Final = re.compile(
    r"\s*(If|ElseIf|While|Wait|Select|Case|For|Print|On|Def|Tool|Base|M_Tool)\b", re.IGNORECASE
)
"""Statements that do not change what they name."""
_NAMES: Final = re.compile(rf"(?<![\w.]){NAME}(\.\w+)?")


@dataclass
class Variable:
    """What a program says of a variable.

    Attributes:
        constants: Its constants, and the offsets of their assignments.
        why_not: Why it cannot be changed, as other things than motions use it.
        changed: Whether it may hold something else than its constant when the program runs.
    """

    constants: list[tuple[int, Constant]] = field(default_factory=list)
    why_not: str = ""
    changed: bool = False


class Variables:
    """The variables of a program; names are as name_of has them.

    Args:
        source: The program.
        program: Its statements.
        motions: Those of a statement, by its place.
        joint_count: Joints of the arm.

    Attributes:
        offsets: Variables that are tools, bases, or offsets of targets.
    """

    def __init__(
        self,
        source: Source,
        program: Sequence[Statement],
        motions: Mapping[int, Sequence[Move]],
        joint_count: int,
    ) -> None:
        self._source, self._joint_count = source, joint_count
        self._all: dict[str, Variable] = {}
        self._joints, self._positions = set[str](), set[str]()
        self.offsets = _offsets(program, motions)
        for statement in program:
            declared = _DECLARED.match(statement.text)
            if declared is not None and declared.group(1):
                chosen = self._joints if declared.group(1).casefold() == "jnt" else self._positions
                chosen |= {array_of(name_of(name)) for name in declared.group(2).split(",")}
        for place, statement in enumerate(program):
            if _DECLARED.match(statement.text) is None:
                self._read(statement, motions.get(place, ()))

    def targets(self) -> list[tuple[str, Variable]]:
        """Variables that are assigned a constant somewhere, and are no tools, bases or offsets."""
        return [(name, one) for name, one in self._all.items() if one.constants and name not in self.offsets]

    def why_not(self, name: str) -> str:
        """Why a variable cannot be changed whatever uses it; empty if it can."""
        return self._all[name].why_not or self._array(name).why_not

    def holds_its_constant(self, name: str) -> bool:
        """Whether a variable has one constant, and holds nothing else when the program runs."""
        variable = self._all[name]
        return len(variable.constants) == 1 and not variable.changed and not self._array(name).changed

    def named(self, text: str) -> Iterator[str]:
        """Position and joint variables in a text: those, and arrays of which any element may be meant."""
        for found in _NAMES.finditer(text):
            name = name_of(found.group()).partition(".")[0]
            if self._is_joints(array_of(name)) or self._is_position(array_of(name)):
                yield name

    def transform(self, given: str) -> Transform | None:
        """The transform of a constant, or of a variable that is one; None if it is not constant."""
        held = constant(given, 0, joints=False, joint_count=SLOTS)
        if held is None and name_of(given) in self._all:
            held = self._one_constant(name_of(given))
        values = held.numbers[:SLOTS] if held is not None and held.layout == POSE else ()
        if len(values) < SLOTS:
            return None
        return np.asarray(FLAGGED.to_poses(np.array([[number.value for number in values]]))[0])

    def _one_constant(self, name: str) -> Constant | None:
        """What a variable holds wherever it is assigned; None if that is not one constant.

        A program that was saved has the values of its variables behind its lines, those too that it assigns.
        """
        variable = self._all[name]
        if variable.changed or self._array(name).changed:
            return None
        held = {(one.layout, *(number.value for number in one.numbers)): one for _, one in variable.constants}
        return next(iter(held.values())) if len(held) == 1 else None

    def _array(self, name: str) -> Variable:
        """What is done to any element of the array that an element is of."""
        return self._all.get(array_of(name), _UNTOUCHED) if "(" in name else _UNTOUCHED

    def _is_joints(self, plain: str) -> bool:
        return plain in self._joints or (plain.startswith("j") and plain not in self._positions)

    def _is_position(self, plain: str) -> bool:
        return plain in self._positions or plain.startswith("p")

    def _read(self, statement: Statement, motions: Sequence[Move]) -> None:
        for motion in motions:
            self._use(statement, motion.added, changes=True)
        if motions:
            self._use(statement, statement.text[: motions[0].at - statement.at], changes=True)
        elif (assigned := assignment(statement)) is not None:
            self._assign(statement, assigned)
        else:
            self._use(statement, statement.text, changes=_READING.match(statement.text) is None)

    def _assign(self, statement: Statement, assigned: Assignment) -> None:
        name = name_of(assigned.name)
        plain = array_of(name)
        if not (self._is_joints(plain) or self._is_position(plain)):
            self._use(statement, statement.text, changes=False)
            return
        if not assigned.whole:
            self._use(statement, statement.text, changes=False)
            for touched in self.named(assigned.name):
                self._all.setdefault(touched, Variable()).changed = True
            return
        variable = self._all.setdefault(name, Variable())
        held = constant(
            assigned.text, assigned.at, joints=self._is_joints(plain), joint_count=self._joint_count
        )
        if held is None:
            line = self._source.place(statement.at)[0]
            variable.changed = True
            variable.why_not = variable.why_not or f"it is computed in line {line} when the program runs"
            self._use(statement, assigned.text, changes=False)
            return
        if variable.constants:
            variable.why_not = variable.why_not or "it is assigned more than once"
        blanks = len(statement.text) - len(statement.text.lstrip())
        variable.constants.append((statement.at + blanks, held))

    def _use(self, statement: Statement, text: str, *, changes: bool) -> None:
        """Variables in `text` are used for something else than a motion."""
        for name in self.named(text):
            variable = self._all.setdefault(name, Variable())
            line = self._source.place(statement.at)[0]
            reason = f"it is also used in line {line} for something else than a motion"
            variable.why_not = variable.why_not or reason
            variable.changed |= changes


_UNTOUCHED: Final = Variable()


def _offsets(program: Sequence[Statement], motions: Mapping[int, Sequence[Move]]) -> set[str]:
    found = [m.group(2) or "" for one in program if (m := SETTING.match(one.text)) is not None]
    pieces = [piece for some in motions.values() for motion in some for piece in motion.pieces]
    found += [m.group(3) for piece in pieces if (m := COMBINED.match(piece)) is not None]
    return {name_of(text) for text in found}
