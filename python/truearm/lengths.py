"""Lengths in words: in mm, and in m where they are long, whatever their digits without an exponent."""

from typing import Final

from truearm.units import MM_PER_METRE

IN_METRES_MM: Final = 10_000.0
"""Lengths from here on are said in m."""
MOST_DIGITS: Final = 12


def length_mm(value: float, digits: int) -> str:
    """A length of `value` mm with so many significant digits: "1020 mm", "131.2 m"."""
    shown, unit = (value, "mm") if abs(value) < IN_METRES_MM else (value / MM_PER_METRE, "m")
    return f"{float(f'{shown:.{digits}g}'):.{MOST_DIGITS}g} {unit}"


def distance_mm(value: float) -> str:
    """A distance of `value` mm with two decimals: "24.98 mm"; a long one with four digits: "131.2 m"."""
    return f"{value:.2f} mm" if abs(value) < IN_METRES_MM else length_mm(value, 4)


def how_far(distance: float, turn: float | None) -> str:
    """A distance in mm and, where one is known, a turn in mrad: "24.98 mm", "0.02 mm, 87.3 mrad"."""
    return distance_mm(distance) if turn is None else f"{distance_mm(distance)}, {turn:.1f} mrad"
