"""KUKA's Status and Turn: which of its postures an arm is in, and the signs of its axes.

Status bit 0: the wrist centre is behind axis 1 (overhead area). Bit 1: axis 3 is bent beyond the stretched
arm, which for arms whose axes 3 and 4 meet is A3 >= 0. Bit 2: A5 is negative. Further bits of Status are
kept; bit 3 tells of an absolutely accurate robot. Turn bits 0 to 5: the axis is negative; others are kept.
Source: docs/reference/programs.md.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.programs.branches import Branches
from truearm.programs.configuration import ANY
from truearm.types import Floats, Integers

STATUS_BITS, TURN_BITS = 3, 6
STATUS_WEIGHTS: Final = 2 ** np.arange(STATUS_BITS)
TURN_WEIGHTS: Final = 2 ** np.arange(TURN_BITS)
ACCURATE: Final = 8


@dataclass(frozen=True, eq=False)
class StatusAndTurn:
    """Nine digits: three bits of Status, six of Turn."""

    branches: Branches

    def digits(self, q: Floats) -> Integers:
        """As in Configuration."""
        status = [self.branches.reach(q) < 0.0, self.branches.elbow(q) >= 0.0, self.branches.wrist(q) < 0.0]
        found: Integers = np.column_stack([*status, q < 0.0]).astype(np.int64)
        return found

    def digits_of_text(self, values: Floats) -> Integers:
        """As in Configuration; S or T that is not written leaves its bits open."""
        found = np.full((len(values), STATUS_BITS + TURN_BITS), ANY, dtype=np.int64)
        for column, bits in ((0, slice(0, STATUS_BITS)), (1, slice(STATUS_BITS, None))):
            written = np.flatnonzero(np.isfinite(values[:, column]))
            numbers = values[written, column].astype(np.int64)
            weights = STATUS_WEIGHTS if column == 0 else TURN_WEIGHTS
            found[written, bits] = (numbers[:, None] & weights) > 0
        return found

    def text_of_digits(self, digits: Integers, values: Floats) -> Floats:
        """As in Configuration."""
        text = np.array(values)
        for column, bits in ((0, slice(0, STATUS_BITS)), (1, slice(STATUS_BITS, None))):
            weights = STATUS_WEIGHTS if column == 0 else TURN_WEIGHTS
            written = np.isfinite(values[:, column])
            kept = values[written, column].astype(np.int64) & ~int(weights.sum())
            text[written, column] = kept + digits[written, bits] @ weights
        return text
