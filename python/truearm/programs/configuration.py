"""Configuration data: integers beside a pose that tell the controller which branch and turns are meant.

A language says how digits follow from readings; telling them of a branch and finding the branch that a
target means are the same function, so that what is written is what is read.
"""

from collections.abc import Sequence
from typing import Final, Protocol

import numpy as np

from truearm.programs.layouts import Layout
from truearm.programs.tables import Targets
from truearm.turns import EDGE_RAD
from truearm.types import Floats, Integers, Mask

ANY: Final = -(2**31)


class Configuration(Protocol):
    """How a language writes branch and turns.

    A digit is the smallest thing that changes alone: a bit of KUKA's Turn, one of ABB's cf numbers. Each
    digit must depend on the readings alone (and on the arm's fixed geometry).
    """

    def digits(self, q: Floats) -> Integers:
        """Digits (n, D) of readings (n, N), rad and m."""
        ...

    def digits_of_text(self, values: Floats) -> Integers:
        """Digits (n, D) of the numbers (n, C) in the text; ANY where the text leaves a digit open."""
        ...

    def text_of_digits(self, digits: Integers, values: Floats) -> Floats:
        """Numbers (n, C) to write for `digits`; `values` are those of the text, what means else is kept."""
        ...


def meant(
    configuration: Configuration, wanted: Integers, candidates: Floats, edge_rad: Floats | float = EDGE_RAD
) -> tuple[Mask, Mask]:
    """Which of the readings (m, N) agree with the digits (m, D) of their targets.

    Args:
        configuration: How the digits follow from readings.
        wanted: The digits, ANY where they are left open.
        candidates: The readings.
        edge_rad: A joint within this, (m, N) or one for all, of a digit's edge agrees with both sides of it.

    Returns:
        Which agree as they are, (m,), and which within `edge_rad`, (m,).
    """
    if len(candidates) == 0:
        return np.zeros(0, dtype=bool), np.zeros(0, dtype=bool)
    agrees = [configuration.digits(candidates + shift) == wanted for shift in (0.0, edge_rad, -edge_rad)]
    exactly: Mask = ((wanted == ANY) | agrees[0]).all(axis=1)
    found: Mask = np.logical_or.reduce([wanted == ANY, *agrees]).all(axis=1)
    return exactly, found


def configured(targets: Targets, layouts: Sequence[Layout]) -> list[int]:
    """The targets that state configuration data."""
    found: list[int] = []
    for number, layout in enumerate(layouts):
        count = layout.configuration
        which = np.flatnonzero(targets.layout == number)
        if count and len(which):
            stated = np.isfinite(targets.of(targets.values, which, layout.width)[:, -count:]).any(axis=1)
            found += which[stated].tolist()
    return found
