"""Progress of long work on stderr: stages of it, and things that are counted."""

import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from truearm.cli.console import on_terminal
from truearm.cli.display import DISPLAY, Counted, Expected, Work
from truearm.cli.durations import Took, remember, remembered
from truearm.stages import Stages

ONE_OF: Final = re.compile(r"(?P<what>.*?)(?P<number>\d+) of (?P<total>\d+)(?: that are left)?")


def told_stages(work: str = "", size: int = 0) -> Stages:
    """Stages that say what is going on: a bar on a terminal, rare lines elsewhere.

    A stage whose name ends like "seed 3 of 20", or "seed 3 of 20 that are left", is one of a series, and the
    time left is told by the pace of the series. Of other stages nobody knows when they end; their time left
    is what the same work took the last time.

    Args:
        work: Names what takes as long again, such as "calibrate ur10 variable"; nothing is kept without it.
        size: Size of the work, in rows.
    """
    return _Stages(work, size)


def told_progress() -> Callable[[str, int, int], None]:
    """Takes what is counted, how many are done and of how many."""
    counted: dict[str, Counted] = {}

    def tell_progress(what: str, done: int, of: int) -> None:
        if what not in counted:
            counted[what] = Counted(what, before=done)
            DISPLAY.begin(counted[what])
        work = counted[what]
        work.text, work.done, work.total = f"{what}: {done} of {of}", done, of
        if done >= of:
            DISPLAY.end(counted.pop(what))

    return tell_progress


class _Stages:
    """The stages of one work, with what they took and, where it is known, what is left.

    Attributes:
        taken: Names and seconds of those that are done.
    """

    def __init__(self, work: str, size: int) -> None:
        self._work, self._size = work, size
        self._remembers = bool(work and size) and on_terminal()
        self._expected = remembered(work, size) if self._remembers else None
        self._series: dict[str, float] = {}
        self.taken: list[tuple[str, float]] = []

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Show the stage while what is below it runs."""
        began, stage = time.monotonic(), self._stage(name)
        DISPLAY.begin(stage)
        try:
            yield
        finally:
            DISPLAY.end(stage)
        self.taken.append((name, time.monotonic() - began))
        if self._remembers and (self._expected is None or len(self.taken) >= len(self._expected.stages)):
            remember(self._work, Took(self._size, tuple(self.taken)))

    def _stage(self, name: str) -> Work:
        one = ONE_OF.fullmatch(name)
        if one is not None:
            began = self._series.setdefault(one["what"], time.monotonic())
            return Counted(name, began, float(one["number"]) - 1.0, float(one["total"]))
        number = len(self.taken)
        then = self._expected.stages if self._expected is not None else ()
        if [known for known, _ in then[: number + 1]] != [*(known for known, _ in self.taken), name]:
            return Work(name)
        before, after = sum(s for _, s in then[:number]), sum(s for _, s in then[number + 1 :])
        return Expected(name, before_s=before, this_s=then[number][1], after_s=after)
