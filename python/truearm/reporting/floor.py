"""The noise floor: what an error would be if the model were perfect."""

from typing import Final

import numpy as np

from truearm.reporting.facts import Facts

MEAN_LENGTH: Final = float(np.sqrt(8.0 / np.pi))
"""Mean length of a vector of three normal coordinates of deviation one: the Maxwell distribution's."""
MEAN_SIZE: Final = float(np.sqrt(2.0 / np.pi))
"""The same of one coordinate, as of distances."""


def distance_at_floor_mm(facts: Facts) -> float:
    """Mean position error that the unexplained part alone would leave, mm."""
    factor = MEAN_SIZE if facts.calibration.selection.distances else MEAN_LENGTH
    return factor * float(facts.summary["noise_mm"])
