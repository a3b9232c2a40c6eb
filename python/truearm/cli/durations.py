"""How long the stages of long work took the last time, so that the time left can be told.

A fit does not know when it will have converged; the best that can be said of its end is how long the same
work took before. It is kept in the user's cache directory and has no influence on any result.
"""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from truearm.errors import InputError
from truearm.files import write_whole

FILE: Final = "durations.json"
WORTH_KEEPING_S: Final = 2.0
NO_PLACE: Final = (OSError, InputError, RuntimeError)
"""What a cache directory raises that is not there, cannot be written, or has no home directory to be in."""


@dataclass(frozen=True)
class Took:
    """What the stages of some work took.

    Attributes:
        size: Of the work, in rows.
        stages: Names and seconds, in their order.
    """

    size: int
    stages: tuple[tuple[str, float], ...]

    def scaled(self, size: int) -> "Took":
        """What a work of another size will take, growing with it."""
        factor = size / self.size
        return Took(size, tuple((name, factor * seconds) for name, seconds in self.stages))


def remembered(work: str, size: int) -> Took | None:
    """What `work` took the last time, for `size` rows; None if it was never kept."""
    try:
        kept = _all()[work]
        took = Took(int(kept["size"]), tuple((str(name), float(seconds)) for name, seconds in kept["stages"]))
    except (KeyError, TypeError, ValueError):
        return None
    return took.scaled(size) if took.size > 0 else None


def remember(work: str, took: Took) -> None:
    """Keep what `work` took; where that cannot be written, no time is told the next time."""
    if sum(seconds for _, seconds in took.stages) < WORTH_KEEPING_S:
        return
    everything = {**_all(), work: {"size": took.size, "stages": took.stages}}
    with suppress(*NO_PLACE):
        place().parent.mkdir(parents=True, exist_ok=True)
        write_whole(place(), json.dumps(everything, indent=1) + "\n")


def place() -> Path:
    """Where durations are kept: below XDG_CACHE_HOME, or ~/.cache.

    Raises:
        RuntimeError: If there is no home directory.
    """
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "truearm" / FILE


def _all() -> Mapping[str, Any]:
    try:
        found = json.loads(place().read_text(encoding="utf-8"))
    except (*NO_PLACE, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
