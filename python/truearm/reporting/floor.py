"""The noise floor: what an error would be if the model were perfect."""

import numpy as np
from numpy.typing import NDArray

from truearm.reporting.facts import Facts
from truearm.units import MM_PER_METRE
from truearm.validation import mean_distance

Floats = NDArray[np.float64]


def distance_at_floor_mm(facts: Facts) -> float:
    """Mean position error that the unexplained part, and the rows' own sigma, alone would leave, mm."""
    noise = float(np.mean(np.hypot(facts.summary["noise_mm"], stated_sigma_mm(facts))))
    return mean_distance(noise, distances=facts.calibration.selection.distances)


def stated_sigma_mm(facts: Facts) -> Floats | float:
    """What rows (n,) say of their own noise, mm; zero where they say nothing."""
    rows = facts.calibration.rows
    if rows is None or rows.data.sigma_m is None:
        return 0.0
    return np.asarray(MM_PER_METRE * np.nan_to_num(rows.data.sigma_m))
