"""A tool's point from touches: with the tip on one fixed point, the flange goes around it.

For each touch, base_from_flange applied to the tool's point is the touched point. Both are unknown and the
equations are linear in them, so least squares have one solution and need no start.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import WorkError, count_of
from truearm.framing.agreement import check_agreement, far_rows
from truearm.framing.identified_frame import IdentifiedFrame
from truearm.framing.turning import check_turned
from truearm.types import Floats

FEWEST: Final = 4


def tool_from_touches(
    base_from_flange: Floats,
    point: Sequence[str],
    orientation: Floats,
    rows: NDArray[np.int64],
) -> IdentifiedFrame:
    """The tool whose tip touched one fixed point, or several.

    Args:
        base_from_flange: Poses of the calibrated flange (n, 4, 4).
        point: Name of the point that each touch was at (n,).
        orientation: Orientation of the tool, flange_from_tool (3, 3): touches do not tell it.
        rows: Number of each touch in its file (n,).

    Raises:
        WorkError: If there are fewer than four touches at any one point, or the tool was turned too little
            between them to tell its point in all directions.
    """
    names = sorted(set(point))
    number = np.array([names.index(name) for name in point])
    counts = np.bincount(number)
    if counts.max() < FEWEST or counts.min() < 2:
        raise WorkError(
            f"touches at {count_of(len(names), 'point')}, {len(point)} in all",
            rule=f"One point is touched at least {FEWEST} times, and no point once",
            way_out='Name the point of each touch in a column "group" where several were touched',
        )
    turns, origins = base_from_flange[:, :3, :3], base_from_flange[:, :3, 3]
    apart, shifts = _without_points(turns, number), _without_points(origins, number)
    check_turned(apart, "touches")
    stacked = apart.reshape(-1, 3)
    tip, *_ = np.linalg.lstsq(stacked, -shifts.reshape(-1), rcond=None)
    residuals = np.einsum("nij,j->ni", apart, tip) + shifts
    freedom = residuals.size - 3 - 3 * len(names)
    noise = float(np.sqrt(np.square(residuals).sum() / freedom))
    notices = far_rows(residuals, _by_tip_and_points(turns, number), rows)
    check_agreement(noise, notices)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = noise**2 * np.linalg.inv(stacked.T @ stacked)
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = orientation, tip
    what = f"{len(point)} touches of {'one point' if len(names) == 1 else f'{len(names)} points'}"
    return IdentifiedFrame(
        "tool", transform, covariance, residuals, rows, noise, freedom, what, tuple(notices)
    )


def _by_tip_and_points(turns: Floats, number: NDArray[np.int64]) -> Floats:
    """Derivatives (n, 3, 3 + 3 P) of what each touch leaves by the tip and by the points."""
    of_points = np.eye(int(number.max()) + 1)[number]
    by_points = np.einsum("np,ij->nipj", of_points, -np.eye(3)).reshape(len(turns), 3, -1)
    return np.concatenate([turns, by_points], axis=2)


def _without_points(values: Floats, number: NDArray[np.int64]) -> Floats:
    """What each touch differs in from the mean of the touches at its point: the point itself drops out."""
    left = values.copy()
    for k in range(int(number.max()) + 1):
        left[number == k] -= values[number == k].mean(axis=0)
    return left
