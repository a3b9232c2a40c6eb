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
COLUMN_LENGTH_UNITS: Final = ("cm", "um", *STATED_LENGTH_UNITS)
COLUMN_ANGLE_UNITS: Final = ("mrad", *ANGLE_UNITS)
"""What a single column of such a table may be in."""
RADIANS_PER_DEGREE: Final = math.pi / 180.0
FULL_TURN: Final = 2.0 * math.pi
"""In radians."""
MM_PER_METRE: Final = 1e3
MRAD_PER_RAD: Final = 1e3
MM_PER_INCH: Final = 25.4
CM_PER_METRE: Final = 1e2
UM_PER_METRE: Final = 1e6

HEADER_UNITS: Final = {
    word: unit
    for unit, words in {
        "deg": ("deg", "degs", "degree", "degrees", "°", "\N{MASCULINE ORDINAL INDICATOR}"),
        "mdeg": ("mdeg",),
        "arcmin": ("arcmin",),
        "arcsec": ("arcsec",),
        "gon": ("gon", "gons"),
        "mgon": ("mgon",),
        "grad": ("grad", "grads"),
        "rad": ("rad", "rads", "radian", "radians"),
        "mrad": ("mrad",),
        "urad": ("urad", "\N{MICRO SIGN}rad", "\N{GREEK SMALL LETTER MU}rad"),
        "mm": ("mm", "millimeter", "millimeters", "millimetre", "millimetres"),
        "cm": ("cm", "centimeter", "centimeters", "centimetre", "centimetres"),
        "m": ("m", "meter", "meters", "metre", "metres"),
        "um": ("um", "\N{MICRO SIGN}m", "\N{GREEK SMALL LETTER MU}m"),
        "nm": ("nm",),
        "dm": ("dm",),
        "in": ("in", "inch", "inches"),
        "ft": ("ft", "foot", "feet"),
    }.items()
    for word in words
}
"""Units as headers of other people's tables write them; some of them nothing can be stated in; grad is
degrees to some and gons to others."""
BEHIND_A_NAME: Final = re.compile(r"(?<=\S)[\s_/.,;:-]+([^\W\d_]+|°)$")
IN_BRACKETS: Final = re.compile(
    r"[\[({<]\s*"
    r"(?P<times>[x\u00d7*]?\d[\d.,/^*x\u00d7\u00b7eE+-]*\s*)?"
    r"(?P<unit>[^\W\d_\u00b2\u00b3]+|°)"
    r"(?P<power>\s*[/^*\u00b7\u00b2\u00b3][^\])}>]*)?"
    r"\s*[\])}>]"
)
"""A unit in brackets, alone or multiplied, as 1/10 mm and deg/s."""

PER_SI_UNIT: Final = {
    "cm": CM_PER_METRE,
    "mm": MM_PER_METRE,
    "um": UM_PER_METRE,
    "mrad": MRAD_PER_RAD,
}

Number = TypeVar("Number", float, "NDArray[np.float64]")


def to_si(value: Number, unit: str) -> Number:
    """`value` in metres or radians; millimetres and their like are divided, so that decimal ones stay exact.

    Raises:
        KeyError: If `unit` is none of COLUMN_LENGTH_UNITS and COLUMN_ANGLE_UNITS.
    """
    if unit == "in":
        return value * MM_PER_INCH / MM_PER_METRE
    if unit in PER_SI_UNIT:
        return value / PER_SI_UNIT[unit]
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

    Of a multiple it is all that stands in the brackets. A last word "in" is no unit: it is mostly the word.
    """
    bracketed = map(_unit_in_brackets, IN_BRACKETS.finditer(name))
    behind = BEHIND_A_NAME.search(name.strip())
    last = behind[1].lower() if behind else ""
    return next(filter(None, bracketed), "" if last == "in" else HEADER_UNITS.get(last, ""))


def _unit_in_brackets(found: re.Match[str]) -> str:
    """The unit that is found in brackets, all that is in them where it is multiplied; "" where it is none."""
    unit = HEADER_UNITS.get(found["unit"].lower(), "")
    return found[0][1:-1].strip() if unit and (found["times"] or found["power"]) else unit
