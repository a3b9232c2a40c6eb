"""Where features lay in the rows that a calibration learned from, which outlasts these rows."""

from typing import TYPE_CHECKING, Final

import numpy as np

from truearm.fits.fitting import feature_values

if TYPE_CHECKING:
    from truearm.calibration import Calibration

Span = tuple[float, float]

UNKNOWN: Final[tuple[Span, ...]] = ()


def learnt_spans(calibration: "Calibration") -> tuple[Span, ...]:
    """Lowest and highest value of each feature that a field was learned with, in its order.

    Those of files of earlier versions, which do not hold them, are those of their rows; none without them.
    """
    details, rows = calibration.variable, calibration.learned_from
    if details is None or not calibration.options.features:
        return UNKNOWN
    if details.feature_lowest is not None:
        highest = np.add(details.feature_lowest, details.feature_ranges)
        return tuple(zip(details.feature_lowest, highest.tolist(), strict=True))
    if rows is None:
        return UNKNOWN
    values = feature_values(rows.data, calibration.options.features)
    return tuple(zip(values.min(axis=0).tolist(), values.max(axis=0).tolist(), strict=True))
