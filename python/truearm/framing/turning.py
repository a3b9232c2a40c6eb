"""Whether a flange was turned enough to tell where a tool's point is in it."""

from typing import Final

import numpy as np

from truearm.errors import WorkError
from truearm.types import Floats

LEAST_TURN_DEG: Final = 3.0


def check_turned(apart: Floats, noun: str) -> None:
    """Raise WorkError unless every direction of the flange was turned.

    What rows say of a tool's point is how each turns it, less what they all share: where the touched point
    is, or where the device stands, is unknown too and takes that over.

    Args:
        apart: Orientation of the flange in each row, less the mean of those that share an unknown place
            (n, 3, 3).
        noun: What the rows are, for messages, such as "touches".
    """
    mean = np.einsum("nij,nik->jk", apart, apart) / len(apart)
    sizes, directions = np.linalg.eigh(mean)
    if np.sqrt(max(sizes[0], 0.0)) < np.radians(LEAST_TURN_DEG):
        x, y, z = directions[:, 0] * np.sign(directions[np.abs(directions[:, 0]).argmax(), 0])
        raise WorkError(
            f"the {noun} hardly turn the flange's direction [{x:.2f}, {y:.2f}, {z:.2f}]",
            rule="Where that direction does not move, the tool's length along it is not known either",
            way_out=f"Tilt the tool by 20 deg or more about two axes between {noun}",
        )
