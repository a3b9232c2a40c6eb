"""Whether the device measures in the base's frame, as it should where the world is known."""

from dataclasses import replace
from typing import Final

from truearm.doubts.of_results import ANOTHER_FRAME
from truearm.errors import Notice, TruearmError
from truearm.fits.fitting import Task, fit_rows
from truearm.fits.identified import IdentifiedArm
from truearm.fits.models import CONSTANT
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.units import MM_PER_METRE
from truearm.update_words import FIVE_OF_SIX

BETTER: Final = 0.7
"""Part of what constants leave, from which on a frame that is found does better: half of the variance, which
the few unknowns more do not take away by chance."""


def another_frame(task: Task, rows: Measurements, left_m: float) -> list[Notice]:
    """A notice where constants with a frame that is found leave far less than a fit in a known world.

    The row of the base corrects five of the six freedoms of a frame, and deviations from nominal alone.

    Args:
        task: What was fitted.
        rows: To what, without the drift.
        left_m: Standard deviation of a coordinate that the fit leaves, m.
    """
    if not task.arm.world_is_known or task.selection.distances:
        return []
    arm = IdentifiedArm(task.arm.robot, "free", task.arm.parallel_within_deg)
    options = replace(task.options, model=CONSTANT, frame="free", features=())
    try:
        found_m = fit_rows(replace(task, arm=arm, options=options), rows).constant.noise[0]
    except TruearmError:
        # Rows in which no frame can be found are no nearer to one.
        return []
    if found_m > BETTER * left_m:
        return []
    with_frame, as_it_is = (length_mm(MM_PER_METRE * left, 3) for left in (found_m, left_m))
    text = (
        f"With a frame that is found constants leave {with_frame} per coordinate, and this calibration, with "
        f"the world as frame, leaves {as_it_is}: the device does not measure in the frame of the base. Leave "
        "--frame world out (frame='free'), which finds where it stands, or measure in that frame. "
        f"{FIVE_OF_SIX}"
    )
    return [Notice(ANOTHER_FRAME, text)]
