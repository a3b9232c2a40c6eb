"""The transform of one Denavit-Hartenberg row, by the compiled core's own formula."""

import numpy as np
from numpy.typing import NDArray

from truearm._core import Chain


def row_transform(row: NDArray[np.float64], convention: str) -> NDArray[np.float64]:
    """Transform (4, 4) of a row (5,) theta, d, a, alpha, beta in rad and m, joint value zero."""
    link = Chain(convention, ["revolute"], row.reshape(1, 5), np.eye(4), np.eye(4))
    return np.asarray(link.pose(np.zeros((1, 1)))[0], dtype=np.float64)
