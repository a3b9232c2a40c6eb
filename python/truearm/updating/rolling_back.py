"""The calibration before an update, bit for bit."""

from pathlib import Path

from truearm.calibration import Calibration
from truearm.errors import UsageError
from truearm.files import write_whole


def roll_back(updated: str | Path, output: str | Path) -> str:
    """Write the file of the calibration before an update, bit for bit.

    Args:
        updated: File of an updated calibration.
        output: Where the one before goes; nothing may be there but the same bytes.

    Returns:
        Its SHA-256.

    Raises:
        InputError: If `updated` is no calibration.
        UsageError: If it was not updated, or something else is at `output`.
        WorkError: If what was before was left out of the file.
    """
    calibration = Calibration.load(updated)
    if calibration.revision is None:
        raise UsageError(
            "this calibration was not updated",
            where=str(updated),
            rule="Only what truearm update wrote can be rolled back",
        )
    content, place = calibration.revision.before(str(updated)), Path(output)
    if place.exists() and (not place.is_file() or place.read_bytes() != content):
        raise UsageError(
            "there is something else already", where=str(output), way_out="Name another file with -o"
        )
    write_whole(place, content)
    return calibration.revision.digest
