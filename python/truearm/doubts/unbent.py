"""Constants that rows far off do not bend, beside those of a calibration that keeps such rows."""

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from truearm.fits.fitted_rows import FittedRows
from truearm.fits.fitting import Fits, Task, fit_rows
from truearm.fits.models import CONSTANT
from truearm.stages import no_stages

if TYPE_CHECKING:
    from truearm.calibration import Calibration

UNBENT: Final = "cauchy"
"""Loss of constants that rows far off do not bend."""


def may_be_bent(found: "Calibration") -> bool:
    """Whether rows far off may have bent a calibration: the field is without them, constants are not."""
    return found.variable is None and found.options.robust != UNBENT


def unbent(task: Task, rows: FittedRows) -> Fits:
    """Constants that were fitted to the same rows by a robust loss."""
    options = replace(task.options, model=CONSTANT, robust=UNBENT)
    return fit_rows(replace(task, options=options, starts=(), stages=no_stages), rows.fitted)
