"""`truearm cell`: a virtual cell that speaks the real protocols, a check of a real one, and examples."""

from typing import Final

from truearm.cli.entry import Entry

HELP: Final = """Cell files to begin with, a check of a cell's devices, and a virtual cell.

Examples:
  truearm cell example rv-m2 -o cell.toml
  truearm cell simulate cell.toml --speed 20 -o virtual.toml
  truearm cell check virtual.toml
"""
COMMANDS: Final = (
    Entry("example", "truearm.cli.cell_example", "Write a cell file to begin with."),
    Entry("check", "truearm.cli.cell_check", "Connect to the devices of a cell."),
    Entry("simulate", "truearm.cli.cell_simulate", "Start the devices of a cell as virtual ones."),
)
