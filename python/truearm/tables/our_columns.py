"""Names of measurement columns as we write them, with and without their unit."""

from typing import Final

from truearm.named_values import JOINT
from truearm.tables.columns import (
    DISTANCE_COLUMN,
    QUATERNION,
    SIGMA_COLUMNS,
    SIGMA_OF_TURN,
    TARGET_COLUMN,
    WORDS,
)
from truearm.units import COLUMN_ANGLE_UNITS, COLUMN_LENGTH_UNITS

UNITS: Final = COLUMN_LENGTH_UNITS + COLUMN_ANGLE_UNITS
TURN: Final = "sigma_rad"
"""The sigma of an orientation, as it is written."""


def without_unit(name: str) -> tuple[str, str]:
    """One of our names without the unit at its end, and that; any other name as it is, and "".

    Sigmas of orientations are told from those of positions by their unit: they keep that in which they are
    written.
    """
    turned = SIGMA_OF_TURN.fullmatch(name)
    if turned:
        return TURN, turned[1]
    bare, _, unit = name.rpartition("_")
    return (bare, unit) if unit in UNITS and is_ours(bare) else (name, "")


def is_ours(name: str) -> bool:
    """Whether a name, without unit, is one of a measurement column."""
    patterns = (JOINT, TARGET_COLUMN, *SIGMA_COLUMNS, DISTANCE_COLUMN)
    has_unit = any(name.endswith(f"_{unit}") for unit in UNITS)
    is_plain = not has_unit and any(pattern.fullmatch(name) for pattern in patterns)
    return is_plain or name in (*QUATERNION, *WORDS, TURN)


def order(ours: str) -> tuple[int, int, str]:
    """Joints, targets, quaternion, then the rest."""
    joint, target = JOINT.fullmatch(ours), TARGET_COLUMN.fullmatch(ours)
    if joint:
        return 0, int(joint[1]), ""
    if target:
        return 1 if not target[2] else 3, int(target[2] or 1), target[1]
    return (2, QUATERNION.index(ours), "") if ours in QUATERNION else (4, 0, ours)
