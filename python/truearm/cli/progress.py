"""Stages of long work, told on stderr once they have taken a second."""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Final

from truearm.cli.console import tell

PATIENCE_S: Final = 1.0
ON_TERMINAL_S: Final = 1.0
IN_LOG_S: Final = 10.0


def told_stages() -> Callable[[str], AbstractContextManager[None]]:
    """Stages that say what is going on: one line that is renewed on a terminal, rare lines elsewhere."""
    return _stage


def told_progress() -> Callable[[str, int, int], None]:
    """Takes what is counted, how many are done and of how many; says so once a second at most."""
    last = time.monotonic()

    def tell_progress(what: str, done: int, of: int) -> None:
        nonlocal last
        if time.monotonic() - last > PATIENCE_S:
            tell(f"{what[0].upper()}{what[1:]}: {done} of {of}")
            last = time.monotonic()

    return tell_progress


@contextmanager
def _stage(name: str) -> Iterator[None]:
    ended = threading.Event()
    teller = threading.Thread(target=_tell_until, args=(name, ended), daemon=True)
    teller.start()
    try:
        yield
    finally:
        ended.set()
        teller.join()


def _tell_until(name: str, ended: threading.Event) -> None:
    began, on_terminal = time.monotonic(), sys.stderr.isatty()
    wait, told = PATIENCE_S, False
    while not ended.wait(wait):
        text = f"{name[0].upper()}{name[1:]} ... {time.monotonic() - began:.0f} s"
        if on_terminal:
            sys.stderr.write(f"\r\x1b[K{text}")
            sys.stderr.flush()
        else:
            tell(text)
        wait, told = (ON_TERMINAL_S if on_terminal else IN_LOG_S), True
    if told and on_terminal:
        sys.stderr.write("\r\x1b[K")
        sys.stderr.flush()
