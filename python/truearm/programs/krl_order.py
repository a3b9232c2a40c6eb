"""Which assignments of a KRL program were certainly executed before what is read now."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Place:
    """A place in the text.

    Attributes:
        branches: Number of its routine, and of the branches and loops around it from outside in.
        time: How much was read before it.
    """

    branches: tuple[int, ...]
    time: int


class Order:
    """Where the reader is, and where names were assigned."""

    def __init__(self) -> None:
        self._branches = [0]
        self._count, self._time = 0, 0
        self._assigned: dict[str, Place] = {}
        self._calls: dict[int, tuple[Place, ...]] = {}
        self._known: dict[tuple[Place, int], bool] = {}

    def begin(self, calls: Sequence[Place]) -> None:
        """A routine begins; `calls` are all its calls, or none where not all of them are known."""
        self._branches = [self._new()]
        self._calls[self._branches[0]] = tuple(calls)

    def open(self) -> None:
        """A branch or the body of a loop begins."""
        self._branches.append(self._new())

    def otherwise(self) -> None:
        """Another branch of the same statement begins."""
        if len(self._branches) > 1:
            self._branches[-1] = self._new()

    def close(self) -> None:
        """The branches or the loop end."""
        if len(self._branches) > 1:
            self._branches.pop()

    def assign(self, key: str) -> None:
        """A name is assigned here."""
        self._assigned[key] = self.here()

    def forget(self) -> None:
        """What was assigned before may have been passed by."""
        self._assigned.clear()

    def here(self) -> Place:
        """The present place."""
        self._time += 1
        return Place(tuple(self._branches), self._time)

    def assigned(self, key: str) -> bool:
        """Whether a name was certainly assigned before."""
        place = self._assigned.get(key)
        return place is not None and self._before(place, self.here())

    def _before(self, earlier: Place, later: Place) -> bool:
        if earlier.time < later.time and later.branches[: len(earlier.branches)] == earlier.branches:
            return True
        routine = later.branches[0]
        known = self._known.get((earlier, routine))
        if known is None:
            calls = self._calls.get(routine, ())
            known = bool(calls) and all(self._before(earlier, call) for call in calls)
            self._known[earlier, routine] = known
        return known

    def _new(self) -> int:
        self._count += 1
        return self._count
