"""Rows that are far off among those that constants are fitted to, and that bend these.

Constants by least squares follow what is far off: a distance, which is one value of its row, until hardly
anything is left of it, and several of few points until all are as far off as they. So rows are held against
constants that rows far off do not bend.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from truearm._core import ConstantFit, fit_constant
from truearm.doubts.unbent import UNBENT, unbent
from truearm.errors import Notice, list_outliers
from truearm.fits.core_set import core_set, distance_ends
from truearm.fits.fitted_rows import ODDS_OF_CHANCE, FittedRows, at_rows
from truearm.fits.fitting import (
    LOWER,
    MOST_FAR,
    Fits,
    Task,
    bent,
    constant_variances,
    core_errors,
    fit_options,
)
from truearm.lengths import length_mm
from truearm.outlier_fate import fate_of_outliers
from truearm.types import Floats, Mask, Rows
from truearm.units import MM_PER_METRE

if TYPE_CHECKING:
    from truearm.calibration import Calibration

BENT: Final = "bent"
MOST_TESTED: Final = 20
"""Rows far off, those nearest to the limit, each of which is tested by a fit of its own."""


def judged_unbent(task: Task, rows: FittedRows, fits: Fits) -> FittedRows:
    """Rows with `score`, `distance_m` and `turn_rad` by constants that rows far off do not bend, where others
    are bent.

    Where rows are few for the unknowns a robust loss takes some for far off whatever they are. Such a one is
    an outlier if least squares without all others leave overwhelmingly less without it too.
    """
    robust = task.options.robust == UNBENT
    if fits.variable is not None or (robust and not task.selection.distances):
        return rows
    apart = fits if robust else unbent(task, rows)
    judged = FittedRows.of(task, apart, rows.side)
    far = judged.score > 1.0
    if task.selection.distances:
        score = _Judged.of(task, apart).confirmed(judged.score) if far.any() else judged.score
        return replace(rows, score=score, distance_m=judged.distance_m)
    found = _Judged.of(task, apart)
    if not 0.0 < far.mean() <= MOST_FAR or not bent(fits.constant, found.least_squares(far)):
        return rows
    score = found.confirmed(judged.score)
    outliers = score > 1.0
    if not outliers.any():
        return rows
    return replace(rows, score=score).apart_as(judged, outliers | (fits.scheme is None))


def bent_notice(found: "Calibration", apart: Fits) -> list[Notice]:
    """A notice where outliers bend the constants of a calibration: those by a robust loss leave far less."""
    rows = found.rows
    left, lower = found.constant.noise_m, apart.constant.noise[0]
    if rows is None or lower >= LOWER * left:
        return []
    outliers, per = rows.outliers(), found.selection.errors_of if found.selection.distances else "coordinate"
    text = (
        f"Outliers, {fate_of_outliers(found)}, bend the constants: these leave "
        f"{length_mm(left * MM_PER_METRE, 3)} per {per}, and with --robust {UNBENT} "
        f"{length_mm(lower * MM_PER_METRE, 3)}. Look at {list_outliers(outliers, rows.data.files)}: leave "
        f"out what is wrong, or give --robust {UNBENT}. Poses in which the arm itself errs by far more look "
        "the same."
    )
    return [Notice(BENT, text, tuple(entry["row"] for entry in outliers))]


@dataclass(frozen=True, eq=False)
class _Judged:
    """What rows hold, points or distances, k of them, beside constants that rows far off do not bend.

    Attributes:
        task: What is fitted.
        apart: These constants.
        first: The row of each (k,), of a pair the first.
    """

    task: Task
    apart: Fits
    first: Rows

    @classmethod
    def of(cls, task: Task, apart: Fits) -> "_Judged":
        distances = task.selection.distances
        return cls(task, apart, distance_ends(apart.data)[:, 0] if distances else np.arange(len(apart.data)))

    def confirmed(self, score: Floats) -> Floats:
        """Scores (n,), less where rows were taken for far off that least squares would explain."""
        own = score[self.first]
        for place, tested in self._tests(own):
            own[place] = min(own[place], tested)
        return at_rows(own, self.apart.data) if self.task.selection.distances else own

    def _tests(self, own: Floats) -> Iterator[tuple[int, float]]:
        """Those of the k far off that are nearest to the limit, each with a score by the F test of its shift,
        where all others that are far off have one too.
        """
        from scipy.special import fdtri  # noqa: PLC0415 - slow to import

        far = own > 1.0
        without = self.least_squares(far)
        values = np.maximum((self._of_each(without) != 0.0).sum(axis=1), 1)
        free = int(values[~far].sum()) - self.apart.identifiability.total_rank
        order = np.flatnonzero(far)
        if free < 1:
            yield from ((place, 1.0) for place in order.tolist())
            return
        variance = constant_variances(replace(self.apart, constant=without), self.task.selection)[self.first]
        left = self._left(without, variance, far)
        for place in order[np.argsort(own[order], kind="stable")][:MOST_TESTED].tolist():
            others = far.copy()
            others[place] = False
            more = self._left(self.least_squares(others), variance, others) - left
            limit = fdtri(values[place], free, 1.0 - ODDS_OF_CHANCE)
            yield place, more / values[place] / (left / free) / limit

    def _of_each(self, fit: ConstantFit) -> Floats:
        """What a fit leaves of each, (k, m)."""
        return fit.residuals.reshape(len(self.first), -1)

    def _left(self, fit: ConstantFit, variance: Floats, apart: Mask) -> float:
        """Squares that a fit leaves, in parts of their variances (k, m), of all but those `apart` (k,)."""
        return float((self._of_each(fit) ** 2 / variance)[~apart].sum())

    def least_squares(self, far: Mask) -> ConstantFit:
        """Constants without those that are far off (k,).

        Their weights are the squares of those that the robust loss gave them: the farther off, the less they
        pull, and a set-up of which little else is left still has a frame.
        """
        task, data = self.task, self.apart.data
        weight, out = np.ones(len(data)), self.first[far]
        weight[out] = self.apart.constant.weights[out] ** 2
        measured = core_set(task.arm.robot, data, task.selection, task.groups, weight)
        options = fit_options(task.threads, prior=task.options.prior)
        with core_errors(data):
            return fit_constant(
                task.problem(measured, task.columns(self.apart.identifiability.determined)), options
            )
