"""How far what a model leaves scatters, and whether that is more than elsewhere."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.lengths import length_mm
from truearm.types import Floats

WORSE: Final = 2.0
"""Times that something scatters as much as another from which their noises have to be told apart."""
SURE: Final = 4.0
"""Standard errors of the logarithm of that ratio by which it is more than chance."""
QUARTILE: Final = 0.6745
"""Half of normal values are within so many standard deviations."""
ERROR_OF_MEDIAN: Final = 1.1664
"""Relative standard error of the median of absolute values, times the root of their number."""
LEAST_KEPT: Final = 0.05
"""Part of a value's variance that is left of it at the least: what a fit follows tells nothing."""
MOSTLY: Final = 0.5
"""Rows state their noise whose sigma is so large a part of their scatter."""
LITTLE: Final = 0.001
"""A sigma, mm or mrad, for rows whose noise is that which all have: every row of the column needs one."""
MM: Final = "mm"
MRAD: Final = "mrad"


@dataclass(frozen=True)
class Scattering:
    """How what is left of some rows scatters about a model.

    Attributes:
        name: What they are: a set-up, or an axis.
        deviation: Standard deviation of a component, over what the fit took for it.
        size: The same of a single shot, in `unit`.
        error: Relative standard error of both.
        stated: What half of the rows state as their sigma, or less, in `unit`.
        unit: "mm" of positions, "mrad" of orientations.
    """

    name: str
    deviation: float
    size: float
    error: float
    stated: float
    unit: str = MM

    @property
    def says_so(self) -> bool:
        """Whether rows state most of their scatter."""
        return self.stated >= MOSTLY * self.size

    def is_worse(self, than: "Scattering", worse: float = WORSE) -> bool:
        """Whether it surely scatters so much more than another, in its unit and over what the fit knew."""
        ratio = min(self.deviation / than.deviation, self.size / than.size)
        return ratio > max(worse, float(np.exp(SURE * np.hypot(self.error, than.error))))

    def times(self, than: "Scattering") -> str:
        """How much more than another, in words."""
        return f"{self.name} {self.size / than.size:.2g} times as much as {than.name}"

    def beyond(self, other: "Scattering") -> str:
        """What rows should state beside the scatter that another has as well, in words."""
        beyond = float(np.sqrt(self.size**2 - other.size**2))
        return f"about {length_mm(beyond, 2) if self.unit == MM else f'{beyond:.2g} {self.unit}'}"


def deviation_of(values: Floats) -> float:
    """Standard deviation of values, by their median: single ones may be far off."""
    return float(np.median(np.abs(values))) / QUARTILE


def single_shot(deviation: float, of_visit: float, shots: float, single: float) -> float:
    """Standard deviation of a single shot where the means of some deviate so much from what is expected.

    What such a mean scatters beyond that, each of its shots has of its own.

    Args:
        deviation: Over what the fit took for the noise of the mean.
        of_visit: Variance that it took for the mean.
        shots: How many there are.
        single: Variance that it took for one.
    """
    square = max(single + shots * (deviation**2 - 1.0) * of_visit, deviation**2 * of_visit)
    return float(np.sqrt(square))


def leaves(found: Calibration) -> str:
    """What is left is left by, in words."""
    return "Constants leave" if found.variable is None else "The model leaves"


def or_else(found: Calibration) -> str:
    """What else may be the cause of what constants leave, in words."""
    if found.variable is not None:
        return ""
    return " What constants leave may be the arm's, too: --model variable tells them apart."
