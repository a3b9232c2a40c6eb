"""`truearm fleet`: many arms, judged side by side and held against their last calibrations."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from truearm.cli.arguments import AsJson, OutputDirectory, Scheduler, Workers
from truearm.cli.calibrate import check_directory
from truearm.cli.console import FAILED, print_json, print_table, say, say_wrapped, suggest, tell
from truearm.cli.interrupt import ends_promptly
from truearm.cli.progress import told_stages
from truearm.errors import typed
from truearm.result_names import CALIBRATION_NAME

if TYPE_CHECKING:
    from truearm.fleet import Fleet, FleetRun
    from truearm.fleet.rows import Judged

COLUMNS = ("arm", "verdict", "errors of", "mean", "max", "nominal", "drift", "at most")


def command(
    fleet: Annotated[
        Path, typer.Argument(metavar="FLEET.toml", help="Names the arms, their data and how to calibrate.")
    ],
    output: OutputDirectory,
    scheduler: Scheduler = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Calibrate the arms of a fleet, and say which of them need attention.

    Writes calibration, summary and report of each arm to DIR/ARM/, and DIR/fleet.html, fleet.csv and
    fleet.json with a verdict an arm, its errors on held-out rows, and its drift since its last calibration.

    An arm that fails stops no other; the exit status is 1 then. A run that was interrupted continues: arms
    that are finished, with the same files, options and version, are not done again.

    Examples:
      truearm fleet fleet.toml -o november
      truearm fleet fleet.toml -o november --workers 8
      truearm fleet fleet.toml -o november --scheduler tcp://10.0.0.5:8786
    """
    from truearm.fleet import Fleet, run_fleet

    known = Fleet.load(fleet)
    check_directory(output)
    with ends_promptly(lambda: _kept(known, output)):
        run = run_fleet(known, output, scheduler=scheduler, workers=workers, stages=told_stages())
    for arm, trace in run.traces.items():
        tell(f"{arm}: this is a defect of truearm, please report it:\n{trace}")
    if as_json:
        print_json(run.content)
    else:
        places = f" --scheduler {typed(scheduler)}" if scheduler else ""
        places += f" --workers {workers}" if workers else ""
        _print(run, output, again=f"truearm fleet {typed(fleet)} -o {typed(output)}{places}")
    if run.failed:
        raise typer.Exit(FAILED)


def _kept(fleet: "Fleet", output: Path) -> str:
    """What an interrupted run leaves behind, and how to go on."""
    from truearm.fleet.kept import earlier_files

    if any(earlier_files(output / entry.name) for entry in fleet.arms):
        return f"Finished arms are in {output}; the same command goes on with the others."
    return "No arm is finished yet; the same command begins anew."


def _print(run: "FleetRun", output: Path, *, again: str) -> None:
    from truearm.fleet.page import in_words

    if run.done_before:
        say(f"{run.done_before} of {len(run.arms)} arms were finished before.")
    print_table(COLUMNS, [_cells(arm) for arm in run.arms], title="Errors and drift, mm", left=(0, 1, 2))
    for arm in run.arms:
        if arm.reasons:
            say_wrapped(f"{arm.row['arm']}: {' '.join(reason.words for reason in arm.reasons)}")
    say_wrapped(in_words(run.content["counts"]))
    say(f"Page: {output / 'fleet.html'}")
    if run.failed:
        suggest(again, when="Finished arms are kept. When the others are put right:")
        return
    first = output / run.arms[0].row["arm"] / CALIBRATION_NAME
    suggest(f"truearm report {typed(first)}", when="Look into one:")


def _cells(arm: "Judged") -> list[str]:
    row, drift = arm.row, arm.row.get("drift") or {}
    numbers = [row.get(key) for key in ("mean_mm", "max_mm", "nominal_mean_mm")]
    numbers += [drift.get(key) for key in ("mean_mm", "max_mm")]
    shown = ["" if value is None else f"{value:.3f}" for value in numbers]
    return [row["arm"], arm.verdict, row.get("errors_of", ""), *shown]
