"""One at a time: a lock over a file among processes, or among threads where processes are not forked."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any, Final

HERE: Final = threading.Lock()

try:
    import fcntl
except ImportError:  # Windows, where the devices of a virtual cell are threads of one process

    @contextmanager
    def exclusive(file: IO[Any]) -> Iterator[None]:
        """While no other thread is here."""
        del file
        with HERE:
            yield

else:

    @contextmanager
    def exclusive(file: IO[Any]) -> Iterator[None]:
        """While nobody is here who opened the same file for itself."""
        fcntl.flock(file, fcntl.LOCK_EX)
        try:
            yield
        finally:
            fcntl.flock(file, fcntl.LOCK_UN)
