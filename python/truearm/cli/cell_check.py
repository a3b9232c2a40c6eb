"""`truearm cell check`: connect to the devices of a cell."""

from pathlib import Path
from typing import Annotated

import typer

from truearm.cli.console import print_json, say


def command(
    cell: Annotated[Path, typer.Argument(metavar="CELL", help="A cell file.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout and nothing else.")] = False,
) -> None:
    """Connect to the devices of a cell and ask them where they are; nothing moves but what connecting moves.

    Example: truearm cell check cell.toml
    """
    from truearm.cell.cell_file import Cell  # noqa: PLC0415
    from truearm.cell.protocols import Connected  # noqa: PLC0415

    known = Cell.load(cell)
    with Connected(known.sensor, known.robot):
        readings = known.robot.read_joints().tolist()
    if as_json:
        print_json({"robot": known.robot.address, "sensor": known.sensor.address, "readings": readings})
        return
    say(f"{known.sensor.name} at {known.sensor.address} answers.")
    say(f"{known.robot.name} at {known.robot.address} answers; its joints:")
    say("  " + ", ".join(f"{reading:.4f}" for reading in readings))
