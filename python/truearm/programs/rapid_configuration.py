"""ABB's confdata: the quarter of a turn that axes 1, 4 and 6 are in, and which of eight postures the arm has.

cf = floor(angle / 90 deg). cfx counts the postures: 4 for a wrist centre behind axis 1, 2 for one behind the
lower arm, 1 for a negative axis 5. Arms whose axis 3 is driven through a parallelogram do not use it.
Source: docs/reference/programs.md.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.programs.branches import Branches
from truearm.programs.configuration import ANY
from truearm.types import Floats, Integers

QUARTER: Final = np.pi / 2.0
AXES: Final = (0, 3, 5)
WEIGHTS: Final = np.array([4, 2, 1])


@dataclass(frozen=True, eq=False)
class Confdata:
    """Six digits: three quarters of turns, three bits of cfx."""

    branches: Branches

    @property
    def uses_cfx(self) -> bool:
        """Whether the arm's cfx counts postures."""
        coupling = self.branches.robot.coupling
        return bool(np.array_equal(np.abs(coupling), np.eye(len(coupling))))

    def digits(self, q: Floats) -> Integers:
        """As in Configuration."""
        quarters = np.floor(q[:, AXES] / QUARTER)
        behind = [self.branches.reach(q) < 0.0, self.branches.elbow(q) < 0.0, self.branches.wrist(q) < 0.0]
        found: Integers = np.column_stack([quarters, *behind]).astype(np.int64)
        return found

    def digits_of_text(self, values: Floats) -> Integers:
        """As in Configuration; data that is not written out leaves all open."""
        found = np.full((len(values), 6), ANY, dtype=np.int64)
        written = np.flatnonzero(np.isfinite(values).all(axis=1))
        numbers = values[written].astype(np.int64)
        found[written, :3] = numbers[:, :3]
        if self.uses_cfx:
            found[written, 3:] = (numbers[:, 3:] & WEIGHTS) > 0
        return found

    def text_of_digits(self, digits: Integers, values: Floats) -> Floats:
        """As in Configuration."""
        text = np.array(values)
        text[:, :3] = digits[:, :3]
        if self.uses_cfx:
            text[:, 3] = digits[:, 3:] @ WEIGHTS
        return text
