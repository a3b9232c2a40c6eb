"""The fields of a robot of which a Denavit-Hartenberg table is known, and perhaps no more."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from truearm.arrays import as_numbers
from truearm.description.robot_data import Joint
from truearm.description.robot_file import ROW_KEYS
from truearm.errors import InputError, count_of
from truearm.named_values import check_row
from truearm.types import Floats

WITHOUT_BETA: Final = 4
WITH_BETA: Final = 5


def table_fields(
    table: ArrayLike, joints: Sequence[Joint] | None, limits: ArrayLike | None, coupling: ArrayLike | None
) -> dict[str, Any]:
    """All fields of a Robot but its name, source and convention; arguments as in Robot.from_table.

    Raises:
        InputError: If the table is not finite numbers (N, 4) or (N, 5), a row of each joint.
    """
    rows = _rows(table)
    count = len(rows)
    kinds = ("revolute",) * count if joints is None else tuple(joints)
    if len(kinds) != count:
        raise InputError(
            count_of(len(kinds), "joint"), where="joints", rule=f"The table has {count}, one a row"
        )
    free = np.tile([-np.inf, np.inf], (count, 1))
    return {
        "joints": kinds,
        "table": rows,
        "base": np.eye(4),
        "flange": np.eye(4),
        "tool": np.eye(4),
        "base_row": None,
        "coupling": np.eye(count) if coupling is None else as_numbers(coupling, what="values of coupling"),
        "limits": free if limits is None else as_numbers(limits, what="values of limits"),
    }


def _rows(table: ArrayLike) -> Floats:
    """A table (N, 5) of one that may be without beta."""
    rows = as_numbers(table, what="values of table")
    check_row(table, ROW_KEYS, what="the table")
    if rows.ndim != 2 or rows.shape[1] not in {WITHOUT_BETA, WITH_BETA} or len(rows) == 0:
        raise InputError(
            f"shape {rows.shape}",
            where="table",
            rule=f"It has a row of theta, d, a, alpha for each link, (N, {WITHOUT_BETA}), "
            f"or of theta, d, a, alpha, beta, (N, {WITH_BETA})",
        )
    return np.pad(rows, ((0, 0), (0, WITH_BETA - rows.shape[1])))
