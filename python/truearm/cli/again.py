"""Commands that calibrate once more as a calibration was made."""

import inspect
from typing import TYPE_CHECKING, Any, Final

from truearm.errors import typed

if TYPE_CHECKING:
    from truearm.calibration import Calibration
    from truearm.options import Options

RENAMED: Final = {"most_regions": "regions"}
"""Options of a calibration that the command calls otherwise."""
SOME_FILE: Final = "OLD.csv"


def calibrate_again(calibration: "Calibration", robot: str | None, more: str) -> str:
    """The command that calibrates from the same files and others, with the options that were no defaults.

    Args:
        calibration: That is made again.
        robot: Name or file of the arm, where it is known.
        more: File of other measurements.
    """
    from truearm.cli.naming import name_of

    files = [SOME_FILE] if calibration.rows is None else calibration.rows.data.files
    words = [robot or name_of(calibration.robot), *files, more, *option_words(calibration.options)]
    return f"truearm calibrate {' '.join(typed(word) for word in words)} -o result"


def option_words(options: "Options") -> list[str]:
    """The options as `truearm calibrate` takes them, those that are no defaults."""
    from truearm.cli.calibrate import command
    from truearm.options import Options

    taken = inspect.signature(command).parameters
    usual, words = Options().to_dict(), list[str]()
    for name, value in options.to_dict().items():
        called = RENAMED.get(name, name)
        if name != "holdout" and called in taken and value != usual[name]:
            words += [_option(called), _word(value)]
    if not options.split.by_purpose and options.split.holdout_range is None:
        words += [_option("holdout"), _word(options.split.holdout)]
    return words if options.refit else [*words, _option("no_refit")]


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _word(value: Any) -> str:  # noqa: ANN401
    return ",".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
