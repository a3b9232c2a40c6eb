"""Whether the arm stands while it is measured: its joints before each reading and behind it."""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from truearm.cell.cell_file import Cell
from truearm.cell.reading import Reading
from truearm.types import Floats
from truearm.units import MM_PER_METRE

SHARE_OF_AGREEMENT: Final = 0.25
"""How much of what readings of a pose may differ by the arm may move while one of them is made."""


class AtRest:
    """The joints of an arm at a place, and how far they still carry the target.

    The joints read behind a reading are those that belong to it: an arm creeps to its place, and an
    instrument that waits for it, or takes a mean, sees the end of that. How far the nominal target came since
    those read before says how well they do. What turns about the target moves it nowhere, and joints that a
    controller knows as commanded only tell nothing.

    Attributes:
        joints: Where the arm was last (N,).
        settles: Whether the arm moved during the last reading, and less than before: it comes to rest.
    """

    def __init__(self, cell: Cell, agree_m: float, joints: Floats) -> None:
        self._cell, self._limit_m = cell, SHARE_OF_AGREEMENT * agree_m
        self.arrived(joints)

    def arrived(self, joints: Floats) -> None:
        """The arm has come to a place, at joints (N,)."""
        self.joints, self.settles, self._moved_m = joints, False, math.inf

    def judged(self, reading: Reading, joints: Floats) -> Reading:
        """A reading, with the joints (N,) behind it; not valid where the target moved meanwhile."""
        here, there = self._cell.targets_in_base(np.stack([self.joints, joints]))
        before_m, self._moved_m = self._moved_m, float(np.linalg.norm(there - here))
        self.joints = joints
        moves = self._moved_m > self._limit_m
        self.settles = moves and self._moved_m < before_m
        if not (moves and reading.valid):
            return reading
        reason = f"the arm moved by {MM_PER_METRE * self._moved_m:.2f} mm while it was measured"
        return replace(reading, valid=False, reason=reason)
