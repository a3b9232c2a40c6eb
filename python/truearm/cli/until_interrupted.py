"""Waiting for Ctrl-C, or for a request to end, as the end of a service and no error."""

import signal
import time

from truearm.interrupts import LOOKS_EVERY_S, Asked, asked_by


def until_interrupted() -> None:
    """Wait until Ctrl-C, or a request to end."""
    with asked_by((signal.SIGINT, signal.SIGTERM), Asked()) as asked:
        while not asked:
            time.sleep(LOOKS_EVERY_S)
