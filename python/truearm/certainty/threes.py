"""Rows of derivatives three at a time, the values of a point or of a rotation, as a posterior takes them."""

import numpy as np

from truearm.types import AXES, Floats


def in_threes(inputs: Floats, jacobian: Floats, setup: Floats | None) -> tuple[Floats, Floats, Floats | None]:
    """Inputs, and rows (n, m, ...) of derivatives, three at a time: m is a multiple of three."""
    return repeated(inputs, jacobian), threes(jacobian), None if setup is None else threes(setup)


def repeated(inputs: Floats, rows: Floats) -> Floats:
    """Inputs (n, I), once for every three rows (n, m, ...)."""
    return np.repeat(inputs, rows.shape[1] // AXES, axis=0)


def threes(rows: Floats) -> Floats:
    """Rows (n, m, k) three at a time, (n m / 3, 3, k)."""
    return np.ascontiguousarray(rows.reshape(-1, AXES, rows.shape[2]))
