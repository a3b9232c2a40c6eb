"""How a table writes orientations, as stated in one option: KIND:DETAILS=COLUMN,COLUMN,..."""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from truearm.arrays import rotation_fault
from truearm.errors import InputError, UsageError, list_names, list_rows
from truearm.rotations import (
    check_euler_sequence,
    quaternion_from_euler,
    quaternion_from_matrix,
    quaternion_from_rotation_vector,
)
from truearm.types import Floats
from truearm.units import ANGLE_UNITS, FULL_TURN, to_si

FORMS: Final = (
    "euler:XYZ:deg=RX,RY,RZ (capitals: moving axes; small letters: fixed axes)",
    "vector:rad=RX,RY,RZ (rotation vector)",
    "quaternion:wxyz=A,B,C,D (or xyzw)",
    "matrix=R11,R12,R13,R21,R22,R23,R31,R32,R33 (row by row)",
)
A_TURN: Final = FULL_TURN * (1.0 + 1e-6)
ROUNDED: Final = 0.02
"""So far from unit length and right angles are a rotation matrix's columns with few decimals, at the most."""


@dataclass(frozen=True)
class RotationColumns:
    """Columns that hold world_from_target.

    Attributes:
        kind: "euler", "vector" (rotation vector), "quaternion" or "matrix".
        order: Axes of Euler angles, as in "XYZ"; order of the parts of a quaternion, "wxyz" or "xyzw".
        unit: "rad" or "deg"; "" for a quaternion or a matrix.
        columns: Names of the columns, in that order.
    """

    kind: Literal["euler", "vector", "quaternion", "matrix"]
    order: str
    unit: str
    columns: tuple[str, ...]

    @classmethod
    def parse(cls, text: str) -> "RotationColumns":
        """Read an option such as "euler:XYZ:deg=rx,ry,rz".

        Raises:
            UsageError: If it has another form.
        """
        head, _, tail = text.partition("=")
        columns = tuple(name.strip() for name in tail.split(",")) if tail else ()
        match head.split(":"):
            case ["euler", order, unit] if unit in ANGLE_UNITS and len(columns) == 3:
                check_euler_sequence(order)
                return cls("euler", order, unit, columns)
            case ["vector", unit] if unit in ANGLE_UNITS and len(columns) == 3:
                return cls("vector", "", unit, columns)
            case ["quaternion", order] if order in ("wxyz", "xyzw") and len(columns) == 4:
                return cls("quaternion", order, "", columns)
            case ["matrix"] if len(columns) == 9:
                return cls("matrix", "", "", columns)
        raise UsageError(f'"{text}" is no rotation', where="--rotation", rule=f"Write {'; '.join(FORMS)}")

    def quaternions(self, values: Floats) -> Floats:
        """Quaternions (n, 4), w first, of the columns' values (n, 3), (n, 4) or (n, 9); NaN rows stay NaN.

        Raises:
            InputError: If a row has some of the values and not all, what should be a rotation matrix does not
                turn, or an angle is longer than a turn.
        """
        given = np.isfinite(values).all(axis=1)
        partial = np.isfinite(values).any(axis=1) & ~given
        if partial.any():
            raise InputError(
                f"only some of {list_names(self.columns)} are given in "
                f"{list_rows((np.flatnonzero(partial) + 1).tolist())}",
                where="--rotation",
                rule=f"An orientation has all {len(self.columns)} numbers, or all these cells are empty",
                way_out="Correct or remove the rows",
            )
        if self.kind == "quaternion":
            return values if self.order == "wxyz" else values[:, [3, 0, 1, 2]]
        quaternions = np.full((len(values), 4), np.nan)
        if self.kind == "matrix":
            quaternions[given] = quaternion_from_matrix(_rotations(values[given], np.flatnonzero(given)))
            return quaternions
        angles = to_si(values, self.unit)
        _check_angles(angles, self.unit)
        if self.kind == "euler":
            quaternions[given] = quaternion_from_euler(angles[given], self.order)
        else:
            quaternions[given] = quaternion_from_rotation_vector(angles[given])
        return quaternions


def _check_angles(angles: Floats, unit: str) -> None:
    """Raise InputError where angles (n, 3) in rad are longer than a turn."""
    longest = np.nanmax(np.abs(angles), initial=0.0)
    if longest > A_TURN:
        raise InputError(
            f"there are angles of {longest / to_si(1.0, unit):.4g} {unit}",
            where="--rotation",
            rule="Orientations are within a turn",
            way_out="If these are degrees, say deg" if unit == "rad" else "Check which columns they are",
        )


def _rotations(values: Floats, rows: NDArray[np.int64]) -> Floats:
    """Rotations (n, 3, 3) of numbers (n, 9) that are found to be some; `rows` (n,) are their places."""
    matrices = values.reshape(-1, 3, 3)
    fault = rotation_fault(matrices, ROUNDED)
    if fault is not None:
        raise InputError(
            f"the nine numbers of {list_rows((rows[fault.rows] + 1).tolist())} are no rotation matrix: "
            f"{fault.why}",
            where="--rotation",
            rule="Its columns have length one, stand at right angles and form a right-handed frame",
            way_out="Name the columns row by row: matrix=R11,R12,R13,R21,...",
        )
    return matrices
