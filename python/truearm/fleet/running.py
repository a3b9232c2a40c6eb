"""A whole fleet: what is not yet done is spread over workers, and every arm gets its row."""

import json
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from truearm.errors import TruearmError
from truearm.files import make_directory, write_whole
from truearm.fleet.attention import FAILED
from truearm.fleet.fleet_file import Entry, Fleet
from truearm.fleet.inputs import Inputs, find_inputs
from truearm.fleet.kept import earlier_files, keep, kept_row
from truearm.fleet.page import fleet_page
from truearm.fleet.rows import Judged, Row, content, counts, judged, row_of_failed, table_of
from truearm.fleet.task import ArmTask, calibrate_arm
from truearm.result_names import REPORT_NAME
from truearm.stages import Stages, no_stages
from truearm.workers import Done, check_workers, run_tasks

JSON_NAME: Final = "fleet.json"
CSV_NAME: Final = "fleet.csv"
PAGE_NAME: Final = "fleet.html"


@dataclass(frozen=True)
class FleetRun:
    """What became of a fleet.

    Attributes:
        content: The content of fleet.json.
        arms: The arms, those that need most attention first.
        done_before: How many were finished by an earlier run and not done again.
        traces: Where errors came from that are defects, by arm.
    """

    content: dict[str, Any]
    arms: tuple[Judged, ...]
    done_before: int
    traces: dict[str, str]

    @property
    def failed(self) -> int:
        """How many arms failed."""
        return counts(self.arms)[FAILED]


def run_fleet(
    fleet: Fleet,
    output: str | Path,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    stages: Stages = no_stages,
) -> FleetRun:
    """Calibrate the arms of a fleet, and write what became of them.

    Each arm has calibration, summary and report in a directory of its name; the fleet has fleet.json,
    fleet.csv and fleet.html. An arm that an earlier run finished, with the same inputs, options and version,
    is not done again. An arm that fails stops no other.

    Args:
        fleet: The fleet.
        output: Directory of the results; made if needed.
        scheduler: Address of a Dask scheduler, as in run_tasks.
        workers: Local processes at the most, as in run_tasks.
        stages: Called with the name of each stage; gives a context manager that surrounds it.

    Raises:
        UsageError: If a scheduler and workers are given.
        InputError: If the scheduler does not answer, or nothing can be written to the directory.
        WorkError: If the scheduler is lost.
    """
    check_workers(scheduler, workers)
    folder = Path(output)
    make_directory(folder)
    rows: dict[str, Row] = {}
    traces: dict[str, str] = {}
    with stages("looking for what is done"):
        todo = _open(fleet, folder, rows)
    before = sum(row["status"] != FAILED for row in rows.values())
    tasks = [task for _, task in todo]
    left = "" if len(todo) == len(fleet.arms) else " that are left"
    with closing(run_tasks(calibrate_arm, tasks, scheduler=scheduler, workers=workers)) as finished:
        for number in range(1, len(todo) + 1):
            with stages(f"arm {number} of {len(todo)}{left}"):
                done = next(finished)
            inputs = todo[done.index][0]
            rows[inputs.entry.name] = _row(inputs, done, folder)
            if done.trace:
                traces[inputs.entry.name] = done.trace
    arms = judged(fleet, [rows[entry.name] for entry in fleet.arms])
    return FleetRun(_write(fleet, arms, folder), tuple(arms), before, traces)


def _open(fleet: Fleet, output: Path, rows: dict[str, Row]) -> list[tuple[Inputs, ArmTask]]:
    """Arms that are still to be done; the others get their rows: done before, or without what they need."""
    todo = []
    for entry in fleet.arms:
        try:
            inputs = find_inputs(entry, output)
            kept = kept_row(inputs, output)
            if kept is not None:
                rows[entry.name] = kept
            else:
                todo.append((inputs, _task(inputs)))
        except (TruearmError, OSError) as error:
            rows[entry.name] = row_of_failed(entry.name, error, earlier_files(output / entry.name))
    return todo


def _task(inputs: Inputs) -> ArmTask:
    entry: Entry = inputs.entry
    return ArmTask(
        robot=inputs.robot.to_dict(),
        data=inputs.measurements(),
        options=entry.options,
        previous=inputs.previous,
        previous_name=str(entry.previous),
        strip=entry.section.strip,
        with_report=entry.section.report,
    )


def _row(inputs: Inputs, done: Done[Any], output: Path) -> Row:
    try:
        return keep(inputs, done.result(), output)
    except Exception as error:  # noqa: BLE001 - one arm stops no other; it is told in the arm's row
        return row_of_failed(inputs.entry.name, error, earlier_files(output / inputs.entry.name))


def _write(fleet: Fleet, arms: Sequence[Judged], output: Path) -> dict[str, Any]:
    """Write the fleet's own files; the content of fleet.json."""
    found = content(fleet, arms, version("truearm"))
    write_whole(output / JSON_NAME, json.dumps(found, indent=2, ensure_ascii=False, allow_nan=False) + "\n")
    write_whole(output / CSV_NAME, table_of(arms))
    done = [arm.row["arm"] for arm in arms if arm.verdict != FAILED]
    reports = {name for name in done if (output / name / REPORT_NAME).is_file()}
    write_whole(output / PAGE_NAME, fleet_page(fleet, arms, reports))
    return found
