"""What is constant in a URScript program: variables where they are used, arithmetic, and poses of poses.

A variable that is assigned several times has one value at each place of a function, if all assignments are
in that function, outside its branches and loops, to one variable of that name, and nothing else runs it
meanwhile.
"""

import math
import operator
from bisect import bisect_right
from collections.abc import Callable, Set
from typing import Final, NamedTuple

import numpy as np

from truearm.programs.layouts import RotationVectorPose
from truearm.programs.urscript_scopes import Scopes
from truearm.programs.urscript_syntax import Node, arguments
from truearm.rotations import rigid_inverse
from truearm.types import Transform

AXES: Final = 6
_POSE: Final = RotationVectorPose()
_DEEPEST: Final = 60
_ARITHMETIC: Final[dict[str, Callable[[float, float], float]]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
_FUNCTIONS: Final[dict[str, Callable[[float], float]]] = {
    "d2r": math.radians,
    "r2d": math.degrees,
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
}


class RunTime(Exception):  # noqa: N818 - nothing is wrong: the target is listed
    """What cannot be known before the program runs.

    Attributes:
        reason: Why, in words that end a line.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class _Assigned(NamedTuple):
    """An assignment.

    Attributes:
        value: What is assigned.
        function: Function whose every run takes it, as in Scopes; None if none does.
        scope: The word before it, global or local; empty if there is none.
    """

    value: Node
    function: int | None
    scope: str


class Constants:
    """Variables by name: what each is assigned, or why it is not constant.

    What an expression stands for is kept by its place, as variables may be made of one another many times.
    """

    def __init__(self) -> None:
        self._assigned: dict[str, list[_Assigned]] = {}
        self._again: dict[str, int] = {}
        self._why_not: dict[str, str] = {}
        self._scopes = Scopes()
        self._alone: Set[int | None] = frozenset()
        self._assigning: dict[str, int | None] = {}
        self._literals: dict[tuple[int, int], Node] = {}
        self._numbers: dict[tuple[int, int], float] = {}
        self._transforms: dict[tuple[int, int], Transform] = {}

    def assign(
        self, name: str, value: Node | None, line: int, function: int | None = None, scope: str = ""
    ) -> None:
        """The program assigns `value` to a variable; None for one that cannot be read.

        Args:
            name: The variable.
            value: The expression.
            line: Line of the assignment.
            function: Function whose every run takes it; None if none does.
            scope: The word before it, global or local; empty if there is none.
        """
        if value is None:
            self._why_not[name] = _assigned_again(name, line)
        else:
            self._assigned.setdefault(name, []).append(_Assigned(value, function, scope))
            self._again[name] = line

    def change(self, name: str, line: int) -> None:
        """The program changes a variable in place, or it is a parameter of a function."""
        self._why_not[name] = f'"{name}" is changed when the program runs, in line {line}'

    def doubt(self, name: str, line: int) -> None:
        """A statement that cannot be read may assign a variable, or declare another one of that name."""
        self._why_not.setdefault(name, _assigned_again(name, line))

    def settle(self, scopes: Scopes, alone: Set[int | None]) -> None:
        """All was read: which function a place is in, and which functions nothing runs meanwhile."""
        self._scopes, self._alone = scopes, alone

    def value(self, used: Node) -> Node:
        """What a variable has been assigned where its name stands.

        Raises:
            RunTime: If it is assigned several times so that this is not certain, changed, or not assigned in
                this file.
        """
        name = used.text
        if name in self._why_not:
            raise RunTime(self._why_not[name])
        assigned = self._assigned.get(name, [])
        if not assigned:
            raise RunTime(f'"{name}" is not assigned in this file')
        return assigned[0].value if len(assigned) == 1 else self._last(used, assigned)

    def fixed(self, node: Node) -> bool:
        """Whether an expression, and what its variables are made of, has variables assigned once alone."""
        pending, seen = [node], set[str]()
        while pending:
            for name in {part.text for part in pending.pop().walk() if part.kind == "name"} - seen:
                assigned = self._assigned.get(name, [])
                if len(assigned) != 1:
                    return False
                seen.add(name)
                pending.append(assigned[0].value)
        return True

    def _last(self, used: Node, assigned: list[_Assigned]) -> Node:
        """The value of the last assignment before the place where a variable is used."""
        function = self._function(used.text, assigned)
        before = bisect_right(assigned, used.start, key=lambda one: one.value.end)
        if function is None or before == 0 or self._scopes.of(used.start) != function:
            raise RunTime(_assigned_again(used.text, self._again[used.text]))
        return assigned[before - 1].value

    def _function(self, name: str, assigned: list[_Assigned]) -> int | None:
        """The function whose every run assigns a variable, as nothing else does; None if there is none."""
        if name not in self._assigning:
            functions = {one.function for one in assigned}
            scopes = {one.scope for one in assigned} - {""}
            one_variable = not scopes or (len(scopes) == 1 and assigned[0].scope in scopes)
            alone = len(functions) == 1 and functions <= self._alone
            self._assigning[name] = functions.pop() if alone and one_variable else None
        return self._assigning[name]

    def literal(self, node: Node, depth: int = 0) -> Node:
        """What `node` stands for, names and constant places in lists followed.

        Raises:
            RunTime: If that is not known.
        """
        if depth > _DEEPEST:
            raise RunTime("variables are assigned one another")
        if node.kind not in ("name", "index"):
            return node
        place = (node.start, node.end)
        if place not in self._literals:
            self._literals[place] = self._literal(node, depth)
        return self._literals[place]

    def _literal(self, node: Node, depth: int) -> Node:
        if node.kind == "name":
            return self.literal(self.value(node), depth + 1)
        if len(node.parts) == 2:
            whole = self.literal(node.parts[0], depth + 1)
            place = self.number(node.parts[1], depth + 1)
            if whole.kind in ("list", "pose") and place.is_integer() and 0 <= place < len(whole.parts):
                return self.literal(whole.parts[int(place)], depth + 1)
            raise RunTime("there is no such element")
        return node

    def holder(self, node: Node, depth: int = 0) -> str:
        """The variable that is assigned what a known `node` stands for; empty where `node` itself says it.

        Raises:
            RunTime: As for :meth:`literal`.
        """
        if depth > _DEEPEST:
            raise RunTime("variables are assigned one another")
        if node.kind == "name":
            return self.holder(self.value(node), depth + 1) or node.text
        if node.kind == "index" and len(node.parts) == 2:
            whole = self.literal(node.parts[0])
            element = whole.parts[int(self.number(node.parts[1]))]
            return self.holder(element, depth + 1) or self.holder(node.parts[0], depth + 1)
        return ""

    def number(self, node: Node, depth: int = 0) -> float:
        """The value of a constant expression.

        Raises:
            RunTime: If it is none.
        """
        if depth > _DEEPEST:
            raise RunTime("variables are assigned one another")
        node = self.literal(node, depth + 1)
        place = (node.start, node.end)
        if place not in self._numbers:
            self._numbers[place] = self._number(node, depth)
        return self._numbers[place]

    def _number(self, node: Node, depth: int) -> float:
        found = math.nan
        if node.kind == "number":
            found = float(node.text)
        elif node.kind == "sign" and node.text != "not":
            found = self.number(node.parts[0], depth + 1) * (-1.0 if node.text == "-" else 1.0)
        elif node.kind == "operation" and node.text in _ARITHMETIC:
            left, right = (self.number(part, depth + 1) for part in node.parts)
            found = _calculated(lambda: _ARITHMETIC[node.text](left, right))
        elif node.kind == "call" and node.text in _FUNCTIONS and (given := arguments(node)) is not None:
            value = self.number(given[0], depth + 1)
            found = _calculated(lambda: _FUNCTIONS[node.text](value))
        if not math.isfinite(found):
            raise RunTime("a number is computed when the program runs")
        return found

    def transform(self, node: Node, depth: int = 0) -> Transform:
        """The transform (4, 4) of a constant pose, poses made of poses included.

        Raises:
            RunTime: If it is none.
        """
        if depth > _DEEPEST:
            raise RunTime("variables are assigned one another")
        node = self.literal(node, depth + 1)
        place = (node.start, node.end)
        if place not in self._transforms:
            self._transforms[place] = self._transform(node, depth)
            self._transforms[place].setflags(write=False)
        return self._transforms[place]

    def _transform(self, node: Node, depth: int) -> Transform:
        if node.kind == "pose" and len(node.parts) == AXES:
            values = np.array([[self.number(part, depth + 1) for part in node.parts]])
            found: Transform = _POSE.to_poses(values)[0]
            return found
        given = arguments(node) if node.kind == "call" else None
        if given is not None and node.text == "pose_inv":
            return rigid_inverse(self.transform(given[0], depth + 1))
        if given is not None and node.text in COMBINED:
            first, second = (self.transform(part, depth + 1) for part in given)
            return COMBINED[node.text](first, second)
        raise RunTime("a pose is computed when the program runs")


def added(first: Transform, second: Transform) -> Transform:
    """pose_add: positions are added, orientations multiplied (Script Manual, pose_add)."""
    result = first @ turning(second)
    result[:3, 3] = first[:3, 3] + second[:3, 3]
    return result


def subtracted(first: Transform, second: Transform) -> Transform:
    """pose_sub: positions are subtracted, the first orientation times the inverse of the second."""
    result = first @ turning(rigid_inverse(second))
    result[:3, 3] = first[:3, 3] - second[:3, 3]
    return result


def turning(transform: Transform) -> Transform:
    """The rotation alone."""
    result = transform.copy()
    result[:3, 3] = 0.0
    return result


def moving(transform: Transform, factor: float = 1.0) -> Transform:
    """The translation alone, times `factor`."""
    result = np.eye(4)
    result[:3, 3] = factor * transform[:3, 3]
    return result


COMBINED: Final[dict[str, Callable[[Transform, Transform], Transform]]] = {
    "pose_trans": operator.matmul,
    "pose_add": added,
    "pose_sub": subtracted,
}


def _assigned_again(name: str, line: int) -> str:
    return f'"{name}" is assigned in line {line} and elsewhere, or is computed'


def _calculated(work: Callable[[], float]) -> float:
    """The result, or NaN where there is none."""
    try:
        return float(work())
    except (ZeroDivisionError, ValueError, OverflowError):
        return math.nan
