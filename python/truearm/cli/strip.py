"""`truearm strip`: a calibration without its measurements, for controllers."""

from pathlib import Path
from typing import Annotated

import typer

from truearm.calibration import Calibration
from truearm.cli.console import say
from truearm.cli.interrupt import ends_promptly
from truearm.cli.progress import told_stages
from truearm.errors import UsageError


def command(
    calibration: Annotated[
        Path, typer.Argument(metavar="CALIB", help="A file that truearm calibrate wrote.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="Where it goes.")],
) -> None:
    """Leave the measurements out of a calibration, for a controller or for somebody else.

    What predicts and corrects stays, with bounds of the standard deviation; exact ones need the measurements.

    Example: truearm strip arm/calibration.calib -o arm/controller.calib
    """
    if output.exists() and output.samefile(calibration):
        raise UsageError(
            f"{output} is the calibration itself", where="-o", rule="The measurements would be lost"
        )
    known = Calibration.load(calibration)
    with ends_promptly(), told_stages()("bounding the standard deviation"):
        known.save(output, with_rows=False)
    before, after = calibration.stat().st_size, output.stat().st_size
    say(f"{output}: {after / 1e3:.0f} kB without the measurements, {before / 1e3:.0f} kB with them.")
