"""Where a URScript target's numbers are, and what the program does with them before it goes there."""

from collections.abc import Iterator, Set
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from truearm.programs.lexing import decimals_of
from truearm.programs.tables import Number
from truearm.programs.urscript_constants import (
    AXES,
    COMBINED,
    Constants,
    RunTime,
    moving,
    turning,
)
from truearm.programs.urscript_syntax import PARAMETERS, Node, argument, arguments
from truearm.rotations import rigid_inverse
from truearm.types import Transform
from truearm.units import RADIANS_PER_DEGREE

_DEEPEST: Final = 20
_DEEPEST_LEAVES: Final = 120
_MOST_LEAVES: Final = 200
_POSE_OF_INVERSE: Final = (0, "x")
"""Place and name of the pose among the arguments of get_inverse_kin."""
_OF_INVERSE: Final = frozenset({"", "x", "qnear", "maxPositionError", "maxOrientationError"})


@dataclass(frozen=True, eq=False)
class Place:
    """The numbers that a motion goes to.

    Attributes:
        leaf: The list of joint angles, or the pose, as it is written.
        name: The variable that holds it; empty where it stands in the motion itself.
        before: What the pose is multiplied with from the left, (4, 4).
        after: The same from the right.
        seed: Joint angles that the controller looks for a solution near to.
        others: Offsets of other poses that before and after were made of.
    """

    leaf: Node
    name: str = ""
    before: Transform | None = None
    after: Transform | None = None
    seed: "Place | None" = None
    others: frozenset[int] = frozenset()

    @property
    def is_joints(self) -> bool:
        """Whether the numbers are joint angles."""
        return self.leaf.kind == "list"

    def moved(self, before: Transform, after: Transform, others: Set[int]) -> "Place":
        """The same with more around it."""
        if self.is_joints:
            raise RunTime("joint angles are used as a pose")
        whole_before = before if self.before is None else before @ self.before
        whole_after = after if self.after is None else self.after @ after
        return replace(self, before=whole_before, after=whole_after, others=self.others | others)


