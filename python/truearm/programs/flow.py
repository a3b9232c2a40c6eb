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
        overruled: Whether a state within a loop is another one when the loop comes round, given the state
            before the loop and what is known there then; without, where it is the one before and that is not.

    Attributes:
        state: What is known now.
        certain: Whether the statement before is the one executed before.
        overruled: Uses, by number, that are made with another state when a loop comes round again.
    """

    def __init__(
        self,
        state: State,
        join: Callable[[State, State], State],
        same: Callable[[State, State], bool],
        overruled: Callable[[State, State, State], bool] | None = None,
    ) -> None:
        self._join, self._same, self._start = join, same, state
        self._differs = overruled or self._is_before
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
                if self._differs(state, block.before, again):
                    self.overruled.add(number)
        reached = self.state
        for end in block.ends if block.complete else [*block.ends, block.before]:
            reached = self._join(reached, end)
        self.state = reached
        if not self._blocks:
            self._uses.clear()

    def leave(self) -> None:
        """The innermost loop is left with the present state."""
        loop = next((block for block in reversed(self._blocks) if block.loop), None)
        if loop is not None:
            loop.ends.append(self.state)
        self.certain = False

    def jump(self) -> None:
        """The next statement is not the one executed next, or may be reached from elsewhere."""
        self.certain = False

    def _is_before(self, state: State, before: State, again: State) -> bool:
        return self._same(state, before) and not self._same(again, state)
