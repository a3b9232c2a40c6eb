"""Which notices on a calibration are reason enough to look at the arm before it is used."""

from typing import Final

from truearm.calibrating import REFIT_ASTRAY
from truearm.calibration import Calibration
from truearm.doubts.few_judged import UNDECIDED
from truearm.doubts.held_tool import never_turns_freely
from truearm.doubts.masked_rows import BENT
from truearm.doubts.of_calibration import OPEN_SETUP
from truearm.doubts.of_results import COMPUTED, FAR_FROM_NOMINAL, ORIENTATION_MISFIT, SINGLE_ROWS, WOULD_FIT

GRAVE: Final = (COMPUTED, SINGLE_ROWS, BENT, *WOULD_FIT, FAR_FROM_NOMINAL, ORIENTATION_MISFIT, REFIT_ASTRAY)
"""Data or table are wrong, or of another arm, or what is wrong of them bends the calibration."""


def grave_notices(calibration: Calibration) -> list[str]:
    """What speaks against the data or the table of a calibration, or leaves its frame and target open.

    The poses are not to blame where these stay open on an arm that cannot turn its tool freely.
    """
    kinds = GRAVE if never_turns_freely(calibration.robot) else (*GRAVE, OPEN_SETUP)
    return [str(notice) for notice in calibration.notices if notice.kind in kinds]


def undecided_notice(calibration: Calibration) -> str:
    """That so few poses do not tell whether a calibration helps; empty where they do."""
    return next((str(notice) for notice in calibration.notices if notice.kind == UNDECIDED), "")
