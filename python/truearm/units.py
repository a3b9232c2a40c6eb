"""Units at the edges: metres and radians per unit that a file or an option states; imports nothing heavy."""

import math
import re
from typing import TYPE_CHECKING, Final, Literal, TypeVar, get_args

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LengthUnit = Literal["m", "mm"]
StatedLengthUnit = Literal["in", "m", "mm"]
AngleUnit = Literal["rad", "deg"]

LENGTH_UNITS: Final = get_args(LengthUnit)
STATED_LENGTH_UNITS: Final = get_args(StatedLengthUnit)
"""What a table that is brought in may be in."""
ANGLE_UNITS: Final = get_args(AngleUnit)
RADIANS_PER_DEGREE: Final = math.pi / 180.0
FULL_TURN: Final = 2.0 * math.pi
"""In radians."""
MM_PER_METRE: Final = 1e3
MRAD_PER_RAD: Final = 1e3
MM_PER_INCH: Final = 25.4

HEADER_UNITS: Final = {
    word: unit
    for unit, words in {
        "deg": ("deg", "degs", "degree", "degrees", "°"),
        "rad": ("rad", "rads", "radian", "radians"),
        "mrad": ("mrad",),
        "mm": ("mm", "millimeter", "millimeters", "millimetre", "millimetres"),
        "cm": ("cm", "centimeter", "centimeters", "centimetre", "centimetres"),
        "m": ("m", "meter", "meters", "metre", "metres"),
        "um": ("um", "\N{MICRO SIGN}m", "\N{GREEK SMALL LETTER MU}m"),
        "in": ("in", "inch", "inches"),
    }.items()
    for word in words
}
"""Units as headers of other people's tables write them; some of them nothing can be stated in."""
BEHIND_A_NAME: Final = re.compile(r"(?<=\S)[\s_/.,;:-]+([^\W\d_]+|°)$")
IN_BRACKETS: Final = re.compile(r"[\[({<]\s*([^\W\d_]+|°)\s*[\])}>]")

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


def bare_unit(text: str) -> str:
    """A text in small letters, without brackets around it, as words of units are compared."""
    return text.strip(" []()").casefold()


def unit_in_header(name: str) -> str:
    """The unit that a column's name says in brackets or at its end, as in "J1 [deg]" and "x_mm"; "" if none.

    A last word "in" is no unit: it is mostly the word.
    """
    bracketed = [HEADER_UNITS.get(word.lower(), "") for word in IN_BRACKETS.findall(name)]
    behind = BEHIND_A_NAME.search(name.strip())
    last = behind[1].lower() if behind else ""
    return next(filter(None, bracketed), "" if last == "in" else HEADER_UNITS.get(last, ""))
