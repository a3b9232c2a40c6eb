"""Some of many rows, spread evenly, where all of them would tell no more and take longer."""

from typing import Final

import numpy as np

from truearm.types import Rows

MOST_ROWS: Final = 60
"""How many there are where nothing else is asked for."""


def some_rows(rows: Rows, most: int = MOST_ROWS) -> Rows:
    """At most so many of row indices, spread evenly."""
    return rows[np.unique(np.linspace(0, len(rows) - 1, most).astype(np.int64))]
