"""What a table states of how sure its measurements are."""

from typing import Final

import numpy as np

from truearm.errors import InputError
from truearm.tables.columns import Column, Layout
from truearm.tables.reading import Table
from truearm.tables.row_values import refuse_rows, si_values
from truearm.types import Floats

LARGEST_SIGMA_M: Final = 10.0
"""No instrument is less sure of a point that it has seen."""
LARGEST_SIGMA_RAD: Final = 1.0
"""Nor of an orientation."""


def read_sigmas(table: Table, layout: Layout) -> dict[str, Floats | None]:
    """The fields `sigma_m`, `sigma_axes_m` and `sigma_rad` of measurements; None where nothing is stated.

    Raises:
        InputError: If a value is no sigma, or nothing was measured that it could be of.
    """
    _check_measured(table, layout)
    turn, axes = layout.sigma_turn, [_lengths(table, column) for column in layout.sigma_axes]
    sigma = None if layout.sigma is None else _lengths(table, layout.sigma)
    if axes:
        sigma = np.asarray(np.sqrt(np.square(axes).mean(axis=0)))
    return {
        "sigma_m": sigma,
        "sigma_axes_m": np.column_stack(axes) if axes else None,
        "sigma_rad": None if turn is None else _angles(table, turn),
    }


def _check_measured(table: Table, layout: Layout) -> None:
    of_points = layout.sigma_axes and not layout.targets
    if of_points or (layout.sigma_turn is not None and not layout.quaternion):
        column = layout.sigma_axes[0] if of_points else layout.sigma_turn
        raise InputError(
            f'column "{column.name if column else ""}" is of nothing that was measured',
            where=table.where,
            rule=f"There are no {'coordinates x, y, z' if of_points else 'orientations qw, qx, qy, qz'}",
            way_out="Remove it; distances have sigma_mm" if of_points else "Remove it",
        )


def _lengths(table: Table, column: Column) -> Floats:
    of = "A sigma is the standard deviation of a measured coordinate"
    return _below(table, column, (LARGEST_SIGMA_M, "m"), of, "its unit: sigma is in m, sigma_mm in mm")


def _angles(table: Table, column: Column) -> Floats:
    of = "A sigma is the standard deviation of a measured orientation about each axis"
    return _below(table, column, (LARGEST_SIGMA_RAD, "rad"), of, "its unit")


def _below(table: Table, column: Column, most: tuple[float, str], rule: str, check: str) -> Floats:
    """Sigmas (n,), m or rad, none of which is larger than `most`, in its unit."""
    sigma, (largest, unit) = _positive(table, column), most
    refuse_rows(
        table,
        sigma > largest,
        f'column "{column.name}" is larger than {largest:g} {unit} in',
        rule,
        f"Leave out rows in which nothing was measured, or check {check}",
    )
    return sigma


def _positive(table: Table, column: Column) -> Floats:
    sigma = si_values(table, column)
    bad = ~(sigma > 0.0)
    refuse_rows(table, bad, f'column "{column.name}" is empty, zero or negative in', "A sigma is positive")
    return sigma
