"""A session measured in a virtual cell that lives as long as it takes."""

from collections.abc import Callable
from pathlib import Path

from truearm.cell.cell_file import Cell
from truearm.cell.measuring import Process, Progress
from truearm.cell.opening import open_session
from truearm.cell.poses_file import Poses
from truearm.cell.running import run
from truearm.cell.virtual.launch import VirtualCell


def measure_virtually(text: str, poses: Poses, path: Path, report: Callable[[Progress], None]) -> str:
    """Start the virtual devices of a cell file, measure poses with the process, and end the devices.

    Args:
        text: The cell file.
        poses: What is measured.
        path: The session file; continued if it is there.
        report: Told of the progress.

    Returns:
        How the process ended.

    Raises:
        KeyboardInterrupt: After Ctrl-C; the session can be continued.
        InputError: If the cell file is wrong, or the session is of something else.
        WorkError: If the process cannot go on.
    """
    with VirtualCell(text) as virtual:
        cell = Cell.from_toml(virtual.cell_toml())
        with open_session(path, cell, poses) as session:
            return run(Process(cell, session, report))
