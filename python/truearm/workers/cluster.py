"""Tasks over the workers of a Dask cluster that is there already."""

import asyncio
import logging
import os
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from importlib.metadata import version
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Final, TypeVar

from truearm.errors import InputError, WorkError
from truearm.workers.done import Done, answer, died, plain

if TYPE_CHECKING:
    from distributed import Client, Future

T = TypeVar("T")
R = TypeVar("R")

CONNECT_S: Final = 5.0
PULSE_S: Final = 1.0
WITHOUT_WORKERS_S: Final = 60.0
CLOSE_S: Final = 0.3


def run_on_cluster(
    function: Callable[[T], R], items: Sequence[T], scheduler: str
) -> Generator[Done[R], None, None]:
    """As run_tasks, over the workers of the cluster with this address."""
    with _connected(scheduler) as client:
        ready: SimpleQueue[Future[Any]] = SimpleQueue()
        pending = {}
        for index, item in enumerate(items):
            future = client.submit(_on_worker, function, item, version("truearm"), pure=False)
            pending[future.key] = index, future
            future.add_done_callback(ready.put)
        while pending:
            key = _next(ready, client, scheduler).key
            index, future = pending.pop(key)
            yield _done(future, scheduler).of(index)


def _on_worker(function: Callable[[T], R], item: T, caller: str) -> Done[R]:
    """A task of a cluster has one thread, as its own libraries have there."""
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    return answer(function, item, caller)


def check_scheduler(scheduler: str) -> None:
    """Look whether a scheduler is there.

    Raises:
        InputError: If it does not answer within seconds, or dask.distributed is not installed.
    """
    try:
        import distributed  # noqa: F401, PLC0415 - may not be installed
    except ImportError:
        raise InputError(
            "dask.distributed is not installed",
            where=scheduler,
            way_out='Install it with: pip install ".[fleet]" in the source; or leave the scheduler out',
        ) from None
    try:
        with ThreadPoolExecutor(1) as aside:  # a notebook's thread runs a loop already
            aside.submit(asyncio.run, _greet(scheduler)).result()
    except Exception as error:  # noqa: BLE001 - a stranger's answer may be anything
        raise InputError(
            f"no Dask scheduler answers: {str(error) or f'nothing within {CONNECT_S:g} s'}",
            where=scheduler,
            rule="An address such as tcp://10.0.0.5:8786 is needed",
            way_out="Start one with: dask scheduler; or leave it out to use this machine",
        ) from None


@contextmanager
def _connected(scheduler: str) -> Iterator["Client"]:
    """A client of the cluster, which takes its waiting tasks away when it leaves."""
    check_scheduler(scheduler)
    from distributed import Client  # noqa: PLC0415 - may not be installed

    client = Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    with _unheard("distributed.client"):
        try:
            yield client
        finally:
            with suppress(OSError, TimeoutError):
                client.close(timeout=CLOSE_S)


@contextmanager
def _unheard(name: str) -> Iterator[None]:
    """Keep a logger quiet whose errors are raised here in words."""
    logger = logging.getLogger(name)
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)


async def _greet(scheduler: str) -> None:
    """Raise whatever comes where no scheduler answers; a client that was never connected ends badly."""
    from distributed.comm.core import connect  # noqa: PLC0415
    from distributed.security import Security  # noqa: PLC0415

    async with asyncio.timeout(CONNECT_S):
        comm = await connect(scheduler, timeout=CONNECT_S, **Security().get_connection_args("client"))
    await comm.close()


def _next(ready: "SimpleQueue[Future[Any]]", client: "Client", scheduler: str) -> "Future[Any]":
    """The next future that is done; looks now and then whether anybody is still at work."""
    began = time.monotonic()
    while True:
        try:
            return ready.get(timeout=PULSE_S)
        except Empty:
            if client.status != "running":
                raise _lost(scheduler) from None
            if client.nthreads():
                began = time.monotonic()
            elif time.monotonic() - began > WITHOUT_WORKERS_S:
                raise WorkError(
                    f"the cluster has had no worker for {WITHOUT_WORKERS_S:g} s",
                    where=scheduler,
                    way_out=f"Start some with: dask worker {scheduler}; then run this again",
                ) from None


def _done(future: "Future[Any]", scheduler: str) -> Done[Any]:
    """What became of a future's task; where its worker died with the result, another one does it again."""
    from distributed.scheduler import KilledWorker  # noqa: PLC0415

    try:
        error = future.exception(timeout=WITHOUT_WORKERS_S)
        found = Done[Any](0) if error is not None else future.result(timeout=WITHOUT_WORKERS_S)
    except (TimeoutError, CancelledError):
        raise _lost(scheduler) from None
    if error is None:
        return found
    return Done(0, error=died() if isinstance(error, KilledWorker) else plain(error))


def _lost(scheduler: str) -> WorkError:
    return WorkError(
        "the Dask scheduler is lost",
        where=scheduler,
        way_out="See that it runs, then run this again",
    )
