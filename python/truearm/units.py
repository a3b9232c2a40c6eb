"""Units at the edges: metres and radians per unit that a file or an option states; imports nothing heavy."""

import math
from typing import TYPE_CHECKING, Final, Literal, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LengthUnit = Literal["m", "mm"]
StatedLengthUnit = Literal["in", "m", "mm"]
AngleUnit = Literal["rad", "deg"]

LENGTH_UNITS: Final = ("m", "mm")
STATED_LENGTH_UNITS: Final = ("in", *LENGTH_UNITS)
"""What a table that is brought in may be in."""
ANGLE_UNITS: Final = ("rad", "deg")
RADIANS_PER_DEGREE: Final = math.pi / 180.0
MM_PER_METRE: Final = 1e3
MM_PER_INCH: Final = 25.4

Number = TypeVar("Number", float, "NDArray[np.float64]")


def to_si(value: Number, unit: str) -> Number:
    """`value` in metres or radians; millimetres are divided, so that decimal ones stay exact.

    Raises:
        KeyError: If `unit` is none of m, mm, in, rad and deg.
    """
    if unit == "in":
        return value * MM_PER_INCH / MM_PER_METRE
    if unit == "mm":
        return value / MM_PER_METRE
    if unit == "deg":
        return value * RADIANS_PER_DEGREE
    if unit in ("m", "rad"):
        return value
    raise KeyError(unit)
