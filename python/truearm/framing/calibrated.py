"""Where the calibrated arm puts a tool in measured rows."""

from truearm.calibration import Calibration
from truearm.fits.fitting import feature_values
from truearm.measurements import Measurements
from truearm.types import Floats


def calibrated_poses(calibration: Calibration, data: Measurements, flange_from_tool: Floats) -> Floats:
    """base_from_tool (n, 4, 4) of the calibrated arm."""
    names = calibration.options.features
    features = dict(zip(names, feature_values(data, names).T, strict=True))
    return calibration.pose(data.readings, tool=flange_from_tool, features=features or None)
