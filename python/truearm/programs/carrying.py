"""From which known place an arm comes on lines and arcs alone, over places that are not known.

It keeps its posture on the way, whatever these places are.
"""

from collections.abc import Callable
from functools import cached_property

from truearm.programs.program import motion_is_straight
from truearm.programs.tables import NOWHERE, Moves
from truearm.types import Floats, Integers


class Origins:
    """Finds these places while the targets of a program are solved, in the order of its moves."""

    def __init__(
        self, moves: Moves, known: Callable[[int], Floats | None], lost: Callable[[int], bool]
    ) -> None:
        """Of these moves.

        Args:
            moves: The moves.
            known: Readings (N,) of a target; None where they are not known.
            lost: Whether the arm's posture is not known behind a target that is not known.
        """
        self._moves, self._known, self._lost = moves, known, lost
        self._found: dict[int, Floats | None] = {}

    @cached_property
    def _previous(self) -> Integers:
        return self._moves.previous

    def of(self, move: int) -> Floats | None:
        """Readings (N,) from where a line or an arc and those before it come; None if they are not known."""
        passed: list[int] = []
        place: Floats | None = None
        one = int(self._previous[move])
        while one != NOWHERE:
            place = self._found[one] if one in self._found else self._known(int(self._moves.target[one]))
            if place is not None or one in self._found or not self._leads_on(one):
                break
            passed.append(one)
            one = int(self._previous[one])
        self._found.update(dict.fromkeys(passed, place))
        return place

    def _leads_on(self, move: int) -> bool:
        """Whether the arm goes to a place that is not known in the posture in which it was before."""
        straight = motion_is_straight(int(self._moves.motion[move]))
        return straight and not self._lost(int(self._moves.target[move]))
