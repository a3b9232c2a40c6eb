"""What a rewriter asks of whoever corrects readings."""

from typing import Any, Protocol

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
    """What a compensator gives for rows."""

    q: Floats
    correction_mm: Floats
    correction_mrad: Floats
    residual_mm: Floats
    residual_mrad: Floats
    std_mm: Floats
    refused: Bools
    refusals: tuple[Any, ...]


class Compensator(Protocol):
    """What turns readings into corrected ones."""

    def joints(self, q: Floats, *, tool: Floats | None = None, author: Robot | None = None) -> Any:  # noqa: ANN401
        """Corrected readings of rows (n, N), at a tool; `author` as in author_of."""
        ...
