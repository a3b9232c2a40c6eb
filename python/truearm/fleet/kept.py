"""The directory of an arm's results, and whether they are those of the inputs at hand."""

import hashlib
import json
from pathlib import Path
from typing import Any, Final

from truearm.files import make_directory, write_whole
from truearm.fleet.inputs import Inputs
from truearm.fleet.rows import Row, row_of_made
from truearm.fleet.task import ArmMade
from truearm.result_names import CALIBRATION_NAME, REPORT_NAME, SUMMARY_NAME

ROW_NAME: Final = "arm.json"


def earlier_files(folder: Path) -> list[str]:
    """Names of the results of a finished run in the directory of an arm; none where no run finished it."""
    if not (folder / ROW_NAME).is_file():
        return []
    return [name for name in (CALIBRATION_NAME, SUMMARY_NAME, REPORT_NAME) if (folder / name).is_file()]


def kept_row(inputs: Inputs, output: Path) -> Row | None:
    """The row of an arm that was finished with the same inputs, options and version; None if it was not."""
    folder = output / inputs.entry.name
    try:
        content = json.loads((folder / ROW_NAME).read_text(encoding="utf-8"))
        calibration = hashlib.sha256((folder / CALIBRATION_NAME).read_bytes()).hexdigest()
        known = content["inputs_sha256"], content["calibration_sha256"]
        row: Row = content["row"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    wanted = [SUMMARY_NAME, *([REPORT_NAME] if inputs.entry.section.report else [])]
    whole = all((folder / name).is_file() for name in wanted)
    return row if whole and known == (inputs.digest, calibration) else None


def keep(inputs: Inputs, made: ArmMade, output: Path) -> Row:
    """Write an arm's results; its row.

    The row is written last: where it is, all is.

    Raises:
        InputError: If the directory may not be written to.
    """
    folder = output / inputs.entry.name
    make_directory(folder)
    for name in (ROW_NAME, REPORT_NAME):
        (folder / name).unlink(missing_ok=True)
    write_whole(folder / CALIBRATION_NAME, made.calibration)
    write_whole(folder / SUMMARY_NAME, _text(made.summary))
    if made.report is not None:
        write_whole(folder / REPORT_NAME, made.report)
    row = row_of_made(inputs.entry.name, made)
    digests = {
        "inputs_sha256": inputs.digest,
        "calibration_sha256": hashlib.sha256(made.calibration).hexdigest(),
    }
    write_whole(folder / ROW_NAME, _text({**digests, "row": row}))
    return row


def _text(content: Any) -> str:  # noqa: ANN401 - any JSON value
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
