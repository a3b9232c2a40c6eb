"""Numbers as pages show and hold them: rounded, with units, and without what JSON has no word for."""

import re
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from truearm.types import Floats
from truearm.units import MM_PER_METRE, RADIANS_PER_DEGREE

LEAST_TOLD: Final = 1e-6
DECIMALS: Final = 3
CHANGE_DECIMALS: Final = 4
HARDLY_ANY: Final = "less than 1 %"
DIGITS: Final = 4
"""Significant digits of what figures are drawn from: finer than a pixel."""


def lean(values: ArrayLike, digits: int = DIGITS) -> list[Any]:
    """Values for JSON, rounded to significant digits; null where they are not finite. Keeps the shape."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim > 1:
        return [lean(row, digits) for row in array]
    return [None if not np.isfinite(value) else _rounded(value, digits) for value in array.tolist()]


def _rounded(value: float, digits: int) -> float | int:
    short = float(f"{value:.{digits}g}")
    return int(short) if short.is_integer() else short


def mm(length_m: float) -> str:
    """A length in mm, as tables show it, without the unit."""
    return fixed(length_m * MM_PER_METRE)


def fixed(value: float, decimals: int = DECIMALS) -> str:
    """A number of tables."""
    return f"{_no_minus_zero(value, decimals):.{decimals}f}"


def signed(value: float, decimals: int = CHANGE_DECIMALS) -> str:
    """A change in tables, with its sign."""
    return f"{_no_minus_zero(value, decimals):+.{decimals}f}"


def _no_minus_zero(value: float, decimals: int) -> float:
    """The rounded value; zero has no sign."""
    return round(value, decimals) + 0.0


def short(*values: float) -> list[str]:
    """Numbers of a sentence, with as many decimals as the smallest needs for two digits, at most three."""
    sizes = [abs(value) for value in values if value and np.isfinite(value)]
    decimals = 2 if not sizes else int(np.clip(1 - np.floor(np.log10(min(sizes))), 0, 3))
    return [f"{_no_minus_zero(value, decimals):.{decimals}f}" for value in values]


def without_zeros(words: str) -> str:
    """The same sentence, its decimals without zeros at their ends: "1.0000 deg" is "1 deg"."""
    return re.sub(r"(\d)(?:\.0+|(\.\d*?[1-9])0+)(?![\d.])", r"\1\2", words)


def significant(value: float) -> str:
    """A number whose unit is not known, such as a feature, with four significant digits."""
    return f"{value:.{DIGITS}g}"


def percent(share: float) -> str:
    """A share in percent: "64 %"; of one that is hardly any, "less than 1 %"."""
    return HARDLY_ANY if share < 0.005 else f"{100.0 * share:.0f} %"


def probability(p: float) -> str:
    """A probability: "0.034"; of one that says no more by being smaller, "< 1e-06"."""
    return f"{p:.2g}" if p >= LEAST_TOLD else f"< {LEAST_TOLD:g}"


def listed(words: Sequence[str], last: str = "and") -> str:
    """Words with commas and "and", or another word before the last."""
    return ", ".join(words[:-1]) + (f" {last} " if len(words) > 1 else "") + words[-1]


def shown_readings(readings: Floats, joints: Sequence[str]) -> Floats:
    """Joint readings (n, N) in deg, and mm for prismatic joints."""
    return np.asarray(readings / np.array([_per_unit(joint) for joint in joints]))


def unit_of(joint: str) -> str:
    """Unit that the readings of a joint are shown in."""
    return "mm" if joint == "prismatic" else "deg"


def _per_unit(joint: str) -> float:
    return 1.0 / MM_PER_METRE if joint == "prismatic" else RADIANS_PER_DEGREE
