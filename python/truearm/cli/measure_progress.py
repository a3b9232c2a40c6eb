"""Progress of a measurement process on stderr: a bar on a terminal, a line for each step in a log."""

from types import TracebackType
from typing import TYPE_CHECKING, Self

from truearm.cli.console import on_terminal, tell
from truearm.cli.display import DISPLAY, Counted, in_words

if TYPE_CHECKING:
    from truearm.cell.measuring import Progress


class Teller:
    """Tells what was done last, how far it is, and the time left."""

    def __init__(self) -> None:
        self._bar = Counted("measuring") if on_terminal() else None

    def __enter__(self) -> Self:
        if self._bar is not None:
            DISPLAY.begin(self._bar)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            DISPLAY.end(self._bar)

    def tell(self, progress: "Progress") -> None:
        """Show where the process is."""
        if self._bar is None:
            left = "" if progress.left_s is None else f", {in_words(progress.left_s)} left"
            tell(f"{progress.done}/{progress.total}{left}: {progress.text}")
            return
        self._bar.text, self._bar.done, self._bar.total = progress.text, progress.done, progress.total
        self._bar.known_left_s = progress.left_s
