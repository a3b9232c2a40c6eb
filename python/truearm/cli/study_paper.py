"""`truearm study paper`: every simulation of the paper's section 6, over seeds."""

import json
from typing import Annotated, Final

import typer

from truearm.cli.arguments import AsJson, OutputDirectory, Scheduler, Workers
from truearm.cli.calibrate import check_directory
from truearm.cli.console import print_json, print_table, say, suggest
from truearm.cli.interrupt import ends_promptly
from truearm.cli.progress import told_stages
from truearm.defaults import PAPER_FIGURES
from truearm.errors import UsageError, typed
from truearm.files import make_directory, write_whole

JSON_NAME: Final = "paper.json"
PAGE_NAME: Final = "paper.md"


def command(
    output: OutputDirectory,
    figure: Annotated[
        list[str] | None,
        typer.Option(metavar="|".join(PAPER_FIGURES), help="One of them; may be repeated.  [default: all]"),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="How many virtual arms.")] = 20,
    scheduler: Scheduler = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Reproduce the paper's simulations on its virtual arm and say where they agree.

    Writes DIR/paper.json (every scheme's errors along the path and over the workspace, medians and 5 and 95 %
    quantiles over the seeds), DIR/paper.md (what the paper states beside what comes out, and the readings
    chosen), and the panels of the first seed as PNG and SVG.

    Twenty seeds take less than half an hour on two cores, one takes some minutes.

    Examples:
      truearm study paper -o study --seeds 1 --figure 6
      truearm study paper -o study
      truearm study paper -o study --scheduler tcp://10.0.0.5:8786
    """
    chosen = tuple(figure) if figure else PAPER_FIGURES
    for name in chosen:
        if name not in PAPER_FIGURES:
            raise UsageError(
                f'there is no figure "{name}"', where="--figure", rule=f"Of {', '.join(PAPER_FIGURES)}"
            )
    check_directory(output)
    from truearm.studies.paper_results import conduct_study, save_pictures

    make_directory(output)
    with ends_promptly():
        study = conduct_study(range(seeds), chosen, told_stages(), scheduler=scheduler, workers=workers)
    write_whole(output / JSON_NAME, json.dumps(study.result, indent=1, allow_nan=False) + "\n")
    write_whole(output / PAGE_NAME, study.page)
    files = save_pictures(study, output)
    if as_json:
        print_json(study.result)
        return
    rows = [
        (entry["claim"], f"{entry['value']['median']:.3g}", entry["limit"], _word(entry["reached"]))
        for entry in study.result["claims"]
    ]
    print_table(("claim, median over the seeds", "", "to reach", ""), rows, left=(0, 2))
    for path in (output / PAGE_NAME, output / JSON_NAME, *files):
        say(f"Written: {path}")
    if figure:
        suggest(f"truearm study paper -o {typed(output)}", when="All figures over twenty arms:")


def _word(reached: bool | None) -> str:
    return {True: "yes", False: "no", None: ""}[reached]
