"""`truearm strip`: a calibration without its measurements, for controllers."""

from pathlib import Path
from typing import Annotated

import typer

from truearm.cli.arguments import AsJson, CalibFile
from truearm.cli.console import print_json, say, suggest
from truearm.cli.interrupt import ends_promptly
from truearm.cli.next_commands import serve_commands
from truearm.cli.progress import told_stages
from truearm.files import check_output


def command(
    calibration: CalibFile,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="Where it goes.")],
    as_json: AsJson = False,
) -> None:
    """Leave the measurements out of a calibration, for a controller or for somebody else.

    What predicts and corrects stays, with bounds of the standard deviation; exact ones need the measurements.

    Examples:
      truearm strip result/calibration.calib -o controller.calib
    """
    from truearm.calibration import Calibration

    check_output(output, calibration)
    known = Calibration.load(calibration)
    with ends_promptly(), told_stages()("bounding the standard deviation"):
        known.save(output, with_rows=False)
    before, after = calibration.stat().st_size, output.stat().st_size
    if as_json:
        print_json({"calibration": str(output), "bytes": after, "bytes_before": before})
        return
    say(f"{output}: {after / 1e3:.0f} kB without the measurements, {before / 1e3:.0f} kB with them.")
    suggest(*serve_commands(known, output))
