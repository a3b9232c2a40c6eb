"""Runs what is asked and not there yet, and keeps every result at once."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from truearm.studies.accuracy.cells import Asked, Cell, list_cells
from truearm.studies.accuracy.judging import Job, run_job
from truearm.studies.accuracy.libraries import require
from truearm.studies.accuracy.methods import BY_NAME
from truearm.studies.accuracy.results import Kept, Record, key_of
from truearm.studies.accuracy.sets import DataSet
from truearm.workers import check_workers, run_tasks

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Study:
    """What is compared.

    Attributes:
        sets: Arms and data.
        asked: Splits, sizes and seeds.
        methods: Names of methods.
        quick: Whether searches of settings are cut short.
    """

    sets: tuple[DataSet, ...]
    asked: Asked
    methods: tuple[str, ...]
    quick: bool = False


@dataclass(frozen=True)
class Where:
    """Where a study runs.

    Attributes:
        scheduler: Address of a Dask scheduler, whose workers see the same files; None for this machine.
        workers: Processes on this machine.
        again: Methods of the study whose results are found anew; an interrupted run of the same request goes
            on.
    """

    scheduler: str | None = None
    workers: int | None = None
    again: tuple[str, ...] = ()


@dataclass
class Outcome:
    """What there is of a study.

    Attributes:
        records: All results that are there of those asked for, in the order of the questions; those of
            methods that could not be fitted say why.
        asked: Number of results asked for.
        run: How many were found now, without those that could not be fitted.
        errors: What went wrong where a result is missing, by method.
    """

    records: list[Record] = field(default_factory=list)
    asked: int = 0
    run: int = 0
    errors: dict[str, str] = field(default_factory=dict)


def conduct(study: Study, directory: Path, where: Where, told: Progress) -> Outcome:
    """Run the study as far as its results are not in the directory.

    A method that cannot be fitted to some rows says so in its result; one that breaks is named in the
    outcome, and is tried again the next time. Results that are asked for anew are missing until they are
    found, and stay in the directory until then.

    Raises:
        UsageError: If a library of a method is missing, or workers contradict each other.
        InputError: If data cannot be read, the scheduler does not answer, or the directory holds
            something else.
    """
    check_workers(where.scheduler, where.workers)
    require(BY_NAME[name].needs for name in study.methods)
    jobs, kept = list(_jobs(study)), Kept(directory)
    anew = {key for job in jobs if job.method in where.again for key in _keys(job)}
    if anew:
        kept.find_anew(anew)
    missing = [job for job in jobs if not all(map(kept.is_there, _keys(job)))]
    run, errors, before = 0, dict[str, str](), len(jobs) - len(missing)
    told("comparing methods", before, len(jobs))
    tasks = run_tasks(run_job, missing, scheduler=where.scheduler, workers=where.workers)
    with closing(tasks) as finished:
        for count, done in enumerate(finished, start=before + 1):
            if done.error is None:
                results = done.result()
                kept.add(results)
                run += sum("failed" not in result for result in results)
            else:
                errors[missing[done.index].method] = done.trace or str(done.error)
            told("comparing methods", count, len(jobs))
    kept.tidy()
    found = _gathered(jobs, kept)
    found.run, found.errors = run, errors
    return found


def so_far(study: Study, directory: Path) -> Outcome:
    """What the directory holds of the study; nothing is run or written.

    Raises:
        InputError: If data cannot be read, or the directory holds something else.
    """
    return _gathered(list(_jobs(study)), Kept(directory))


def _gathered(jobs: Sequence[Job], kept: Kept) -> Outcome:
    keys = [key for job in jobs for key in _keys(job)]
    return Outcome([kept.records[key] for key in keys if kept.is_there(key)], len(keys))


def _jobs(study: Study) -> Iterator[Job]:
    """All jobs, the methods of a question one after the other."""
    cells: Sequence[Cell] = list_cells(study.sets, study.asked)
    return (Job(cell, name, study.quick) for cell in cells for name in study.methods)


def _keys(job: Job) -> list[tuple[str, ...]]:
    return [key_of(job.head(name)) for name in job.results]
