"""Many tasks at once, over local processes or a Dask cluster; results as they finish.

    def square(number: float) -> float:
        return number**2

    if __name__ == "__main__":
        with closing(run_tasks(square, numbers)) as finished:
            for done in finished:
                print(numbers[done.index], done.result())

The function is one of a module's top level, for it is found by its name elsewhere; items and results are sent
by value. Local processes run the program that asks for them once more, hence the guard; not for functions of
truearm itself, as `run_fleet` and the studies use them. A task does the same wherever it runs: results do not
depend on the number of workers, only their order does.
"""

from collections.abc import Callable, Generator, Iterable
from typing import TypeVar

from truearm.errors import UsageError
from truearm.workers.done import Done, is_expected
from truearm.workers.local import processors, run_locally

__all__ = ["Done", "check_workers", "is_expected", "processors", "run_tasks"]

T = TypeVar("T")
R = TypeVar("R")


def run_tasks(
    function: Callable[[T], R],
    items: Iterable[T],
    *,
    scheduler: str | None = None,
    workers: int | None = None,
) -> Generator[Done[R], None, None]:
    """Call a function with each item, elsewhere; one Done an item, as they finish.

    A task that raises gives a Done with its error. A worker that dies has its task done by another one, three
    times at most. Closing the generator ends local workers at once, and takes waiting tasks from a cluster.

    Args:
        function: Function of a module's top level.
        items: What it is called with; arguments and results can be pickled.
        scheduler: Address of a Dask scheduler, such as "tcp://10.0.0.5:8786"; None for local processes.
        workers: Local processes at the most; by default one for each processor.

    Raises:
        UsageError: If both are given, or there is no worker.
        InputError: When the first result is asked for, if the scheduler does not answer within seconds, or
            dask.distributed is not installed.
        WorkError: If the scheduler, or all its workers, are lost for long, or a local process ends before its
            first task, as where the program that asks has no guard.
    """
    _check(scheduler, workers)
    if scheduler is None:
        return run_locally(function, list(items), workers or processors())
    from truearm.workers.cluster import run_on_cluster  # noqa: PLC0415 - needs what may not be installed

    return run_on_cluster(function, list(items), scheduler)


def check_workers(scheduler: str | None = None, workers: int | None = None) -> None:
    """Raise now what run_tasks would with these, for work that begins with something else.

    Raises:
        UsageError: If both are given, or there is no worker.
        InputError: If the scheduler does not answer within seconds, or dask.distributed is not installed.
    """
    _check(scheduler, workers)
    if scheduler is not None:
        from truearm.workers.cluster import check_scheduler  # noqa: PLC0415

        check_scheduler(scheduler)


def _check(scheduler: str | None, workers: int | None) -> None:
    if scheduler is not None and workers is not None:
        raise UsageError(
            "both a scheduler and a number of workers are given",
            rule="A scheduler has its own workers",
            way_out="Leave one of them out",
        )
    if workers is not None and workers < 1:
        raise UsageError(f"{workers} workers", rule="At least one is needed")
