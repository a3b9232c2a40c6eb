"""`truearm cell example`: cell files to begin with."""

from pathlib import Path
from typing import Annotated

import typer

from truearm.cli.arguments import AsJson
from truearm.cli.console import print_json, say, suggest
from truearm.errors import InputError, UsageError, did_you_mean, typed


def command(
    name: Annotated[str, typer.Argument(metavar="rv-m2|ur|tracker|playback", help="For which devices.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="Where the cell file goes.")
    ] = Path("cell.toml"),
    as_json: AsJson = False,
) -> None:
    """Write a cell file to begin with, all keys of which docs/reference/cell-file.md explains.

    Examples:
      truearm cell example rv-m2 -o cell.toml
    """
    from truearm.cell.examples import EXAMPLES, SIMULATED, example
    from truearm.files import write_whole

    if name not in EXAMPLES:
        way_out = did_you_mean(name, EXAMPLES)
        raise UsageError(
            f'there is no example "{name}"', rule=f"One of {', '.join(EXAMPLES)}", way_out=way_out
        )
    if output.exists():
        raise InputError("there is such a file already", where=str(output), way_out="Name another with -o")
    write_whole(output, example(name))
    if as_json:
        print_json({"cell": str(output)})
        return
    say(f"Cell file: {output}")
    if name in SIMULATED:
        suggest(f"truearm cell simulate {typed(output)}", f"truearm cell check {typed(output)}")
    else:
        suggest(f"truearm cell check {typed(output)}", when="Name the recorded file in it, then:")
