"""Arms and their data, as the study is told them: ROBOT=FILE.csv."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truearm.doubts.admitted import admitted
from truearm.errors import InputError, Notice, UsageError
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.rows.visits import one_row_a_visit, pose_numbers


@dataclass(frozen=True)
class DataSet:
    """Measurements of one arm.

    Attributes:
        name: Stem of the file; names the set in results.
        robot: Library name or file of the arm.
        file: CSV file.
        length_unit: Of columns that name none; m without.
        angle_unit: Of joint columns that name none; rad without.
    """

    name: str
    robot: str
    file: str
    length_unit: str | None = None
    angle_unit: str | None = None


@dataclass(frozen=True, eq=False)
class Read:
    """A set that was read.

    Attributes:
        robot: The arm.
        data: What was measured, without repeated rows; shots of one visit to a pose are one row.
        pose: First row of each row's pose (n,), whatever its set-up.
        print_: Short hash of arm and data, by which results are known again.
        notices: What the user should know.
    """

    robot: Robot
    data: Measurements
    pose: NDArray[np.int64]
    print_: str
    notices: tuple[Notice, ...]


def parse_sets(
    given: Sequence[str], robot: str | None, length_unit: str | None = None, angle_unit: str | None = None
) -> tuple[DataSet, ...]:
    """Sets from texts "ROBOT=FILE", or "FILE" where `robot` is given.

    Raises:
        UsageError: If an arm is missing, or two files have the same name.
    """
    sets = []
    for text in given:
        before, equals, behind = text.partition("=")
        arm, file = (before, behind) if equals else (robot or "", text)
        if not arm or not file:
            raise UsageError(
                f'"{text}" names no arm',
                rule="Write ROBOT=FILE.csv, such as ur10=measurements.csv",
                way_out="Or name the arm of all files with --robot",
            )
        sets.append(DataSet(Path(file).stem, arm, file, length_unit, angle_unit))
    names = [one.name for one in sets]
    for one in sets:
        if names.count(one.name) > 1:
            raise UsageError(
                f'two files are called "{one.name}"',
                rule="Results are known by the name of the file",
                way_out="Rename one of them",
            )
    return tuple(sets)


@lru_cache(maxsize=8)
def read_set(data_set: DataSet) -> Read:
    """Read robot and measurements; what was read last is kept.

    Raises:
        InputError: If either cannot be read, or the measurements cannot be of the arm.
    """
    robot = Robot.load(data_set.robot)
    data = Measurements.read_csv(
        data_set.file,
        joints=robot.joints,
        length_unit=data_set.length_unit,
        angle_unit=data_set.angle_unit,
    )
    if data.target_count == 0:
        raise InputError(
            "distances were measured, not points", where=data_set.file, rule="Methods are judged at points"
        )
    data, notices = admitted(data, robot)
    visits = one_row_a_visit(data)
    notices += _shots(data, visits)
    data = visits
    described = json.dumps(robot.to_dict(), sort_keys=True) + data.hash()
    short = hashlib.sha256(described.encode()).hexdigest()[:12]
    pose = pose_numbers(data.readings, np.full(len(data), ""))
    return Read(robot, data, pose, short, tuple(notices))


def _shots(rows: Measurements, visits: Measurements) -> list[Notice]:
    """A notice where rows were taken together because they are shots of one visit to a pose."""
    if len(rows) == len(visits):
        return []
    text = (
        f"{len(rows)} rows are {len(visits)} visits to poses: rows after one another that were read at the "
        "same pose are one row for every method, their mean. Most methods would take them for as many poses."
    )
    return [Notice("one_row_a_visit", text)]
