"""What became of the outliers of a calibration in its fits, as it is said everywhere."""

from typing import TYPE_CHECKING, Final

from truearm.defaults import ROBUST

if TYPE_CHECKING:
    from truearm.calibration import Calibration

TAKEN_OUT: Final = "taken out of the fits"
LESS_WEIGHT: Final = "given less weight in the fit"
FULL_WEIGHT: Final = "kept at full weight in the fit"
OF_CONSTANTS: Final = f"{LESS_WEIGHT} of the constants"


def fate_of_outliers(calibration: "Calibration") -> str:
    """One of the above: the field is without them, robust losses bear on constants, all others keep them."""
    if calibration.variable is not None:
        return TAKEN_OUT
    if calibration.options.robust == ROBUST:
        return FULL_WEIGHT
    return LESS_WEIGHT if calibration.scheme is None else OF_CONSTANTS


def taken_out(calibration: "Calibration") -> int:
    """How many outliers the fits are without; none of models that keep them."""
    rows = calibration.rows
    return 0 if rows is None or fate_of_outliers(calibration) != TAKEN_OUT else len(rows.outliers())
