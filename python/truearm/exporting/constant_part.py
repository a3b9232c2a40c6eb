"""The constant part of a calibration as a robot of its own."""

from dataclasses import replace
from typing import Final

from truearm.calibration import Calibration
from truearm.fits.models import CONSTANT
from truearm.robot import Robot

HASH_DIGITS: Final = 12


def constant_robot(calibration: Calibration) -> Robot:
    """The arm with the constants of the constant model in its table.

    These were fitted to serve alone; those under a field were not. Where the base was corrected like a link
    (`--frame world`), it is in the fixed transform before the first link.
    """
    nominal, constants = calibration.robot, calibration.models[CONSTANT].constants
    source = f"calibrated by truearm {calibration.version}, data {calibration.data_hash[:HASH_DIGITS]}"
    return replace(
        nominal,
        source=f"{source}; nominal: {nominal.source}" if nominal.source else source,
        table=constants[calibration.arm.links],
        base=calibration.arm.bases(constants[None])[0],
        base_row=None,
    )
