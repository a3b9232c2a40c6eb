"""Shots of a pose that agree better with one another than with constants, which count them all the same."""

from typing import TYPE_CHECKING, Final

import numpy as np

from truearm.errors import Notice
from truearm.lengths import length_mm
from truearm.units import MM_PER_METRE
from truearm.validation import at_first_measured
from truearm.visits import means, pose_numbers

if TYPE_CHECKING:
    from truearm.calibration import Calibration

KIND: Final = "shots_agree"
FEWEST_POSES: Final = 10
"""Poses of several shots from which on their scatter is told from what the model leaves."""
AGREE: Final = 0.5
"""Ratio of the scatter of shots to what the model leaves below which they are not counted rightly."""


def shots_notices(found: "Calibration") -> list[Notice]:
    """A notice where standard errors of constants that were fitted alone count shots of a pose as poses.

    What an arm does not repeat, and no model holds, all shots of a pose share.
    """
    rows = found.rows
    if rows is None or found.variable is not None or found.selection.distances:
        return []
    missed = at_first_measured(rows.residual, rows.data, found.selection)
    clear = (rows.score <= 1.0) & np.isfinite(missed).all(axis=1)
    first = pose_numbers(rows.data.readings[clear], rows.data.group[clear])
    _, number, count = np.unique(first, return_inverse=True, return_counts=True)
    several = count > 1
    if several.sum() < FEWEST_POSES:
        return []
    missed, mine = missed[clear], several[number]
    apart = (missed - means(missed, number)[number])[mine]
    shots, poses = int(mine.sum()), int(several.sum())
    scatter_m = float(np.sqrt(np.square(apart).sum() / (3 * (shots - poses))))
    left_m = float(np.sqrt(np.square(missed[mine]).sum() / (3 * shots)))
    if scatter_m > AGREE * left_m:
        return []
    agree, left = (length_mm(MM_PER_METRE * value, 2) for value in (scatter_m, left_m))
    text = (
        f"Shots of a pose agree within {agree} in a coordinate, the model leaves {left}, which they share. "
        "Fitted alone, constants take each shot for a measurement of its own: their standard errors are up "
        f"to {np.sqrt(shots / poses):.1f} times too small."
    )
    return [Notice(KIND, text)]
