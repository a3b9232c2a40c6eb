"""Outliers that are none: points that fit the readings of other rows, or another target of their own row."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from truearm.doubts.outliers import ROWS_EXCHANGED, TARGETS_EXCHANGED
from truearm.doubts.unbent import may_be_bent, unbent
from truearm.errors import Notice
from truearm.fits.fitted_rows import FittedRows
from truearm.fits.fitting import Fits, Task
from truearm.fits.models import CONSTANT, ArmModel
from truearm.lengths import length_mm
from truearm.outlier_fate import FULL_WEIGHT, fate_of_outliers
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


@dataclass(frozen=True)
class Exchanges:
    """What is exchanged.

    Attributes:
        notices: Warnings of rows whose points fit the readings of one another, and of targets exchanged in a
            row.
        unbent: Constants that rows far off did not bend, where they were looked for beside such.
    """

    notices: tuple[Notice, ...] = ()
    unbent: Fits | None = None


def exchanges(task: Task, found: "Calibration", *, doubted: bool) -> Exchanges:
    """Look for exchanges among the outliers of a calibration.

    Constants keep their outliers, which bend them until nothing fits anywhere. So where they have some, or
    are doubted for other reasons, exchanges are looked for beside constants by a robust loss as well.
    """
    rows = found.rows
    if rows is None or found.selection.distances:
        return Exchanges()
    notices = _notices(found, rows, found.model)
    if notices or not may_be_bent(found) or not (doubted or rows.outliers()):
        return Exchanges(notices)
    with task.stages("looking for exchanged rows"):
        fits = unbent(task, rows)
    model = fits.models(task.arm)[CONSTANT]
    notices = _notices(found, FittedRows.of(task, fits, rows.side), model)
    return Exchanges(notices, fits)


def _notices(found: "Calibration", rows: FittedRows, model: ArmModel) -> tuple[Notice, ...]:
    """What is exchanged among rows as a model has them."""
    count, clear = len(found.selection.targets), rows.score <= 1.0
    if not clear.any():
        return ()
    near_m = TYPICAL * float(np.median(rows.distance_m[clear]))
    far = np.flatnonzero(~clear & (rows.distance_m > FARTHER * near_m))
    if not 2 <= count * len(far) <= MOST:
        return ()
    # In the order of the file.
    far = far[np.argsort(rows.data.rows[far], kind="stable")]
    fit = _fitting_elsewhere(found, rows, model, far, near_m)
    elsewhere = [k // count for k, other in fit if k // count != other // count]
    beside = [k // count for k, other in fit if k // count == other // count]
    notices = []
    for places, kind in ((elsewhere, ROWS_EXCHANGED), (beside, TARGETS_EXCHANGED)):
        which = far[np.unique(np.array(places, dtype=np.int64))]
        if len(which):
            named = rows.data.select(which)
            words = _words(named.row_names(np.ones(len(which), dtype=bool)), kind, near_m)
            text = f"{words} {_what_became(fate_of_outliers(found))}"
            notices.append(Notice(kind, text, tuple(named.rows.tolist())))
    return tuple(notices)


def _words(rows: str, kind: str, within_m: float) -> str:
    within = f"to {length_mm(within_m * MM_PER_METRE, 2)}"
    if kind == ROWS_EXCHANGED:
        fit = f"The points of {rows} fit the readings of one another {within}"
        return f"{fit}: they stand in the wrong order."
    return f"In {rows} points fit the places of other targets {within}: targets are exchanged there."


def _what_became(fate: str) -> str:
    if fate == FULL_WEIGHT:
        return f"They are {fate}, and spoil it: put them right or leave them out."
    return f"As outliers they are {fate}; put right they are as good as other rows."


def _fitting_elsewhere(
    found: "Calibration", rows: FittedRows, model: ArmModel, outlying: Places, near_m: float
) -> list[tuple[int, int]]:
    """Places of points that fit elsewhere among those of the outlying rows, target by target in a row, with
    the place where they fit.

    The model has a point where it was measured less its residual; another one fits there if it was measured
    near by.
    """
    targets = list(found.selection.targets)
    group = np.array([found.groups.index(name) for name in rows.data.group[outlying]])
    base_from_world = model.setup.frames[group, :3, :3].transpose(0, 2, 1)
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
