"""How a table writes orientations, as stated in one option: KIND:DETAILS=COLUMN,COLUMN,..."""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from truearm.errors import UsageError
from truearm.rotations import check_euler_sequence, quaternion_from_euler, quaternion_from_rotation_vector
from truearm.units import ANGLE_UNITS, to_si

Floats = NDArray[np.float64]

FORMS: Final = (
    "euler:XYZ:deg=RX,RY,RZ (capitals: moving axes; small letters: fixed axes)",
    "vector:rad=RX,RY,RZ (rotation vector)",
    "quaternion:wxyz=A,B,C,D (or xyzw)",
)


@dataclass(frozen=True)
class RotationColumns:
    """Columns that hold world_from_target.

    Attributes:
        kind: "euler", "vector" (rotation vector) or "quaternion".
        order: Axes of Euler angles, as in "XYZ"; order of the parts of a quaternion, "wxyz" or "xyzw".
        unit: "rad" or "deg"; "" for a quaternion.
        columns: Names of the columns, in that order.
    """

    kind: Literal["euler", "vector", "quaternion"]
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
        raise UsageError(f'"{text}" is no rotation', where="--rotation", rule=f"Write {'; '.join(FORMS)}")

    def quaternions(self, values: Floats) -> Floats:
        """Quaternions (n, 4), w first, of the columns' values (n, 3) or (n, 4); NaN rows stay NaN."""
        if self.kind == "quaternion":
            return values if self.order == "wxyz" else values[:, [3, 0, 1, 2]]
        angles = to_si(values, self.unit)
        given = np.isfinite(angles).all(axis=1)
        quaternions = np.full((len(values), 4), np.nan)
        if self.kind == "euler":
            quaternions[given] = quaternion_from_euler(angles[given], self.order)
        else:
            quaternions[given] = quaternion_from_rotation_vector(angles[given])
        return quaternions
