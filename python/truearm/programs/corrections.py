"""What a rewriter asks of whoever corrects readings."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from truearm.robot import Robot

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Refusal(Protocol):
    """Why a row was refused."""

    @property
    def number(self) -> int:
        """Row, from 1."""
        ...

    @property
    def reason(self) -> str:
        """Why, in words that end a sentence."""
        ...

    @property
    def code(self) -> int:
        """Why, for programs."""
        ...


class Corrected(Protocol):
    """What a compensator gives for rows; a row that is refused has NaN for readings."""

    @property
    def q(self) -> Floats:
        """Corrected readings (n, N), rad and m."""
        ...

    @property
    def correction_mm(self) -> Floats:
        """How far the correction shifts the tool, (n,)."""
        ...

    @property
    def correction_mrad(self) -> Floats:
        """How far it turns it, (n,)."""
        ...

    @property
    def residual_mm(self) -> Floats:
        """How far from its place the tool stays, (n,)."""
        ...

    @property
    def residual_mrad(self) -> Floats:
        """How far turned from it, (n,)."""
        ...

    @property
    def std_mm(self) -> Floats | None:
        """Standard deviation of the tool's place, (n,); None where it is not known."""
        ...

    @property
    def refused(self) -> Bools:
        """Which rows are refused, (n,)."""
        ...

    @property
    def refusals(self) -> Sequence[Refusal]:
        """Why, for each of them in order."""
        ...


class Compensator(Protocol):
    """What turns readings into corrected ones."""

    def joints(self, q: Floats, *, tool: Floats | None = None, author: Robot | None = None) -> Corrected:
        """Corrected readings of rows (n, N), at a tool; `author` as in author_of."""
        ...
