"""What workers would do, done in the process of the tests: starting workers takes longer than their work."""

from importlib.metadata import version

from truearm.workers import run_tasks
from truearm.workers.done import answer


def in_this_process(function, items, *, scheduler=None, **_):
    """As run_tasks, without workers of its own; what is sent to a cluster is done there."""
    if scheduler is not None:
        yield from run_tasks(function, items, scheduler=scheduler)
        return
    for number, item in enumerate(items):
        yield answer(function, item, version("truearm")).of(number)
