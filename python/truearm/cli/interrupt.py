"""Ctrl-C that ends a command within a second, even in the middle of a long factorisation."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final, NoReturn

from truearm.cli.console import INTERRUPTED, tell
from truearm.cli.display import put_away

GRACE_S: Final = 0.6


@contextmanager
def ends_promptly(kept: Callable[[], str] | None = None) -> Iterator[None]:
    """Around long work: Ctrl-C raises KeyboardInterrupt, and ends the process if that takes too long.

    Files are written whole or not at all, so that ending at any moment leaves no half-written one. What
    `kept` says is told then: what is there already, and how to go on.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ended = threading.Event()

    def interrupted(_number: int, _frame: FrameType | None) -> None:
        threading.Thread(target=_end_unless, args=(ended, kept), daemon=True).start()
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, interrupted)
    try:
        yield
    except KeyboardInterrupt:
        ended.set()
        if kept is not None:
            _tell(kept)
        raise
    finally:
        ended.set()
        signal.signal(signal.SIGINT, before)


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


def _end_unless(ended: threading.Event, kept: Callable[[], str] | None) -> None:
    if not ended.wait(GRACE_S):
        _tell(kept)
        tell("Interrupted.")
        os._exit(INTERRUPTED)
