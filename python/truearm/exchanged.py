"""Outliers that are none: points that fit the readings of other rows, or another target of their own row."""

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import Notice
from truearm.fitted_rows import FittedRows
from truearm.lengths import length_mm
from truearm.units import MM_PER_METRE

if TYPE_CHECKING:
    from truearm.calibration import Calibration

Places = NDArray[np.int64]

TYPICAL: Final = 10.0
"""A point fits where it is off by less than so many times the median of rows that are no outliers."""
FARTHER: Final = 10.0
"""It is so many times farther off than that where it stands."""
MOST: Final = 300
"""Points that are compared with one another: what more outliers are is no exchange."""


def exchanged_notices(found: "Calibration") -> list[Notice]:
    """Warnings of rows whose points fit the readings of one another, and of targets exchanged in a row."""
    rows, targets = found.rows, found.selection.targets
    if rows is None or found.selection.distances:
        return []
    clear = rows.score <= 1.0
    # In the order of the file.
    outlying = np.flatnonzero(~clear)[np.argsort(rows.data.rows[~clear], kind="stable")]
    if not 2 <= len(targets) * len(outlying) <= MOST or not clear.any():
        return []
    within_m = TYPICAL * float(np.median(rows.distance_m[clear]))
    fit = _fitting_elsewhere(found, rows, outlying, within_m)
    elsewhere = [(k, other) for k, other in fit if k // len(targets) != other // len(targets)]
    beside = [(k, other) for k, other in fit if k // len(targets) == other // len(targets)]
    notices = []
    for pairs, kind in ((elsewhere, "rows_exchanged"), (beside, "targets_exchanged")):
        which = outlying[np.unique([k // len(targets) for k, _ in pairs]).astype(np.int64)]
        if len(which):
            named = rows.data.select(which)
            text = _words(named.row_names(np.ones(len(which), dtype=bool)), kind, within_m)
            notices.append(Notice(kind, text, tuple(named.rows.tolist())))
    return notices


def _words(rows: str, kind: str, within_m: float) -> str:
    within = f"to {length_mm(within_m * MM_PER_METRE, 2)}"
    what = (
        f"The points of {rows} fit the readings of one another {within}: they stand in the wrong order"
        if kind == "rows_exchanged"
        else f"In {rows} points fit the places of other targets {within}: targets are exchanged there"
    )
    return f"{what}. As outliers they are left out; put right they are as good as other rows."


def _fitting_elsewhere(
    found: "Calibration", rows: FittedRows, outlying: Places, near_m: float
) -> list[tuple[int, int]]:
    """Places of points that fit elsewhere among those of the outliers, target by target in a row, with the
    place where they fit.

    The model has a point where it was measured less its residual; another one fits there if it was measured
    near by.
    """
    targets = list(found.selection.targets)
    group = np.array([found.groups.index(name) for name in rows.data.group[outlying]])
    base_from_world = found.model.setup.frames[group, :3, :3].transpose(0, 2, 1)
    points = rows.data.targets[outlying][:, targets]
    measured = np.einsum("nij,ntj->nti", base_from_world, points).reshape(-1, 3)
    modelled = measured - rows.residual[outlying, : 3 * len(targets)].reshape(-1, 3)
    apart = np.nan_to_num(np.linalg.norm(measured[:, None] - modelled[None], axis=2), nan=np.inf)
    apart[np.not_equal.outer(*2 * [np.repeat(group, len(targets))])] = np.inf
    far = np.isfinite(np.diagonal(apart)) & (np.diagonal(apart) > FARTHER * near_m)
    np.fill_diagonal(apart, np.inf)
    other = apart.argmin(axis=1)
    fitting = {k: int(other[k]) for k in np.flatnonzero(far & (apart.min(axis=1) < near_m)).tolist()}
    # In an exchange every place that a point leaves is taken by another one.
    while True:
        taken = set(fitting.values())
        kept = {k: at for k, at in fitting.items() if at in fitting and k in taken}
        if len(kept) == len(fitting):
            return list(kept.items())
        fitting = kept
