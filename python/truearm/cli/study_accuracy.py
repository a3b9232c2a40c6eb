"""`truearm study accuracy`: our models and other methods on the same measurements."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from truearm.cli.arguments import AngleUnit, AsJson, LengthUnit, OutputDirectory, Scheduler, Workers
from truearm.cli.console import print_json, print_table, say, suggest, tell, warn
from truearm.cli.interrupt import ends_promptly
from truearm.cli.progress import told_progress
from truearm.errors import InputError, UsageError, WorkError, list_names
from truearm.files import make_directory, write_whole

if TYPE_CHECKING:
    from truearm.studies.accuracy.running import Outcome, Study

JSON_NAME: Final = "accuracy.json"
PAGE_NAME: Final = "accuracy.md"
SIZES: Final = "25,50,100,200,400,all"


def command(
    data: Annotated[
        list[str],
        typer.Argument(metavar="ROBOT=FILE...", help="An arm and a CSV file of its measurements."),
    ],
    output: OutputDirectory,
    robot: Annotated[
        str | None, typer.Option(metavar="ROBOT", help="The arm of files that are given without one.")
    ] = None,
    methods: Annotated[
        str | None, typer.Option(metavar="NAME,NAME", help="Methods to compare.  [default: all]")
    ] = None,
    splits: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME", help="tails, clusters, groups, target, random.  [default: all possible]"
        ),
    ] = None,
    split_by: Annotated[
        str | None,
        typer.Option(metavar="COL,COL", help='Columns of the split "groups": equal rows stay together.'),
    ] = None,
    sizes: Annotated[
        str, typer.Option(metavar="N,N,all", help="Training poses; all are 2000 at the most.")
    ] = SIZES,
    seeds: Annotated[int, typer.Option(min=1, help="How many divisions of the rows.")] = 5,
    quick: Annotated[
        bool, typer.Option("--quick", help="Look at two settings of each method only, to try the command.")
    ] = False,
    so_far: Annotated[
        bool, typer.Option("--so-far", help="Run nothing; tell what an interrupted study has brought.")
    ] = False,
    again: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME",
            help="Methods whose results are found anew, as after a change of version.",
        ),
    ] = None,
    scheduler: Scheduler = None,
    workers: Workers = None,
    length_unit: LengthUnit = None,
    angle_unit: AngleUnit = None,
    as_json: AsJson = False,
) -> None:
    """Compare our models with the methods that people use instead, on measurements of your own.

    All methods get the same training rows and are judged on the same held-out rows: first whole parts that
    are left out (tails of each joint, clusters of joint space, groups equal in some columns, another target
    on the tool), then random rows. Shots of one visit to a pose are one row, and rows of a pose are held out
    together. Settings of a method are looked for by cross-validation on its training rows. Needs scikit-learn
    and lightgbm: pip install ".[study]".

    Writes DIR/accuracy.json, DIR/accuracy.md and learning curves as PNG and SVG. Every result is kept in
    DIR/results.jsonl as soon as it is there, with the version that found it; the same command goes on where
    it was interrupted, and keeps results of earlier versions. Those of --again stay until what is found anew
    takes their place. The workers of a scheduler read the files
    themselves, so they must see them under the same names.

    Examples:
      truearm study accuracy ur10=measurements.csv -o accuracy
      truearm study accuracy ur10=a.csv abb-irb-120=b.csv -o accuracy --seeds 2
      truearm study accuracy ur10=a.csv -o accuracy --methods constant,ours
    """
    from truearm.cli.calibrate import check_directory
    from truearm.studies.accuracy.running import Where, conduct
    from truearm.studies.accuracy.running import so_far as gather
    from truearm.studies.accuracy.summary import summarise

    asked = {"methods": methods, "splits": splits, "split_by": split_by, "sizes": sizes, "seeds": seeds}
    study = _study(data, robot, (length_unit, angle_unit), asked, quick=quick)
    where = Where(scheduler, workers, _again(again, study, so_far=so_far))
    check_directory(output)
    with ends_promptly(lambda: _left_behind(output)):
        _warn_of(study)
        make_directory(output)
        outcome = gather(study, output) if so_far else conduct(study, output, where, told_progress())
        if so_far and not outcome.records:
            raise InputError(
                "there is no result of what is asked",
                where=str(output),
                rule="Results are known by set, split, size, seed and method",
                way_out="Give --so-far the files and options of the study that it is to tell of",
            )
        summary = summarise(study, outcome)
        files = _write(summary, output)
    if as_json:
        print_json(summary)
    else:
        _print(summary, outcome, files)
    if outcome.errors:
        name, error = next(iter(outcome.errors.items()))
        raise WorkError(
            f"{outcome.asked - len(outcome.records)} results are missing, the first of {name}: {error}",
            way_out="The same command tries them again; --methods leaves methods out",
        )
    _check_fitted(outcome)


def _check_fitted(outcome: "Outcome") -> None:
    """Raise WorkError where no method could be fitted to any rows of a set."""
    for name in dict.fromkeys(record["set"] for record in outcome.records):
        found = [record for record in outcome.records if record["set"] == name]
        if all("failed" in record for record in found):
            raise WorkError(
                f'nothing could be fitted to the set "{name}"',
                rule=f"The first of {len(found)} failures is of {found[0]['method']}: {found[0]['failed']}",
                way_out="Ask for other --sizes, or see what `truearm calibrate` says of the measurements",
            )


def _study(
    data: Sequence[str],
    robot: str | None,
    units: tuple[str | None, str | None],
    asked: Mapping[str, Any],
    *,
    quick: bool,
) -> "Study":
    from truearm.studies.accuracy.cells import Asked, parse_sizes, study_seeds
    from truearm.studies.accuracy.methods import check_methods
    from truearm.studies.accuracy.running import Study
    from truearm.studies.accuracy.sets import parse_sets
    from truearm.studies.accuracy.splits import check_kinds

    split_by = _words(asked["split_by"])
    named = _words(asked["splits"])
    kinds = check_kinds(named, split_by=bool(split_by))
    stated = tuple(kind for kind in kinds if kind in named or kind == "groups")
    return Study(
        parse_sets(data, robot, *units),
        Asked(kinds, split_by, parse_sizes(asked["sizes"]), study_seeds(asked["seeds"]), stated),
        check_methods(_words(asked["methods"])),
        quick,
    )


def _left_behind(output: Path) -> str:
    """What an interrupted study leaves."""
    from truearm.studies.accuracy.results import LINES_NAME

    if not (output / LINES_NAME).exists():
        return "There is no result yet; the same command begins anew."
    return f"Results so far are in {output}; the same command goes on with the others."


def _again(given: str | None, study: "Study", *, so_far: bool) -> tuple[str, ...]:
    """Methods whose results are found anew, all of which the study compares."""
    from truearm.studies.accuracy.methods import check_methods

    names = check_methods(_words(given)) if given else ()
    others = [name for name in names if name not in study.methods]
    if others:
        raise UsageError(
            f"{list_names(others)}: not compared here",
            where="--again",
            rule=f"--methods names {list_names(study.methods)}",
            way_out="Name the same methods in both",
        )
    if names and so_far:
        raise UsageError(
            "--again with --so-far",
            rule="--so-far runs nothing, so that nothing is found anew",
            way_out="Leave one of them out",
        )
    return names


def _words(given: str | None) -> tuple[str, ...]:
    return tuple(word.strip() for word in given.split(",") if word.strip()) if given else ()


def _warn_of(study: "Study") -> None:
    """Read all sets before any work, and say what is to be known of them; refuse what none can answer."""
    from truearm.rows.splitting import split_columns
    from truearm.studies.accuracy.cells import check_askable
    from truearm.studies.accuracy.sets import read_set

    for one in study.sets:
        warn(read_set(one).notices)
    columns = {name for one in study.sets for name in split_columns(read_set(one).data)}
    for name in study.asked.split_by:
        if name not in columns:
            raise UsageError(f'no set has a column "{name}"', where="--split-by")
    warn(check_askable(study.sets, study.asked))


def _write(summary: Mapping[str, Any], output: Path) -> list[Path]:
    from truearm.studies.accuracy.page import page
    from truearm.studies.accuracy.pictures import save_curves

    write_whole(output / JSON_NAME, json.dumps(summary, indent=1, allow_nan=False) + "\n")
    write_whole(output / PAGE_NAME, page(summary))
    return [output / PAGE_NAME, output / JSON_NAME, *save_curves(summary, output)]


def _print(summary: Mapping[str, Any], outcome: "Outcome", files: Sequence[Path]) -> None:
    rows = []
    for group in summary["groups"]:
        lead = group["lead"]
        if lead is not None:
            means = (f"{lead['ours_mm']:.3f}", lead["best"], f"{lead['best_mm']:.3f}")
            rows.append((group["set"], group["split"], group["size"], str(lead["runs"]), *means))
    if rows:
        head = ("set", "split", "poses", "runs", "ours, mm", "best other", "mm")
        print_table(head, rows, title="Mean held-out error, median over runs", left=(0, 1, 5))
    if not summary["groups"]:
        tell("No question has all its methods yet.")
    say(f"{summary['there']} of {outcome.asked} results are there, {outcome.run} of them found now.")
    if summary["failed"]:
        say(f"{summary['failed']} more could not be fitted: {files[0]} says why.")
    for path in files:
        say(f"Written: {path}")
    suggest("truearm calibrate ROBOT MEASUREMENTS -o DIR", when="Calibrate an arm with ours:")
