"""What an arm of the fleet is calibrated from: found, read, and known again by a hash."""

import hashlib
import json
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from truearm.errors import InputError, UsageError
from truearm.files import read_bytes
from truearm.fleet.fleet_file import Entry
from truearm.measurements import Measurements
from truearm.robot import Robot

PATTERN: Final = frozenset("*?[")


@dataclass(frozen=True, eq=False)
class Inputs:
    """The inputs of an arm.

    Attributes:
        entry: The arm.
        robot: The nominal arm.
        files: Measurement files.
        previous: Bytes of its last calibration; None where there is none.
        digest: SHA-256 of all of it, the options and the version of truearm.
    """

    entry: Entry
    robot: Robot
    files: tuple[Path, ...]
    previous: bytes | None
    digest: str

    def measurements(self) -> Measurements:
        """What was measured.

        Raises:
            InputError: If a file cannot be used.
        """
        section = self.entry.section
        return Measurements.read_files(
            self.files,
            length_unit=section.length_unit,
            angle_unit=section.angle_unit,
            joints=self.robot.joints,
        )


def find_inputs(entry: Entry, output: Path) -> Inputs:
    """Find and read what an arm is calibrated from; measurements are not yet parsed.

    Args:
        entry: The arm.
        output: Directory of the fleet's results.

    Raises:
        InputError: If a file is not there or cannot be used.
        UsageError: If the last calibration is one that the new one would be written over.
    """
    robot = Robot.load(_robot(entry))
    files = tuple(file for pattern in entry.measurements for file in _matching(entry.folder, pattern))
    previous = None if entry.previous is None else _previous(entry.folder / entry.previous, entry, output)
    return Inputs(entry, robot, files, previous, _digest(entry, robot, files, previous))


def _robot(entry: Entry) -> str:
    """A file beside the fleet file, or a name of the library."""
    path, mark, chain = entry.robot.partition("#")
    beside = entry.folder / path
    return f"{beside}{mark}{chain}" if beside.is_file() else entry.robot


def _matching(folder: Path, pattern: str) -> list[Path]:
    """The file of that name, or those that are like it, sorted."""
    file = folder / pattern
    if file.is_file() or not PATTERN & set(pattern):
        return [file]
    named = Path(pattern)
    start = Path(named.anchor) if named.is_absolute() else folder
    found = sorted(start.glob(str(named.relative_to(named.anchor))))
    if not found:
        raise InputError("no file is like this", where=str(file), way_out="Correct measurements of this arm")
    return found


def _previous(path: Path, entry: Entry, output: Path) -> bytes:
    if path.resolve().is_relative_to((output / entry.name).resolve()):
        raise UsageError(
            "the last calibration lies where the new one will be written",
            where=str(path),
            rule="It would be lost",
            way_out="Name another directory with -o",
        )
    return read_bytes(path)


def _digest(entry: Entry, robot: Robot, files: tuple[Path, ...], previous: bytes | None) -> str:
    content: dict[str, Any] = {
        "version": version("truearm"),
        "robot": robot.to_dict(),
        "options": entry.options.to_dict(),
        "measurements": [[file.name, hashlib.sha256(read_bytes(file)).hexdigest()] for file in files],
        "previous": None if previous is None else hashlib.sha256(previous).hexdigest(),
        "stated": [getattr(entry.section, key) for key in ("length_unit", "angle_unit", "strip", "report")],
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
