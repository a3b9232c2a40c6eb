"""`truearm study experiment`: the paper's experiment on the virtual cell, through the real process."""

import json
from dataclasses import replace
from typing import Annotated, Final

import typer

from truearm.cli.arguments import AsJson, OutputDirectory, Scheduler, Workers
from truearm.cli.calibrate import check_directory
from truearm.cli.console import print_json, print_table, say, suggest
from truearm.cli.interrupt import end_at_once, ends_promptly
from truearm.cli.measure_progress import Teller
from truearm.cli.progress import told_stages
from truearm.defaults import EXPERIMENT_SPEED, PAPER_POSES, PAPER_REGIONS
from truearm.errors import typed
from truearm.files import make_directory, write_whole

JSON_NAME: Final = "experiment.json"
PAGE_NAME: Final = "experiment.md"


def command(
    output: OutputDirectory,
    regions: Annotated[int, typer.Option(min=2, help="Into how many the space is divided.")] = PAPER_REGIONS,
    poses: Annotated[int, typer.Option(help="Measured in each region to identify it.")] = PAPER_POSES,
    speed: Annotated[
        float, typer.Option(min=1.0, metavar="X", help="How fast the virtual clock runs.")
    ] = EXPERIMENT_SPEED,
    seeds: Annotated[int, typer.Option(min=1, help="How many virtual arms.")] = 1,
    scheduler: Scheduler = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Repeat the paper's experiment (section 7) on its virtual cell and say where they agree.

    A virtual RV-M2, an x-y-z table and a touch panel are measured by the same process and drivers as real
    ones, over pseudo-terminals: 85 regions, twenty poses in each. DIR/session.db keeps the readings: after
    Ctrl-C the same command goes on. Writes DIR/experiment.json, DIR/experiment.md (what the paper states
    beside what comes out) and the panels of Figure 10 as PNG and SVG.

    Of several arms the first is that of Figure 10, and the others, with sessions of their own in DIR/arm-S,
    tell what holds beyond it. They are measured side by side; the workers of a scheduler write into DIR
    themselves, so they must see it under the same name.

    An arm takes some minutes on two cores.

    Examples:
      truearm study experiment -o experiment
      truearm study experiment -o small --regions 8 --json
      truearm study experiment -o arms --seeds 10 --scheduler tcp://10.0.0.5:8786
    """
    from truearm.studies.panels import save_panels
    from truearm.studies.process.judging import AGREES, arms_that_agree
    from truearm.studies.process.page import page
    from truearm.studies.process.setting import Setting
    from truearm.studies.process.several import conduct_arms

    first = Setting(regions=regions, poses=poses, speed=speed)
    check_directory(output)
    make_directory(output)
    settings = [replace(first, seed=first.seed + number) for number in range(seeds)]
    kept = f"What was measured is in {output}; the same command goes on with it"
    kept += " once the cluster's workers are through with the arms under way." if scheduler else "."
    try:
        with Teller() as teller, ends_promptly(lambda: kept):
            result, drawn = conduct_arms(
                settings, output, teller.tell, told_stages(), scheduler=scheduler, workers=workers
            )
    except KeyboardInterrupt:
        end_at_once()
    write_whole(output / JSON_NAME, json.dumps(result, indent=1, allow_nan=False) + "\n")
    write_whole(output / PAGE_NAME, page(result))
    files = save_panels({"figure10": drawn}, output)
    if as_json:
        print_json(result)
        return
    rows = [(each["place"], each["ours"], AGREES[each["agrees"]]) for each in result["statements"]]
    print_table(("the paper", "what comes out here", "agrees"), rows, left=(0, 1, 2))
    if "over_arms" in result:
        held = [(each["paper"], arms_that_agree(each)) for each in result["over_arms"]["statements"]]
        print_table(("the paper", f"agrees on, of {seeds} arms"), held, left=(0,))
    for path in (output / PAGE_NAME, output / JSON_NAME, *files):
        say(f"Written: {path}")
    suggest(f"truearm session show {typed(output / 'session.db')}")
