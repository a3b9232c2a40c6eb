"""`truearm study experiment`: the paper's experiment on the virtual cell, through the real process."""

import json
from typing import Annotated, Final

import typer

from truearm.cli.arguments import AsJson, OutputDirectory
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
CELL_NAME: Final = "cell.toml"


def command(
    output: OutputDirectory,
    regions: Annotated[int, typer.Option(min=2, help="Into how many the space is divided.")] = PAPER_REGIONS,
    poses: Annotated[int, typer.Option(min=5, help="Measured in each region to identify it.")] = PAPER_POSES,
    speed: Annotated[
        float, typer.Option(min=1.0, metavar="X", help="How fast the virtual clock runs.")
    ] = EXPERIMENT_SPEED,
    as_json: AsJson = False,
) -> None:
    """Repeat the paper's experiment (section 7) on its virtual cell and say where they agree.

    A virtual RV-M2, an x-y-z table and a touch panel are measured by the same process and drivers as real
    ones, over pseudo-terminals: 85 regions, twenty poses in each. DIR/session.db keeps the readings: after
    Ctrl-C the same command goes on. Writes DIR/experiment.json, DIR/experiment.md (what the paper states
    beside what comes out) and the panels of Figure 10 as PNG and SVG.

    Takes some minutes on two cores.

    Examples:
      truearm study experiment -o experiment
      truearm study experiment -o small --regions 8 --json
    """
    from truearm.studies.panels import save_panels
    from truearm.studies.process.conducting import conduct_experiment
    from truearm.studies.process.judging import judged
    from truearm.studies.process.page import page
    from truearm.studies.process.setting import Setting, cell_text

    check_directory(output)
    make_directory(output)
    setting = Setting(regions=regions, poses=poses, speed=speed)
    write_whole(output / CELL_NAME, cell_text(setting))
    kept = f"The session is in {output}; the same command goes on with it."
    try:
        with Teller() as teller, ends_promptly(lambda: kept):
            result, drawn = conduct_experiment(setting, output, teller.tell, told_stages())
    except KeyboardInterrupt:
        end_at_once()
    result |= judged(result)
    files = save_panels({"figure10": drawn}, output)
    write_whole(output / JSON_NAME, json.dumps(result, indent=1, allow_nan=False) + "\n")
    write_whole(output / PAGE_NAME, page(result))
    if as_json:
        print_json(result)
        return
    rows = [(each["place"], each["ours"], "yes" if each["agrees"] else "no") for each in result["statements"]]
    print_table(("the paper", "what comes out here", "agrees"), rows, left=(0, 1, 2))
    for path in (output / PAGE_NAME, output / JSON_NAME, *files):
        say(f"Written: {path}")
    suggest(f"truearm session show {typed(output / 'session.db')}")
