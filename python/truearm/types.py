"""Types of arrays, named once, and how many numbers a position has."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Whole = NDArray[np.integer[Any]]
"""Integers of any width, as they come in."""
Rows = NDArray[np.int64]
"""Numbers of rows of a table, from 0."""
Mask = NDArray[np.bool_]
"""What holds of which."""
Texts = NDArray[np.str_]
Transform = NDArray[np.float64]
"""A homogeneous transform (4, 4), position in m."""
AXES: Final = 3
"""Coordinates of a position, and of a rotation vector."""
