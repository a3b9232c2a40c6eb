"""Mitsubishi's structure flags: FL1 tells right or left, above or below, flip or not; FL2 counts turns.

FL1 has a bit for right (4), above (2) and non-flip (1). Right: the wrist centre is in front of the axis of
J1. Above: the axis of J3 is above the plane through the axes of J2 and of the wrist centre, which for an arm
that reaches behind itself (left) is left open here, since then the manuals' pictures can be read both ways.
Non-flip: J5 > 0. FL2 has four bits for each axis, the lowest for J1: whole turns from -8 to 7, as (7,1048576)
says that J6 is beyond 180 deg. Source: MELFA-BASIC V, detailed explanations of functions and operations,
"Position constants" and "Structure flag".
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.programs.branches import Branches
from truearm.programs.configuration import ANY
from truearm.programs.turning import turns
from truearm.types import Floats, Integers

RIGHT, ABOVE, NON_FLIP = 4, 2, 1
POSTURE: Final = RIGHT | ABOVE | NON_FLIP
AXES: Final = 6
BITS: Final = 4
MOST, LEAST = 7, -8
OPEN: Final = 2


@dataclass(frozen=True, eq=False)
class StructureFlags:
    """Nine digits: right, above, non-flip, and the turns of six axes."""

    branches: Branches

    def digits(self, q: Floats) -> Integers:
        """As in Configuration; OPEN for above or below behind the arm."""
        right = self.branches.reach(q) >= 0.0
        above = np.where(right, self.branches.elbow(q) * self.branches.above >= 0.0, OPEN)
        flags = np.column_stack([right, above, self.branches.wrist(q) >= 0.0, turns(q)])
        found: Integers = flags.astype(np.int64)
        return found

    def digits_of_text(self, values: Floats) -> Integers:
        """As in Configuration."""
        found = np.full((len(values), 3 + AXES), ANY, dtype=np.int64)
        written = np.flatnonzero(np.isfinite(values).all(axis=1))
        posture, turned = values[written].astype(np.int64).T
        found[written, 0] = (posture & RIGHT) > 0
        found[written, 1] = np.where((posture & RIGHT) > 0, (posture & ABOVE) > 0, ANY)
        found[written, 2] = (posture & NON_FLIP) > 0
        for axis in range(AXES):
            nibble = (turned >> (BITS * axis)) & 15
            found[written, 3 + axis] = np.where(nibble > MOST, nibble - 16, nibble)
        return found

    def text_of_digits(self, digits: Integers, values: Floats) -> Floats:
        """As in Configuration; NaN for turns that four bits do not hold, or that are not certain."""
        text = np.array(values)
        stated = np.nan_to_num(values[:, 0]).astype(np.int64)
        above = np.where(digits[:, 1] == OPEN, (stated & ABOVE) > 0, digits[:, 1])
        posture = RIGHT * digits[:, 0] + ABOVE * above + NON_FLIP * digits[:, 2]
        text[:, 0] = (stated & ~POSTURE) + posture
        turned = digits[:, 3:]
        nibbles = (turned & 15) << (BITS * np.arange(AXES))
        stated_turns = np.nan_to_num(values[:, 1]).astype(np.int64)
        whole = (stated_turns >> (BITS * AXES) << (BITS * AXES)) + nibbles.sum(axis=1)
        written = ((turned >= LEAST) & (turned <= MOST)).all(axis=1)
        text[:, 1] = np.where(written, whole.astype(np.float64), np.nan)
        return text
