"""Run truearm as where the names are missing that Python has on POSIX systems alone.

    python tests/without_posix.py COMMAND ...

What this stands on of Python itself and of other libraries is imported first, and keeps them. It shows that
our own code does without them; it does not show how Windows behaves.
"""

import asyncio  # noqa: F401
import concurrent.futures.process  # noqa: F401
import importlib
import os
import signal
import subprocess  # noqa: F401
import sys
import tempfile  # noqa: F401
from multiprocessing import resource_tracker
from types import SimpleNamespace

import filelock  # noqa: F401
import serial  # noqa: F401

MODULES = ("fcntl", "grp", "pty", "pwd", "resource", "syslog", "termios", "tty")
OF_OS = (
    *("chown", "fchmod", "fchown", "fork", "forkpty", "getegid", "geteuid", "getgid", "getpgid", "getpgrp"),
    *("killpg", "mkfifo", "nice", "openpty", "register_at_fork", "sched_getaffinity", "set_blocking"),
    "setsid",
)
OF_SIGNALS = (
    *("SIGALRM", "SIGCHLD", "SIGCONT", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGSTOP", "SIGTSTP"),
    *("SIGUSR1", "SIGUSR2", "alarm", "pthread_kill", "pthread_sigmask", "setitimer", "sigwait"),
)


def take_away() -> None:
    """Have these names be missing from here on."""
    vars(resource_tracker)["signal"] = SimpleNamespace(**vars(signal))
    vars(sys)["modules"].update(dict.fromkeys(MODULES))
    for module, names in ((os, OF_OS), (signal, OF_SIGNALS)):
        for name in names:
            if hasattr(module, name):
                delattr(module, name)


if __name__ == "__main__":
    take_away()
    sys.exit(importlib.import_module("truearm.cli").main())
