"""What is known of settings that stay until they are changed, along the branches and loops of a program."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

State = TypeVar("State")


@dataclass
class _Block(Generic[State]):
    loop: bool
    before: State
    ends: list[State] = field(default_factory=list)
    first_use: int = 0
    complete: bool = False


class Flow(Generic[State]):
    """The state while a text is read from top to bottom.

    Args:
        state: At the start.
        join: What is known where two states meet.
        same: Whether two states are equal.

    Attributes:
        state: What is known now.
        certain: Whether the statement before is the one executed before.
        overruled: Uses, by number, that are made with another state when a loop comes round again.
    """

    def __init__(
        self, state: State, join: Callable[[State, State], State], same: Callable[[State, State], bool]
    ) -> None:
        self._join, self._same, self._start = join, same, state
        self.overruled: set[int] = set()
        self._blocks: list[_Block[State]] = []
        self.state, self.certain = state, False
        self._uses: list[tuple[int, State]] = []

    def restart(self) -> None:
        """A routine begins."""
        self._blocks.clear()
        self._uses.clear()
        self.state, self.certain = self._start, False

    def use(self, number: int) -> None:
        """A move is made with the present state."""
        self.certain = True
        if self._blocks:
            self._uses.append((number, self.state))

    def open(self, *, loop: bool) -> None:
        """A branch or the body of a loop begins."""
        self._blocks.append(_Block(loop, self.state, first_use=len(self._uses)))
        if loop:
            self.certain = False

    def otherwise(self, *, last: bool = False) -> None:
        """Another branch of the same statement begins; `last` for the one taken where no other is."""
        if self._blocks:
            self._blocks[-1].complete |= last
            self._blocks[-1].ends.append(self.state)
            self.state = self._blocks[-1].before
        self.certain = False

    def close(self) -> None:
        """The branches or the loop end."""
        self.certain = False
        if not self._blocks:
            return
        block = self._blocks.pop()
        if block.loop and not self._same(block.before, self.state):
            again = self._join(block.before, self.state)
            for number, state in self._uses[block.first_use :]:
                if self._same(state, block.before) and not self._same(again, state):
                    self.overruled.add(number)
        reached = self.state
        for end in block.ends if block.complete else [*block.ends, block.before]:
            reached = self._join(reached, end)
        self.state = reached
        if not self._blocks:
            self._uses.clear()

    def jump(self) -> None:
        """The next statement is not the one executed next, or may be reached from elsewhere."""
        self.certain = False
