"""The noise floor: what an error would be if the model were perfect."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.reporting.facts import Facts
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]

MEAN_LENGTH: Final = float(np.sqrt(8.0 / np.pi))
"""Mean length of a vector of three normal coordinates of deviation one: the Maxwell distribution's."""
MEAN_SIZE: Final = float(np.sqrt(2.0 / np.pi))
"""The same of one coordinate, as of distances."""


def distance_at_floor_mm(facts: Facts) -> float:
    """Mean position error that the unexplained part, and the rows' own sigma, alone would leave, mm."""
    factor = MEAN_SIZE if facts.calibration.selection.distances else MEAN_LENGTH
    return factor * float(np.mean(np.hypot(facts.summary["noise_mm"], stated_sigma_mm(facts))))


def stated_sigma_mm(facts: Facts) -> Floats | float:
    """What rows (n,) say of their own noise, mm; zero where they say nothing."""
    rows = facts.calibration.rows
    if rows is None or rows.data.sigma_m is None:
        return 0.0
    return np.asarray(MM_PER_METRE * np.nan_to_num(rows.data.sigma_m))
