"""How many turns a joint is away from its principal range: numbers that several languages write."""

from typing import Final

import numpy as np

from truearm.types import Floats, Integers
from truearm.units import FULL_TURN

EDGE_RAD: Final = 2e-5
ON_THE_EDGE: Final = 2**20


def turns(q: Floats) -> Integers:
    """Turn numbers of readings, rad: 0 within half a turn, 1 and -1 up to a turn and a half, and so on.

    ON_THE_EDGE where a reading is so near to where the number changes that a controller's own arithmetic
    decides: no number says for certain what is meant there.
    """
    found: Integers = np.round(q / FULL_TURN).astype(np.int64)
    apart = np.abs(np.abs(q - FULL_TURN * found) - 0.5 * FULL_TURN)
    found[apart < EDGE_RAD] = ON_THE_EDGE
    return found
