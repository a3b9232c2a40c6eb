"""What can be done about targets that are refused: options that allow more, and what to measure."""

from collections.abc import Collection, Sequence
from typing import Final

UNSURE: Final = 8
"""Code of refusals where the calibration is less certain than allowed."""
FRAMES_UNSURE: Final = 0
"""Code of refusals where it is certain enough, but not together with tool and work object."""
NOT_REACHED: Final = (2, 3)
TOO_FAR: Final = 5
ALLOWING: Final = {
    TOO_FAR: "--largest-joint-deg",
    6: "--largest-mm",
    7: "--largest-deg",
    UNSURE: "--largest-std-mm",
    FRAMES_UNSURE: "--largest-std-mm",
}
"""The option that allows more, by the code of a refusal."""
KEEP_NOMINAL: Final = "keep-nominal"


def what_helps(codes: Collection[int], beyond: Sequence[str], *, positions_only: bool) -> str:
    """What can be done about refusals: bounds that have an option may be allowed more.

    Args:
        codes: The codes of all refusals.
        beyond: In words, features that lie beyond what the calibration was fitted to.
        positions_only: Whether it was fitted to positions alone.
    """
    helping = dict.fromkeys(option for code, option in ALLOWING.items() if code in codes)
    options = " or ".join(helping)
    allow = f", or allow more with {options}" if options else ""
    away = ". No option allows a tool to stay away" if set(codes).intersection(NOT_REACHED) else ""
    keep = f"--on-refusal {KEEP_NOMINAL} leaves such targets as they are where that makes no step"
    again = ". Touches further apart, and more of them, tell tools and work objects better"
    frames = again if FRAMES_UNSURE in codes else ""
    unsure = _why_unsure() if UNSURE in codes and positions_only and not beyond else ""
    return f"{measured_there(beyond)}Change them{allow}; {keep}{away}{unsure}{frames}"


def measured_there(beyond: Sequence[str]) -> str:
    """Features far off, before all else: what is refused may be nothing but their guesses."""
    return f"{'; '.join(beyond)}: measure there, or give what the arm has. " if beyond else ""


def _why_unsure() -> str:
    """What can be done where the calibration is unsure because it knows positions alone."""
    return (
        ". This calibration knows positions alone, so it is sure of tools near the points that were "
        "measured: state the program's tool (tool of the robot file, --frames), measure orientation "
        "too or more points on the tool, or allow more with --largest-std-mm"
    )
