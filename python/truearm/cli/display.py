"""What is under way, on stderr: bars on a terminal, rare lines elsewhere, both once it has taken a second."""

import sys
import threading
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from truearm.cli.console import on_terminal, tell

if TYPE_CHECKING:
    from rich.progress import Progress

PATIENCE_S: Final = 1.0
ON_TERMINAL_S: Final = 0.2
IN_LOG_S: Final = 10.0
BAR_WIDTH: Final = 20
STEPS: Final = 1000
TEXT_WIDTH: Final = 34
RENEWED: Final = "\r\x1b[K\x1b[?25h"  # an empty line, and the cursor that bars hide


@dataclass(eq=False)
class Work:
    """Something under way of which nobody knows how much there is.

    Attributes:
        text: What is being done.
        began: When it began.
    """

    text: str
    began: float = field(default_factory=time.monotonic)

    @property
    def elapsed_s(self) -> float:
        """Time since it began."""
        return time.monotonic() - self.began

    @property
    def share(self) -> float | None:
        """Which part of it is done, 0 to 1; None where nobody can know."""
        return None

    @property
    def left_s(self) -> float | None:
        """Time left; None where nobody can know."""
        return None

    @property
    def words(self) -> list[str]:
        """The part that is done and the time left, or the time that has gone."""
        part, left = self.share, self.left_s
        known = [] if part is None else [f"{100.0 * part:.0f} %"]
        return [*known, in_words(self.elapsed_s) if left is None else f"{in_words(max(left, 0.0))} left"]


@dataclass(eq=False)
class Counted(Work):
    """Work whose parts are counted; the time left is by the pace so far.

    Attributes:
        done: Parts that are done.
        total: Parts in all.
        known_left_s: Time left as whoever does the work knows it.
        before: Parts that were done when it began, as where interrupted work goes on.
    """

    done: float = 0.0
    total: float = 1.0
    known_left_s: float | None = None
    before: float = 0.0

    @property
    def share(self) -> float | None:
        """Which part of it is done, 0 to 1."""
        return self.done / self.total if self.total else None

    @property
    def left_s(self) -> float | None:
        """Time left; None before anything is done."""
        done = self.done - self.before
        if self.known_left_s is not None or not done:
            return self.known_left_s
        return self.elapsed_s * (self.total - self.done) / done


@dataclass(eq=False)
class Expected(Work):
    """A stage of a work whose stages took so long the last time; what is told is about all of them.

    Attributes:
        before_s: What the stages before it took then.
        this_s: What it took.
        after_s: What the stages behind it took.
    """

    before_s: float = 0.0
    this_s: float = 0.0
    after_s: float = 0.0

    @property
    def share(self) -> float | None:
        """Which part of the whole work is done, 0 to 1."""
        whole = self.before_s + self.this_s + self.after_s
        return (self.before_s + min(self.elapsed_s, self.this_s)) / whole if whole else None

    @property
    def left_s(self) -> float | None:
        """Time left of the whole work; None when the stage takes longer than then."""
        over = self.elapsed_s > self.this_s
        return None if over else self.this_s - self.elapsed_s + self.after_s


def in_words(seconds: float) -> str:
    """A time as people say it."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"


class Display:
    """Shows all works that have begun and not ended; one thread, which lives as long as there are any."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._works: list[Work] = []
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def current(self) -> Work | None:
        """The work that began last."""
        return self._works[-1] if self._works else None

    def begin(self, work: Work) -> None:
        """Show a work from now on."""
        with self._lock:
            self._works.append(work)
            if self._thread is None:
                self._ended = threading.Event()
                self._thread = threading.Thread(target=self._show, args=(self._ended,), daemon=True)
                self._thread.start()

    def end(self, work: Work) -> None:
        """Show a work no longer, nor what began within it and did not end."""
        with self._lock:
            if work in self._works:
                del self._works[self._works.index(work) :]
            if self._works:
                return
            thread, self._thread = self._thread, None
        self._ended.set()
        if thread is not None:
            thread.join()

    def clear(self) -> None:
        """Show nothing any longer."""
        if self._works:
            self.end(self._works[0])

    def _show(self, ended: threading.Event) -> None:
        if ended.wait(PATIENCE_S):
            return
        if on_terminal():
            self._draw_until(ended)
        else:
            self._tell_until(ended)

    def _tell_until(self, ended: threading.Event) -> None:
        last = ""
        while True:
            work = self.current
            line = "" if work is None else f"{_capital(work.text)} ... {', '.join(work.words)}"
            if line and line != last:
                tell(line)
                last = line
            if ended.wait(IN_LOG_S):
                return

    def _draw_until(self, ended: threading.Event) -> None:
        bars = _bars()
        with bars:
            while not ended.is_set():
                with self._lock:
                    works = list(self._works)
                _redraw(bars, works)
                ended.wait(ON_TERMINAL_S)
            _redraw(bars, [])


DISPLAY: Final = Display()


def put_away() -> None:
    """Leave the terminal as it was, before the process ends at once."""
    if on_terminal():
        sys.stderr.write(RENEWED)
        sys.stderr.flush()


def _bars() -> "Progress":
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(BAR_WIDTH),
        TextColumn("{task.fields[state]}", markup=False),
        console=Console(stderr=True, highlight=False),
        auto_refresh=False,
        transient=True,
        redirect_stdout=False,
    )


def _redraw(bars: "Progress", works: list[Work]) -> None:
    for task in bars.task_ids:
        bars.remove_task(task)
    for work in works:
        text, part = _capital(work.text), work.share
        shown = text if len(text) <= TEXT_WIDTH else f"{text[: TEXT_WIDTH - 1]}…"
        bars.add_task(
            shown,
            total=None if part is None else STEPS,
            completed=round(STEPS * (part or 0.0)),
            state="  ".join(work.words),
        )
    bars.refresh()


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
