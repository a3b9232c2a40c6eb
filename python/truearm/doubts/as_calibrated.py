"""Whether an arm is still as it was calibrated, as far as rows of an evaluation tell."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.calibration import Calibration
from truearm.doubts.gross_rows import AXES, Expected, widened
from truearm.doubts.nominal_misfit import some_rows
from truearm.errors import Notice
from truearm.judgement.held_rows import HeldRows
from truearm.lengths import length_mm
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]

NOT_AS_CALIBRATED: Final = "not_as_calibrated"
AS_KNOWN: Final = 2.0
"""A calibration whose error is within this factor of that on its own held-out rows fits."""
WITHIN_95: Final = float(np.sqrt(7.815 / AXES))
"""Times its root mean square that 95 of 100 lengths of three normal coordinates are within."""
HALF: Final = 0.5
MOST_ROWS: Final = 200
"""Rows at the most that are compared with what was expected there."""


def not_as_calibrated(found: Expected, frame: Expected, held: HeldRows) -> list[Notice]:
    """A warning where the calibration plainly misses more than it knows of itself.

    The mean error is more than twice that on its own held-out rows, and most rows are beyond the 95 %
    intervals of its standard deviations and noise.

    Args:
        found: The judged rows, the model in the set-ups it is judged in.
        frame: The rows that found these set-ups, in the same ones.
        held: The judged rows with the errors that are published.
    """
    calibration, best = found.calibration, found.calibration.model_name
    known = calibration.validation.holdout.get(best)
    mean_mm = MM_PER_METRE * float(np.nanmean(held.errors[best].distance_m))
    if known is None or mean_mm <= AS_KNOWN * known.position.mean:
        return []
    share = _share_beyond(found, frame, held.errors[best].position)
    if share <= HALF:
        return []
    text = (
        "The arm, its tool or the set-up is not as it was calibrated, or the instrument scatters more: the "
        f"mean error is {length_mm(mean_mm, 4)}, {length_mm(known.position.mean, 4)} on the calibration's "
        f"own held-out rows, and {100.0 * share:.0f} % of the rows are farther off than its standard "
        "deviations and noise allow 5 % to be."
    )
    return [Notice(NOT_AS_CALIBRATED, text)]


def can_be_updated(calibration: Calibration) -> bool:
    """Whether an update can tell what moved: it needs standard deviations of the parameters."""
    return calibration.scheme is None and (
        calibration.variable is None or calibration.learned_from is not None
    )


def _share_beyond(found: Expected, frame: Expected, errors: Floats) -> float:
    """Share of rows whose errors (n, 3) are beyond their 95 % intervals."""
    beyond: list[bool] = []
    for rows in found.measured(errors):
        if not len(rows):
            continue
        some = some_rows(rows, MOST_ROWS)
        in_frame = frame.jacobian[frame.data.group == found.data.group[some[0]]]
        lengths = widened(errors[some], found.jacobian[some], in_frame)
        beyond += (lengths > WITHIN_95 * found.lengths_m(some)).tolist()
    return float(np.mean(beyond)) if beyond else 0.0
