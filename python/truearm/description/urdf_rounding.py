"""Right angles that a URDF writes with few digits, such as 1.57."""

import math
from collections.abc import Iterable
from typing import Final

TOLD_FROM_RAD: Final = 5e-5
"""Below this, 0.05 mm in a metre, rounding is not told: 1.5708 is off by 4e-6 rad."""


def rounded_by(angles: Iterable[str]) -> float:
    """By how much, rad, these rpy texts are off the right angles they mean at most; 0 where none is rounded.

    Angles that are neither the nearest with their digits nor cut off are meant as they are, as those of
    calibrated arms.
    """
    return max((_off(word) for text in angles for word in text.split()), default=0.0)


def _off(word: str) -> float:
    _, point, digits = word.partition(".")
    if not point or not digits.isdigit() or len(digits) < 2:
        return 0.0
    value = float(word)
    quarters = round(value / (0.5 * math.pi))
    beyond = abs(value) - 0.5 * math.pi * abs(quarters)
    last = 10.0 ** -len(digits)
    rounded = quarters != 0 and -last < beyond <= 0.5 * last
    return abs(beyond) if rounded and abs(beyond) >= TOLD_FROM_RAD else 0.0
