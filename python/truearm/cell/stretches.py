"""The calibration so far, after every stretch of poses, and whether it is good enough to stop."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from truearm.calibrating import calibrate
from truearm.calibration import Calibration
from truearm.cell.accepted import measurements_of
from truearm.cell.cell_file import Cell
from truearm.cell.session import Session
from truearm.defaults import NO_DRIFT
from truearm.errors import TruearmError
from truearm.units import MM_PER_METRE

LEAST_POSES: Final = 15
LEAST_FOR_VARIABLE: Final = 60
GROWTH: Final = 1.25
MOST_POSES: Final = 2000
STRETCHES_TO_STOP: Final = 2
SHOWN_POSES: Final = 300


@dataclass(frozen=True, eq=False)
class Stretch:
    """What the calibration so far is worth.

    Attributes:
        measured: How many poses it comes from.
        model: "constant" or "variable".
        mean_mm: Mean error on poses held out.
        p95_mm: 95th percentile of it.
        expected_mm: Expected error over all poses of the list, measured or not: root of the summed variances
            of the position and of what no model explains.
        calibration: The calibration.
    """

    measured: int
    model: Literal["constant", "variable"]
    mean_mm: float
    p95_mm: float
    expected_mm: float
    calibration: Calibration


def boundaries(stretch: int, total: int) -> list[int]:
    """Numbers of measured poses after which to calibrate; they grow, so that the cost a pose stays small."""
    found, at = [], stretch
    while stretch and at <= min(total, MOST_POSES):
        if at >= LEAST_POSES:
            found.append(at)
        at = max(at + stretch, int(GROWTH * at))
    return found


def calibrate_so_far(
    cell: Cell, session: Session, measured: int, note: Callable[[str, str], None]
) -> Stretch | None:
    """Calibrate with the first `measured` poses; None if that cannot be done yet, which is noted.

    What drifts is left in: the cell is to stand still, and the accuracy to stop at is that of its readings.
    """
    model = cell.file.process.model if measured >= LEAST_FOR_VARIABLE else "constant"
    try:
        calibration = calibrate(
            cell.arm, measurements_of(session, most=measured), model=model, by_purpose=False, drift=NO_DRIFT
        )
        expected_mm = _expected_mm(calibration, session)
    except Exception as error:  # noqa: BLE001 - measuring goes on, whatever a calibration so far fails at
        said = str(error) if isinstance(error, TruearmError) else f"{type(error).__name__}: {error}"
        note("calibration", f"not yet: {said}")
        return None
    errors = calibration.validation.holdout[model].position
    return Stretch(measured, model, errors.mean, errors.p95, expected_mm, calibration)


def good_enough(session: Session, target_mm: float | None) -> bool:
    """Whether the last two stretches both meet the target, held-out and expected error alike."""
    if target_mm is None:
        return False
    rows = session.rows(
        "SELECT p95_mm, expected_mm FROM stretches ORDER BY measured DESC LIMIT ?", (STRETCHES_TO_STOP,)
    )
    return len(rows) == STRETCHES_TO_STOP and all(max(row) <= target_mm for row in rows)


def _expected_mm(calibration: Calibration, session: Session) -> float:
    readings = np.array([step.readings for step in session.steps("pose")])
    chosen = readings[np.linspace(0, len(readings) - 1, min(len(readings), SHOWN_POSES)).astype(np.int64)]
    variances = np.square(calibration.position_std(chosen)).sum(axis=1)
    # Standard deviations of constants hold all that they leave unexplained.
    left = 0.0 if calibration.variable is None else calibration.variable.unexplained_m
    return float(MM_PER_METRE * np.sqrt(variances.mean() + 3.0 * left**2))
