"""Signals that ask for an end, noted by handlers that take no lock and looked for by whoever has to act.

A handler runs in the main thread wherever that is, so within another handler and inside of any lock that is
not re-entrant too, such as that of a `threading.Event`: setting one there may wait for itself for ever.
"""

import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Final

LOOKS_EVERY_S: Final = 0.05
INTERRUPTED: Final = 130
"""Status of a process that such a signal ended."""


class Asked:
    """Whether an end was asked for; a handler of signals that only sets an attribute.

    Attributes:
        since: When it was asked for first, by the clock of `time.monotonic`; None before.
        raises: Whether the first request raises KeyboardInterrupt. Further ones do not: they would cut short
            what tidies up behind it.
    """

    def __init__(self, *, raises: bool = False) -> None:
        self.since: float | None = None
        self.raises = raises

    def __bool__(self) -> bool:
        return self.since is not None

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal.

        Raises:
            KeyboardInterrupt: At the first one, where that is wanted.
        """
        del number, frame
        if self.since is not None:
            return
        self.since = time.monotonic()
        if self.raises:
            raise KeyboardInterrupt


@contextmanager
def asked_by(numbers: Sequence[int], asked: Asked) -> Iterator[Asked]:
    """Have signals handled by `asked`; in another thread than the main one they are left as they are."""
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return
    # None is a handler that was not set from Python; an Asked that nobody asked is false, and is kept.
    found = {number: signal.getsignal(number) for number in numbers}
    before = {number: signal.SIG_DFL if handler is None else handler for number, handler in found.items()}
    try:
        for number in numbers:
            signal.signal(number, asked)
        yield asked
    finally:
        # What comes from here on is noted only, so that all handlers are put back.
        asked.raises = False
        for number, handler in before.items():
            signal.signal(number, handler)
