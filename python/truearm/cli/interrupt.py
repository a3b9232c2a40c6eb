"""Ctrl-C that ends a command within a second, even in the middle of a long factorisation."""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, NoReturn

from truearm.cli.console import tell
from truearm.cli.display import put_away
from truearm.interrupts import INTERRUPTED, LOOKS_EVERY_S, Asked, asked_by

GRACE_S: Final = 0.6


@contextmanager
def ends_promptly(kept: Callable[[], str] | None = None) -> Iterator[None]:
    """Around long work: Ctrl-C raises KeyboardInterrupt, and ends the process if that takes too long.

    Files are written whole or not at all, so that ending at any moment leaves no half-written one. What
    `kept` says is told then: what is there already, and how to go on. Further ones meanwhile change nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    asked = Asked(raises=True)
    watch = _Watch(asked, kept)
    threading.Thread(target=watch.run, daemon=True).start()
    try:
        with asked_by((signal.SIGINT,), asked):
            yield
        if asked:
            raise KeyboardInterrupt
    except KeyboardInterrupt:
        watch.ended = True
        if kept is not None:
            _tell(kept)
        raise
    finally:
        watch.ended = True


def end_at_once() -> NoReturn:
    """End the process after an interrupt, without taking the interpreter down in order: all is closed."""
    put_away()
    tell("Interrupted.")
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(INTERRUPTED)


def _tell(kept: Callable[[], str] | None) -> None:
    put_away()
    if kept is not None:
        tell(kept())


class _Watch:
    """Ends the process where work goes on for long after it was asked to end.

    Attributes:
        ended: Whether the work is over. An attribute rather than an Event, whose lock a signal may come into.
    """

    def __init__(self, asked: Asked, kept: Callable[[], str] | None) -> None:
        self._asked, self._kept = asked, kept
        self.ended = False

    def run(self) -> None:
        """Look until the work is over; in a thread of its own, begun before the work."""
        while not self.ended:
            since = self._asked.since
            if since is not None and time.monotonic() - since > GRACE_S:
                try:
                    _tell(self._kept)
                    tell("Interrupted.")
                finally:
                    os._exit(INTERRUPTED)
            time.sleep(LOOKS_EVERY_S)
