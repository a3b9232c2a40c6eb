"""Running a process so that Ctrl-C, a request to end, or the end of its terminal stops the devices at once.

It ends within 2 s.
"""

import contextlib
import os
import signal
import sys
import threading
import time
from typing import Final

from truearm.cell.measuring import Process
from truearm.interrupts import INTERRUPTED, LOOKS_EVERY_S, Asked, asked_by

ENDS_WITHIN_S: Final = 1.6


def run(process: Process) -> str:
    """What the process returns; it works in a thread of its own, so that nothing delays a stop.

    Raises:
        KeyboardInterrupt: After such a signal, when devices are stopped and the file is closed.
        Exception: What the process raises.
    """
    outcome: list[str] = []
    failure: list[BaseException] = []

    def work() -> None:
        try:
            outcome.append(process.run())
        except BaseException as error:  # noqa: BLE001 - raised in the thread that asked
            failure.append(error)

    worker = threading.Thread(target=work, daemon=True)
    with asked_by(_signals(), Asked()) as asked:
        worker.start()
        while worker.is_alive() and not asked:
            worker.join(LOOKS_EVERY_S)
        if asked:
            _end(process, worker)
            raise KeyboardInterrupt
    if failure:
        raise failure[0]
    return outcome[0]


def _end(process: Process, worker: threading.Thread) -> None:
    """Halt; what has not ended in time, such as a long factorisation, ends with the process."""
    until = time.monotonic() + ENDS_WITHIN_S
    halting = threading.Thread(target=process.halt, daemon=True)
    halting.start()
    for thread in (worker, halting):
        thread.join(max(0.0, until - time.monotonic()))
    if worker.is_alive():
        with contextlib.suppress(OSError):  # the terminal may be gone
            sys.stderr.write("Interrupted.\n")
            sys.stderr.flush()
        os._exit(INTERRUPTED)


def _signals() -> list[signal.Signals]:
    """What asks for an end; that of the terminal where there is such a signal and nohup does not hide it."""
    found = [signal.SIGINT, signal.SIGTERM]
    hung_up: signal.Signals | None = getattr(signal, "SIGHUP", None)
    if hung_up is not None and signal.getsignal(hung_up) != signal.SIG_IGN:
        found.append(hung_up)
    return found
