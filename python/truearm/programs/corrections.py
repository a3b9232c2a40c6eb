"""What a rewriter asks of whoever corrects readings."""

from typing import Protocol

from truearm.compensation import Compensated
from truearm.robot import Robot
from truearm.types import Floats


class Compensator(Protocol):
    """What turns readings into corrected ones."""

    def joints(self, q: Floats, *, tool: Floats | None = None, author: Robot | None = None) -> Compensated:
        """Corrected readings of rows (n, N), at a tool; `author` as in author_of."""
        ...
