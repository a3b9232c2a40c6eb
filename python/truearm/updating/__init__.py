"""An old calibration and a few new measurements: what moved, and whether the rest still holds."""

from truearm.updating.comparing import Update, update
from truearm.updating.options import UpdateOptions
from truearm.updating.rolling_back import roll_back

__all__ = ["Update", "UpdateOptions", "roll_back", "update"]
