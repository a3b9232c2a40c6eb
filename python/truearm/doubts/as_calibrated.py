"""Whether an arm is still as it was calibrated, as far as rows of an evaluation tell."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from truearm.calibration import Calibration
from truearm.doubts.gross_rows import Expected, widened
from truearm.doubts.of_results import helps
from truearm.doubts.outliers import Outliers, known_mean_mm, own_means_mm
from truearm.doubts.what_to_check import OF_FILE
from truearm.errors import Notice
from truearm.fits.models import NOMINAL
from truearm.judgement.held_rows import HeldRows
from truearm.lengths import length_mm
from truearm.rows.evenly import some_rows
from truearm.types import AXES, Floats
from truearm.units import MM_PER_METRE

NOT_AS_CALIBRATED: Final = "not_as_calibrated"
AS_KNOWN: Final = 2.0
"""A calibration whose error is within this factor of that on its own held-out rows fits; outliers are no part
of either."""
WITHIN_95: Final = float(np.sqrt(7.815 / AXES))
"""Times its root mean square that 95 of 100 lengths of three normal coordinates are within."""
HALF: Final = 0.5
TURNED_RAD: Final = 0.2
"""No joint is mastered anew by so much: errors beyond that part of how far the flange gets are of a file."""
MOST_ROWS: Final = 200
"""Rows at the most that are compared with what was expected there."""


def not_as_calibrated(
    found: Expected, frame: Expected, held: HeldRows, gross: Sequence[Mapping[str, Any]] = ()
) -> list[Notice]:
    """A warning where the calibration plainly misses more than it knows of itself.

    The mean error is more than twice that on its own held-out rows, outliers left out of both, and most rows
    are beyond the 95 % intervals of its standard deviations and noise.

    Args:
        found: The judged rows, the model in the set-ups it is judged in.
        frame: The rows that found these set-ups, in the same ones.
        held: The judged rows with the errors that are published.
        gross: Those of them that hold gross errors, each with file and row.
    """
    best, known_mm = found.calibration.model_name, known_mean_mm(found.calibration)
    all_mm = MM_PER_METRE * float(np.nanmean(held.errors[best].distance_m))
    mean_mm = held.means_without_mm(gross).get(best, all_mm)
    if known_mm is None or mean_mm <= AS_KNOWN * known_mm:
        return []
    share = _share_beyond(found, frame, held.errors[best].position)
    if share <= HALF:
        return []
    own = Outliers.of(found.calibration).means_mm
    here, there = (" without outliers" if each else "" for each in (gross, own))
    text = (
        "The arm, its tool or the set-up is not as it was calibrated, or the instrument scatters more: the "
        f"mean error{here} is {length_mm(mean_mm, 4)}, {length_mm(known_mm, 4)} on the calibration's own "
        f"held-out rows{there}, and {100.0 * share:.0f} % of the rows are farther off than its standard "
        "deviations and noise allow 5 % to be."
    )
    return [Notice(NOT_AS_CALIBRATED, text)]


def changed_since(calibration: Calibration, changed: list[Notice], held: HeldRows) -> list[Notice]:
    """What was `changed`, where a calibration is of no use that was of use on its own held-out rows.

    These prove the robot and its convention: what is wrong is the new file, or was changed since. Errors
    that no joint leaves which is mastered anew are those of a wrong file.

    Args:
        calibration: The calibration.
        changed: What not_as_calibrated says, if anything.
        held: The judged rows with their errors.
    """
    known, best, robot = own_means_mm(calibration), calibration.model_name, calibration.robot
    flange = robot.flange_chain.position(robot.joints_from_readings(held.readings))
    reach_mm = MM_PER_METRE * float(np.sqrt(flange.var(axis=0).sum()))
    is_proven = helps(known[NOMINAL], known[best])
    if not changed or not is_proven or held.median_mm(best) > TURNED_RAD * reach_mm:
        return []
    nominal, own = (length_mm(held.median_mm(name), 4) for name in (NOMINAL, best))
    tells = ": truearm update tells which" if can_be_updated(calibration) else ""
    text = (
        f"{changed[0]} Do not use it as it is: its median error is {own}, that of the nominal model "
        f"{nominal}. On its own held-out rows it helped, so robot and convention are right. If this file is "
        "as theirs was, joints were mastered anew, or the tool or another part was changed"
        f"{tells}. If it is not, check {OF_FILE}."
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
