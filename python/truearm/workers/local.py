"""Tasks over processes of this machine."""

import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from importlib.metadata import version
from multiprocessing import get_context
from multiprocessing.connection import Connection
from types import ModuleType
from typing import Final, Generic, TypeVar

from truearm.workers.done import ATTEMPTS, Done, answer, died, not_begun, plain

T = TypeVar("T")
R = TypeVar("R")

THREAD_VARIABLES: Final = (
    "RAYON_NUM_THREADS",
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
)
ABANDONED: Final = 1
SPAWN: Final = get_context("spawn")
OWN: Final = "truearm"
MAIN: Final = "__main__"
STARTING: Final = threading.Lock()
"""Held while a process starts: what it inherits is set for this whole process."""


def run_locally(
    function: Callable[[T], R], items: Sequence[T], workers: int
) -> Generator[Done[R], None, None]:
    """As run_tasks, over so many processes; their native threads share the processors.

    Functions of truearm, and what they are called with, are found in its modules: the caller's program is not
    run again for them, and needs no guard. It is for others, which may be of that program.

    Raises:
        WorkError: If a process does not come past running the caller's program.
    """
    crew = _Crew(function, items, min(workers, max(len(items), 1)))
    try:
        crew.employ()
        while crew.running:
            finished = crew.finished()
            crew.employ()
            yield from finished
    finally:
        crew.close()


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _Worker:
    """A process with one task at a time, which ends at once when it is closed or this process ends."""

    def __init__(self, threads: int, *, with_main: bool) -> None:
        """Start the process, with so many native threads; `with_main`: it runs the caller's program first."""
        listening, self._lifeline = SPAWN.Pipe(duplex=False)
        self._executor = ProcessPoolExecutor(
            1, mp_context=SPAWN, initializer=_end_with, initargs=(listening,)
        )
        with _as_children_start(threads), nullcontext() if with_main else _main_hidden():
            self._first = self._executor.submit(os.getpid)

    def submit(self, function: Callable[[T], R], item: T) -> Future[Done[R]]:
        """Begin a task."""
        return self._executor.submit(answer, function, item, version("truearm"))

    @property
    def has_begun(self) -> bool:
        """Whether the process came as far as doing what it is told."""
        return self._first.done() and self._first.exception() is None

    def close(self) -> None:
        """End the process, in the middle of a task too."""
        self._lifeline.close()
        self._executor.shutdown(cancel_futures=True)


@dataclass(eq=False)
class _Crew(Generic[T, R]):
    """Workers and their tasks."""

    function: Callable[[T], R]
    items: Sequence[T]
    count: int

    def __post_init__(self) -> None:
        self.waiting = deque((index, 1) for index in range(len(self.items)))
        self.running: dict[Future[Done[R]], tuple[_Worker, int, int]] = {}
        self.idle: list[_Worker] = []
        self.with_main = self.function.__module__.partition(".")[0] != OWN

    def employ(self) -> None:
        """Give waiting tasks to workers that have none."""
        while self.waiting and len(self.running) < self.count:
            worker = self.idle.pop() if self.idle else self._hired()
            index, attempt = self.waiting.popleft()
            try:
                future = worker.submit(self.function, self.items[index])
            except BrokenProcessPool:  # it died without a task: nobody's fault
                worker.close()
                self.waiting.appendleft((index, attempt))
            else:
                self.running[future] = (worker, index, attempt)

    def _hired(self) -> _Worker:
        return _Worker(max(1, processors() // self.count), with_main=self.with_main)

    def finished(self) -> list[Done[R]]:
        """Wait for tasks to finish; what became of them, without those that another worker has to do."""
        ended, _ = wait(self.running, return_when=FIRST_COMPLETED)
        found = [self._done(future, *self.running.pop(future)) for future in ended]
        return [done for done in found if done is not None]

    def _done(self, future: Future[Done[R]], worker: _Worker, index: int, attempt: int) -> Done[R] | None:
        error = future.exception()
        if not isinstance(error, BrokenProcessPool):
            self.idle.append(worker)
            return future.result().of(index) if error is None else Done(index, error=plain(error))
        worker.close()
        if self.with_main and not worker.has_begun:
            raise not_begun()
        if attempt == ATTEMPTS:
            return Done(index, error=died())
        self.waiting.append((index, attempt + 1))
        return None

    def close(self) -> None:
        """End all workers."""
        for worker in [*self.idle, *(worker for worker, _, _ in self.running.values())]:
            worker.close()


@contextmanager
def _as_children_start(threads: int) -> Iterator[None]:
    """Around the start of a process: it gets its share of native threads, and leaves Ctrl-C to this one."""
    with STARTING, _interrupts_blocked():
        added = {name: str(threads) for name in THREAD_VARIABLES if name not in os.environ}
        os.environ.update(added)
        try:
            yield
        finally:
            for name in added:
                del os.environ[name]


@contextmanager
def _main_hidden() -> Iterator[None]:
    """Have processes that are started here not run the program of this one, of which its module tells."""
    main = sys.modules[MAIN]
    sys.modules[MAIN] = ModuleType(MAIN)
    try:
        yield
    finally:
        sys.modules[MAIN] = main


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """While Ctrl-C waits, for ever in processes that are started here; Windows has nothing of the kind."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with(lifeline: Connection) -> None:
    """End this process when the other end of `lifeline` is closed, whoever closes it, and not by Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_wait_for_end, args=(lifeline,), daemon=True).start()


def _wait_for_end(lifeline: Connection) -> None:
    lifeline.poll(None)
    os._exit(ABANDONED)
