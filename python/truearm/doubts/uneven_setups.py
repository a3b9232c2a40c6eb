"""Set-ups whose rows scatter differently, as of two instruments, where no sigma tells the fit so."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.doubts.whitened import Whitened
from truearm.errors import Notice
from truearm.fits.fitted_rows import FittedRows
from truearm.lengths import length_mm
from truearm.types import AXES, Mask
from truearm.units import MM_PER_METRE

UNEVEN_SETUPS: Final = "uneven_setups"
WORSE: Final = 2.0
"""Times that a set-up scatters as much as another from which their noises have to be told apart."""
SURE: Final = 4.0
"""Standard errors of the logarithm of that ratio by which it is more than chance."""
QUARTILE: Final = 0.6745
"""Half of normal values are within so many standard deviations."""
ERROR_OF_MEDIAN: Final = 1.1664
"""Relative standard error of the median of absolute values, times the root of their number."""
LEAST_KEPT: Final = 0.05
"""Part of a coordinate's variance that is left of it at the least: what a fit follows tells nothing."""
MOSTLY: Final = 0.5
"""A set-up states its noise whose sigma is so large a part of its scatter."""

LITTLE_MM: Final = 0.001
"""A sigma for rows whose noise is that which all have: every row of the column needs one."""


@dataclass(frozen=True)
class Scattering:
    """How the rows of a set-up scatter about a model.

    Attributes:
        name: Name of the set-up.
        deviation: Standard deviation of a coordinate, over what the fit took for it.
        mm: The same of a single shot, in mm.
        error: Relative standard error of both.
        stated_mm: What half of the rows state as their sigma, or less.
    """

    name: str
    deviation: float
    mm: float
    error: float
    stated_mm: float

    def is_worse(self, than: "Scattering") -> bool:
        """Whether it surely scatters more than another, in mm and over what the fit knew."""
        ratio = min(self.deviation / than.deviation, self.mm / than.mm)
        return ratio > max(WORSE, float(np.exp(SURE * np.hypot(self.error, than.error))))

    def times(self, than: "Scattering") -> str:
        """How much more than another, in words."""
        return f"{self.name} {self.mm / than.mm:.2g} times as much as {than.name}"

    def beside(self, other: "Scattering") -> str:
        """What its rows should state beside the scatter that another has as well, in words."""
        return f"about {length_mm(float(np.sqrt(self.mm**2 - other.mm**2)), 2)} in the rows of {self.name}"


def uneven_setups(found: Calibration, fitted: FittedRows, seen: Whitened) -> list[Notice]:
    """A warning where rows of a set-up that state no sigma scatter far more than those of another.

    Args:
        found: The calibration.
        fitted: The rows that it was fitted to.
        seen: What it leaves of them.
    """
    names = fitted.data.group[seen.rows]
    every = [_scattering(fitted, seen, name, names == name) for name in found.groups if name in names]
    if len(every) < 2:
        return []
    best = min(every, key=lambda each: each.mm)
    worse = [each for each in every if each.is_worse(best) and each.stated_mm < MOSTLY * each.mm]
    if not worse:
        return []
    what = "Constants leave" if found.variable is None else "The model leaves"
    or_else = (
        " What constants leave may be the arm's, too: --model variable tells them apart."
        if found.variable is None
        else ""
    )
    text = (
        f"{what} set-ups that scatter differently, as those of different instruments do: "
        f"{'; '.join(each.times(best) for each in worse)}. Where rows do not state how far they may be off "
        "all count the same, and the good ones are spoilt. Give a column sigma_mm: "
        f"{', '.join(each.beside(best) for each in worse)}, in the others what their instrument's data sheet "
        f"says, or little ({LITTLE_MM:g} mm), since what all rows have in common is found beside it."
        f"{or_else}"
    )
    return [Notice(UNEVEN_SETUPS, text)]


def _scattering(fitted: FittedRows, seen: Whitened, name: str, own: Mask) -> Scattering:
    """That of the visits (v,) of a set-up, by medians: single rows may be far off."""
    held = seen.held[own]
    kept = np.maximum(seen.kept[own][held], LEAST_KEPT)
    deviation = float(np.median(np.abs(seen.left[own][held]) / np.sqrt(kept))) / QUARTILE
    of_visit, shots, single = (
        float(np.median(each[own][held])) for each in (seen.variance, seen.shots, seen.single)
    )
    # What the mean of its shots scatters beyond what was expected, each of them has of its own.
    square = max(single + shots * (deviation**2 - 1.0) * of_visit, deviation**2 * of_visit)
    error = ERROR_OF_MEDIAN / np.sqrt(AXES * len(held))
    data = fitted.data.select(seen.rows[own])
    stated = float(np.median(data.stated_sigma_m))
    mm = MM_PER_METRE * float(np.sqrt(square))
    return Scattering(name, deviation, mm, float(error), MM_PER_METRE * stated)
