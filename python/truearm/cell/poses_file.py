"""The poses to measure: a CSV file with joint columns, and how each pose is approached."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import InputError, list_names, list_rows
from truearm.robot import Robot
from truearm.tables.columns import APPROACH, PURPOSE, StatedUnits
from truearm.tables.measured_fields import read_joint_columns
from truearm.tables.reading import Table, read_csv_table
from truearm.types import Floats

GROUP: Final = "group"
MOST_NAMED: Final = 3
DIRECTIONS: Final = (-1.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Poses:
    """n poses to measure, in their order.

    Attributes:
        readings: Joint readings (n, N), rad or m.
        approach: From which side joints come (n,): 1 from lower readings, -1 from higher, 0 from anywhere.
        purpose: What each is for (n,), such as "train", "validate" or "repeat".
        group: Set-up of a calibration that they are meant for; None for any.
        at_limits: Which poses (from 0) come from anywhere only because a joint is at its limit on the side
            that the file asks for.
    """

    readings: Floats
    approach: NDArray[np.int64]
    purpose: tuple[str, ...]
    group: str | None = None
    at_limits: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.readings)

    @classmethod
    def read_csv(cls, path: str | Path, arm: Robot) -> "Poses":
        """Read a file with columns q1 ... qN, units in their names or rad and m.

        Columns approach, purpose and group may be there. A pose with a joint at its limit, on the side from
        which joints are to come, comes from anywhere.

        Raises:
            InputError: If a column is missing, a value breaks a rule, a pose is beyond the joint limits, or
                they are meant for several set-ups.
        """
        table = read_csv_table(Path(path))
        readings = read_joint_columns(table, StatedUnits(joints=arm.joints))
        if readings.shape[1] != arm.joint_count:
            raise InputError(
                f"there are {readings.shape[1]} joint columns",
                where=str(path),
                rule=f"{arm.name} has {arm.joint_count} joints",
            )
        low, high = arm.limits.T
        beyond = ((readings < low) | (readings > high)).any(axis=1)
        if beyond.any():
            rows = list_rows((np.flatnonzero(beyond) + 1).tolist())
            raise InputError(
                f"{rows} beyond the joint limits of {arm.name}",
                where=str(path),
                way_out="Correct them, or state units in the column names: q1_deg",
            )
        approach = table.numbers(APPROACH) if APPROACH in table.names else np.zeros(len(readings))
        wrong = np.flatnonzero(~np.isin(approach, DIRECTIONS))
        if wrong.size:
            raise InputError(
                f'column "{APPROACH}" holds {approach[wrong[0]]:g} in row {wrong[0] + 1}',
                where=str(path),
                rule="1 from lower readings, -1 from higher ones, 0 from anywhere",
            )
        end = np.where(approach[:, None] > 0.0, low, high)
        at_limits = (approach != 0.0) & (readings == end).any(axis=1)
        purpose = tuple(table.texts(PURPOSE).tolist()) if PURPOSE in table.names else ("",) * len(readings)
        sides = np.where(at_limits, 0, approach).astype(np.int64)
        return cls(readings, sides, purpose, _group(table), tuple(np.flatnonzero(at_limits).tolist()))


def _group(table: Table) -> str | None:
    """The one set-up that a list of poses is meant for; None where it does not say."""
    if GROUP not in table.names:
        return None
    named = list(dict.fromkeys(text for text in table.texts(GROUP).tolist() if text))
    if len(named) > 1:
        raise InputError(
            f'column "{GROUP}" holds {list_names(named[:MOST_NAMED])}',
            where=table.where,
            rule="Poses are measured in one set-up at a time",
            way_out="Leave the column out, or make a list of each set-up",
        )
    return named[0] if named else None
