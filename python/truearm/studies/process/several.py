"""The experiment on several virtual arms: one here, the others over processes or a cluster."""

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Final

from truearm.cell.measuring import Progress
from truearm.errors import InputError, TruearmError
from truearm.files import make_directory, write_whole
from truearm.stages import Stages, no_stages
from truearm.studies.metrics import over_seeds
from truearm.studies.paper import Drawn
from truearm.studies.process.conducting import Result, conduct_experiment
from truearm.studies.process.judging import judged, judged_over_arms
from truearm.studies.process.setting import Setting, cell_text
from truearm.workers import Done, check_workers, run_tasks

CELL_NAME: Final = "cell.toml"


def conduct_arms(
    settings: Sequence[Setting],
    directory: Path,
    report: Callable[[Progress], None],
    stages: Stages,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
) -> tuple[Result, Drawn]:
    """Conduct the experiment on arms that differ in their seeds.

    Each arm has its session and cell file: the first in the directory, the one of seed S in "arm-S" of it.
    Sessions that are there are continued.

    Args:
        settings: Of each arm.
        directory: Where the sessions are; the workers of a cluster see it under the same name.
        report: Told of the progress of measuring the first arm.
        stages: Called with the name of each stage of the rest.
        scheduler: Address of a Dask scheduler, as in run_tasks.
        workers: Local processes at the most, as in run_tasks.

    Returns:
        The results of the first arm with its statements and claims, and under "over_arms" those of all where
        there are several; and what is drawn of the first.

    Raises:
        UsageError: If workers contradict each other.
        InputError: If the scheduler does not answer, its workers do not see the directory, or a session that
            is there is of something else.
        WorkError: If an arm cannot be measured; the others are conducted first.
        KeyboardInterrupt: After Ctrl-C; the same call goes on with what was measured.
    """
    check_workers(scheduler, workers)
    first, drawn = _conduct(settings[0], directory, report, stages)
    others = [(setting, directory.absolute() / f"arm-{setting.seed}") for setting in settings[1:]]
    for _, own in others:
        make_directory(own)
    each = [first, *_elsewhere_all(others, stages, scheduler, workers)]
    result = {**first, **judged(first)}
    if others:
        seeds = [setting.seed for setting in settings]
        result["over_arms"] = {"seeds": seeds, **over_seeds(each), **judged_over_arms(each)}
    return result, drawn


def _conduct(
    setting: Setting, directory: Path, report: Callable[[Progress], None], stages: Stages
) -> tuple[Result, Drawn]:
    make_directory(directory)
    found = conduct_experiment(setting, directory, report, stages)
    write_whole(directory / CELL_NAME, cell_text(setting))
    return found


def _elsewhere_all(
    items: Sequence[tuple[Setting, Path]], stages: Stages, scheduler: str | None, workers: int | None
) -> list[Result]:
    """Results of arms in their order; an arm that fails stops none of the others."""
    found: dict[int, Done[Result]] = {}
    with closing(run_tasks(_elsewhere, items, scheduler=scheduler, workers=workers)) as finished:
        for number in range(2, len(items) + 2):
            with stages(f"arm {number} of {len(items) + 1}"):
                done = next(finished)
            found[done.index] = done
    return [found[position].result() for position in range(len(items))]


def _elsewhere(item: tuple[Setting, Path]) -> Result:
    setting, directory = item
    if not directory.is_dir():
        raise InputError(
            "there is no such directory where a worker runs",
            where=str(directory),
            rule="Workers write what they measure into it",
            way_out="Give a directory that every worker sees under this name, or leave the scheduler out",
        )
    try:
        return _conduct(setting, directory, _untold, no_stages)[0]
    except TruearmError as error:
        raise error.at(f"arm {setting.seed}") from None


def _untold(progress: Progress) -> None:
    del progress
