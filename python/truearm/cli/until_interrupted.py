"""Waiting for Ctrl-C, or for a request to end, as the end of a service and no error."""

import signal
import threading


def until_interrupted(ended: threading.Event) -> None:
    """Wait until Ctrl-C, a request to end, or `ended`."""
    before = {
        number: signal.signal(number, lambda _number, _frame: ended.set())
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        ended.wait()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