class Places:
    """Finds places; knows which numbers are gone to directly, so that they are no mere frames of others.

    Attributes:
        direct: Offsets of poses that some motion goes to as they are.
    """

    def __init__(self, constants: Constants) -> None:
        self._constants = constants
        self.direct: set[int] = set()
        self._leaves: dict[tuple[int, int], frozenset[int]] = {}

    def note_direct(self, node: Node) -> None:
        """A motion has this target: remember the pose if it goes to it as it is."""
        if node.kind == "call" and node.text == "get_inverse_kin" and node.parts:
            node = argument(node, *_POSE_OF_INVERSE) or node
        try:
            leaf = self._constants.literal(node)
        except RunTime:
            return
        if leaf.kind == "pose":
            self.direct.add(leaf.start)

    def of(self, node: Node, depth: int = 0) -> Place:
        """The place of a target.

        Raises:
            RunTime: If it is computed when the program runs, or cannot be told.
        """
        if depth > _DEEPEST:
            raise RunTime("its computation is nested too deeply")
        if node.kind == "call":
            return self._of_call(node, depth + 1)
        literal = self._constants.literal(node)
        if literal.kind == "call":
            return self.of(literal, depth + 1)
        if literal.kind not in ("list", "pose") or len(literal.parts) != AXES:
            raise RunTime("its target is computed when the program runs")
        return Place(literal, self._constants.holder(node))

    def every(self, node: Node) -> Iterator[Place]:
        """The places of a target: one, or each element of a list that is indexed at run time.

        Raises:
            RunTime: As for :meth:`of`.
        """
        if node.kind == "index" and len(node.parts) == 2 and not self._is_number(node.parts[1]):
            whole = self._constants.literal(node.parts[0])
            if whole.kind == "list" and whole.parts and all(map(self._is_place, whole.parts)):
                holder = self._constants.holder(node.parts[0])
                for part in whole.parts:
                    place = self.of(part)
                    yield place if place.name else replace(place, name=holder)
                return
        yield self.of(node)

    def _is_place(self, node: Node) -> bool:
        try:
            return self._constants.literal(node).kind in ("list", "pose")
        except RunTime:
            return False

    def _is_number(self, node: Node) -> bool:
        try:
            self._constants.number(node)
        except RunTime:
            return False
        return True

    def _of_call(self, node: Node, depth: int) -> Place:
        given = arguments(node)
        if node.text == "get_forward_kin" and given is not None:
            place = self.of(given[0], depth)
            if not place.is_joints:
                raise RunTime("get_forward_kin is given no joint angles")
            return place
        if node.text == "get_inverse_kin":
            return self._inverse(node, depth)
        if node.text in COMBINED:
            if given is None:
                rule = " and ".join(PARAMETERS[node.text])
                raise RunTime(f"{node.text} is given other arguments than {rule}")
            return self._combined(node.text, given, depth)
        raise RunTime(f"its target is computed by {node.text or 'a function'} when the program runs")

    def _inverse(self, node: Node, depth: int) -> Place:
        """get_inverse_kin(pose, qnear): the pose, with the solution nearest to qnear."""
        if "tcp" in node.keys or len(node.parts) > 4:
            raise RunTime("get_inverse_kin is given a TCP of its own")
        unknown = set(node.keys) - _OF_INVERSE
        if unknown:
            raise RunTime(f'get_inverse_kin has no argument "{min(unknown)}"')
        given = argument(node, *_POSE_OF_INVERSE)
        if given is None:
            raise RunTime("get_inverse_kin is given no pose")
        near = argument(node, 1, "qnear")
        place = self.of(given, depth)
        if place.is_joints:
            raise RunTime("get_inverse_kin is given no pose")
        if near is None:
            return place
        seed = self.of(near, depth)
        if not seed.is_joints:
            raise RunTime("qnear is no list of joint angles")
        return replace(place, seed=seed)

    def _combined(self, function: str, given: tuple[Node, ...], depth: int) -> Place:
        """A pose times, plus or minus another one.

        One of them is the target, the other is constant. Of pose_trans(a, b) the target is b, unless some
        motion goes to a itself: then b is an offset from it. Of pose_add and pose_sub it is a.
        """
        first, second = given
        known = self._constants
        if function == "pose_trans" and not self.leaves(first) & self.direct:
            return self.of(second, depth).moved(known.transform(first), np.eye(4), self.leaves(first))
        place, fixed = self.of(first, depth), known.transform(second)
        if function == "pose_trans":
            return place.moved(np.eye(4), fixed, self.leaves(second))
        if function == "pose_add":
            return place.moved(moving(fixed), turning(fixed), self.leaves(second))
        return place.moved(moving(fixed, -1.0), turning(rigid_inverse(fixed)), self.leaves(second))

    def leaves(self, node: Node, depth: int = 0) -> frozenset[int]:
        """Offsets of the poses that an expression is made of, variables followed.

        Raises:
            RunTime: If they are too many.
        """
        if depth > _DEEPEST_LEAVES:
            raise RunTime("its computation is nested too deeply")
        place = (node.start, node.end)
        if place not in self._leaves:
            self._leaves[place] = self._found_leaves(node, depth)
        return self._leaves[place]

    def _found_leaves(self, node: Node, depth: int) -> frozenset[int]:
        if node.kind == "pose":
            return frozenset({node.start})
        if node.kind in ("name", "index"):
            try:
                literal = self._constants.literal(node)
            except RunTime:
                return frozenset()
            return self.leaves(literal, depth + 1) if literal is not node else frozenset()
        found = frozenset[int]().union(*(self.leaves(part, depth + 1) for part in node.parts))
        if len(found) > _MOST_LEAVES:
            raise RunTime("its computation is nested too deeply")
        return found


def numbers_of(leaf: Node) -> list[Number]:
    """The six numbers of a place; d2r( ) of a number is one.

    Raises:
        RunTime: If one of them is written otherwise.
    """
    return [_number(part, place) for place, part in enumerate(leaf.parts, start=1)]


def _number(node: Node, place: int) -> Number:
    factor = 1.0
    given = arguments(node) if node.kind == "call" and node.text == "d2r" else None
    if given is not None:
        node, factor = given[0], RADIANS_PER_DEGREE
    if node.kind != "number":
        raise RunTime(f"number {place} of it is written as an expression")
    value = float(node.text)
    if not np.isfinite(value):
        raise RunTime(f"number {place} of it is too large")
    return Number(node.start, node.end, value, decimals_of(node.text), factor)
