"""Commands that use a calibration, as other commands propose them: none that would refuse it."""

from pathlib import Path
from typing import TYPE_CHECKING

from truearm.errors import typed

if TYPE_CHECKING:
    from truearm.calibration import Calibration


def compensate_commands(calibration: "Calibration", file: Path, more: str = "") -> list[str]:
    """The command that shows what a calibration does to a program, with more options, each after a space."""
    from truearm.programs.declaring import may_differ

    if not _corrects(calibration):
        return []
    declared = " --controller MODEL" if may_differ(calibration.robot) else ""
    return [f"truearm compensate {typed(file)} PROGRAM{declared}{_features(calibration)}{more} --dry-run"]


def serve_commands(calibration: "Calibration", file: Path) -> list[str]:
    """The command that corrects set-points with a calibration."""
    return [f"truearm serve {typed(file)}{_features(calibration)}"] if _corrects(calibration) else []


def _corrects(calibration: "Calibration") -> bool:
    """Whether anything is corrected with a calibration: compensation knows no scheme of the paper."""
    return calibration.scheme is None


def _features(calibration: "Calibration") -> str:
    """The options, each after a blank, that say the features of what varies."""
    names = calibration.options.features if calibration.model.field is not None else ()
    return "".join(f" --feature {typed(f'{name}=NUMBER')}" for name in names)
