"""Progress of a measurement process on stderr: a line that is renewed, or one for each step in a log."""

import sys
from types import TracebackType
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from truearm.cell.measuring import Progress


class Teller:
    """Tells what was done last, how far it is, and the time left."""

    def __init__(self) -> None:
        self._on_terminal = sys.stderr.isatty()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._on_terminal:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()

    def tell(self, progress: "Progress") -> None:
        """Show where the process is."""
        left = "" if progress.left_s is None else f", {_time(progress.left_s)} left"
        text = f"{progress.done}/{progress.total}{left}: {progress.text}"
        sys.stderr.write(f"\r\x1b[K{text[:120]}" if self._on_terminal else f"{text}\n")
        sys.stderr.flush()


def _time(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"
