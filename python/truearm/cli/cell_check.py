"""`truearm cell check`: connect to the devices of a cell."""

from truearm.cli.arguments import AsJson, CellFile
from truearm.cli.console import print_json, say, suggest
from truearm.errors import typed


def command(
    cell: CellFile,
    as_json: AsJson = False,
) -> None:
    """Connect to the devices of a cell and ask them where they are.

    Connecting an RV-M2 drives it to its mechanical origin; nothing here can stop that motion. No other robot
    moves.

    Examples:
      truearm cell check cell.toml
    """
    from truearm.cell.alone import alone
    from truearm.cell.cell_file import Cell
    from truearm.cell.protocols import Connected

    known = Cell.load(cell)
    with alone(known), Connected(known.sensor, known.robot):
        readings = known.robot.read_joints().tolist()
    if as_json:
        print_json({"robot": known.robot.address, "sensor": known.sensor.address, "readings": readings})
        return
    say(f"{known.sensor.name} at {known.sensor.address} is connected; the first reading shows what it says.")
    say(f"{known.robot.name} at {known.robot.address} answers; its joints:")
    say("  " + ", ".join(f"{reading:.4f}" for reading in readings))
    suggest(f"truearm measure {typed(cell)} poses.csv --dry-run")
