"""What a model leaves of the poses that it was fitted to, against what it expects there."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from truearm._core import setup_jacobian
from truearm.calibration import Calibration
from truearm.certainty.uncertainty import task_of
from truearm.doubts.nominal_misfit import some_rows
from truearm.doubts.row_order import FEWEST_VISITS
from truearm.fits.core_set import Selection, core_set
from truearm.fits.enough_values import setup_unknowns
from truearm.fits.fitted_rows import FittedRows
from truearm.fits.measured_parts import held_parts
from truearm.fits.models import CONSTANT
from truearm.judgement.judging import model_inputs
from truearm.measurements import Measurements
from truearm.rows.shots import Scatter
from truearm.rows.visits import means, visit_numbers
from truearm.types import AXES, Floats, Mask, Rows

MOST_VALUES: Final = 900
"""Coordinates at the most that are looked at: they tell enough, and their covariance is quick."""
TRUSTED: Final = 0.5
"""Rows of a lesser weight are outliers."""
MOST_TARGETS: Final = MOST_VALUES // (AXES * FEWEST_VISITS)
"""Targets at the most, those that most rows hold, so that enough visits are looked at."""
FAINT: Final = 0.01
"""Part of a column that is left beside what was fitted, below which that imitates it."""


@dataclass(frozen=True, eq=False)
class Visits:
    """Visits to poses, v of them, each with the mean of its shots.

    Attributes:
        rows: Place of the first row of each among the fitted rows (v,).
        residual: Mean residual of its shots (v, m), m.
        shots: How many of them hold it (v, m).
        stated: Mean of the variances that they state (v,), m^2.
        own: Variance that each shot has of its own beside, which those of a visit differ by, m^2.
        targets: Which of the fitted targets are looked at (t,), m = 3 t.
    """

    rows: Rows
    residual: Floats
    shots: Floats
    stated: Floats
    own: float
    targets: Rows

    @classmethod
    def of(cls, fitted: FittedRows, selection: Selection, progress: Floats, trusted: Mask) -> "Visits":
        """Those of `trusted` rows (n,), some where they are many, set-up after set-up."""
        parts = held_parts(fitted.data, selection)[:, :-1]
        targets = np.sort(np.argsort(-parts[trusted].sum(axis=0), kind="stable")[:MOST_TARGETS])
        parts = parts[:, targets]
        _, group = np.unique(fitted.data.group, return_inverse=True)
        order = np.lexsort((progress, group.reshape(-1)))
        order = order[(trusted & parts.any(axis=1))[order]]
        visits = visit_numbers(fitted.data.readings[order], fitted.data.group[order])
        held = np.repeat(parts, AXES, axis=1)[order]
        each = fitted.residual[np.ix_(order, _columns(targets))] * held
        shots = means(held.astype(np.float64), visits) * np.bincount(visits)[:, None]
        residual = means(each, visits) * np.bincount(visits)[:, None] / np.maximum(shots, 1.0)
        stated = means(np.square(fitted.data.stated_sigma_m[order]), visits)
        further = np.bincount(visits) - 1.0
        own = Scatter.of(np.where(held, each, np.nan), visits).own
        own -= float(np.average(stated, weights=further)) if further.any() else 0.0
        _, first = np.unique(visits, return_index=True)
        some = some_rows(np.arange(len(first)), max(MOST_VALUES // held.shape[1], 1))
        rows = order[first[some]]
        return cls(rows, residual[some], shots[some], stated[some], max(own, 0.0), targets)

    @property
    def held(self) -> Mask:
        """What was measured (v, m)."""
        return np.asarray(self.shots > 0.0)

    def noise(self, of_row: Floats) -> tuple[Floats, Floats]:
        """Covariance (v, m, m) of the means of shots, ones where not measured, and the variance (v, m) of a
        single shot, of that of a row `of_row` (v, m, m) beside what it states.

        Shots share what the arm did not repeat and what no model holds.
        """
        unit = np.eye(self.shots.shape[1])
        own = np.minimum(self.own, np.linalg.eigvalsh(of_row)[:, 0])[:, None]
        differ = own + self.stated[:, None]
        single = np.diagonal(of_row, axis1=1, axis2=2) + self.stated[:, None]
        mean = of_row + (differ / np.maximum(self.shots, 1.0) - own)[:, :, None] * unit
        return np.where(self.held[:, :, None] & self.held[:, None], mean, unit), single


@dataclass(frozen=True, eq=False)
class Whitened:
    """Residuals of v visits to poses, and what the fit has taken of them.

    Residuals r of a fit with noise of covariance R, whose predictions have the posterior covariance S at the
    rows, have the covariance R - S. They are looked at as z = R^(-1/2) r, with the covariance I - T.

    Attributes:
        rows: Place of the first row of each visit among the fitted rows (v,), set-up after set-up, each in
            the order of measuring.
        left: z, of positions (v, m), three for each target; zero where not measured.
        shots: How many shots of the visit hold it (v, m); zero where not measured.
        root: R^(-1/2) of each visit (v, m, m).
        taken: T (v m, v m).
        joints: Derivatives (v, m, N) by the joint values, not their readings, base frame; zero where not
            measured.
        single: Variance (v, m) of a single shot, m^2.
        setup: Derivatives (v, m, W) by the unknowns of the own set-up, base frame; zero where not measured.
    """

    rows: Rows
    left: Floats
    shots: Floats
    root: Floats
    taken: Floats
    joints: Floats
    single: Floats
    setup: Floats

    @classmethod
    def of(
        cls, found: Calibration, fitted: FittedRows, progress: Floats, *, outliers: bool = False
    ) -> "Whitened":
        """Those of a calibration from positions, of rows that it was fitted to.

        Args:
            found: The calibration, of constants or of what varies.
            fitted: Its rows, n of them.
            progress: When each was measured, from 0 for the first of its set-up to 1 for the last (n,).
            outliers: Whether outliers of what varies are among them.
        """
        # What varies is without its outliers; constants keep them, and are looked at by medians.
        trusted = (fitted.weight >= TRUSTED) | (found.variable is None) | outliers
        seen = Visits.of(fitted, found.selection, progress, trusted)
        rows, held = seen.rows, seen.held
        data = fitted.fitted.select(rows)
        inputs, arm, setup, joints = _derivatives(found, data, held, seen.targets)
        own = setup.reshape(*held.shape, len(found.groups), -1).sum(axis=2)
        size = held.shape[1]
        noise, single = seen.noise(found.spread.noise(arm, np.zeros(size, dtype=np.bool_)))
        root = np.linalg.cholesky(np.linalg.inv(noise)).transpose(0, 2, 1)
        known = found.spread.joint(inputs, arm, setup) / _widened(found) ** 2
        known = known.reshape(len(data), size, len(data), size)
        # A fit takes as much less of a row as it gives it less weight.
        counted = root * np.sqrt(fitted.weight[rows])[:, None, None]
        known = np.einsum("iab,ibkc->iakc", counted, known)
        taken = np.einsum("iakc,kdc->iakd", known, counted).reshape(held.size, held.size)
        left = np.einsum("iab,ib->ia", root, seen.residual)
        return cls(rows, left, seen.shots, root, taken, joints, single, own)

    @property
    def held(self) -> Mask:
        """What was measured (v, m)."""
        return np.asarray(self.shots > 0.0)

    @property
    def kept(self) -> Floats:
        """Variances (v, m) that the residuals are expected to have, in parts of one."""
        return np.asarray(1.0 - np.diagonal(self.taken).reshape(self.left.shape))

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the residuals."""
        return float(self.kept[self.held].sum())

    @cached_property
    def square(self) -> float:
        """Sum of squares of the residuals in units of their own covariance.

        What a fit takes up has left little, which stands for much: directions that it takes all but FAINT of
        count that.
        """
        left = self.left.ravel()
        try:
            factor = np.linalg.cholesky(np.eye(len(left)) - (1.0 - FAINT) * self.taken)
            return float(np.square(np.linalg.solve(factor, left)).sum())
        except np.linalg.LinAlgError:
            # Of rows that it gives little weight a fit may seem to take more than all.
            taken, directions = np.linalg.eigh(self.taken)
            return float((np.square(directions.T @ left) / np.maximum(1.0 - taken, FAINT)).sum())

    def explained(self, columns: Floats) -> tuple[float, Floats]:
        """How well so many columns (v, m, k) explain what is left, in metres per unit of each.

        It is the score test of generalised least squares: the columns are fitted beside all that was fitted,
        without its being searched again.

        Returns:
            How likely chance explains as much, from 0 to 1; and the coefficients (k,).
        """
        from scipy.special import betaincc  # noqa: PLC0415 - slow to import

        whitened = np.einsum("iab,ibk->iak", self.root, columns).reshape(self.left.size, -1)
        size = np.linalg.norm(whitened, axis=0)
        whitened /= np.where(size > 0.0, size, 1.0)
        known, directions = np.linalg.eigh(whitened.T @ whitened - whitened.T @ self.taken @ whitened)
        directions, known = directions[:, known > FAINT], known[known > FAINT]
        score = directions.T @ (whitened.T @ self.left.ravel())
        share = float((np.square(score) / known).sum() / self.square)
        found = directions @ (score / known) / np.where(size > 0.0, size, 1.0)
        rank, free = len(known), self.freedom - len(known)
        if rank == 0 or free <= rank:
            return 1.0, found
        return float(betaincc(0.5 * rank, 0.5 * free, min(share, 1.0))), found


def _widened(found: Calibration) -> float:
    """Factor on standard deviations that is meant for where nothing was measured."""
    return 1.0 if found.variable is None else found.variable.hyper["extrapolation"][0]


def _columns(targets: Rows) -> Rows:
    """Columns of residuals, three a fitted target, of some of these (t,)."""
    return np.asarray((AXES * targets[:, None] + np.arange(AXES)).ravel())


def _derivatives(
    found: Calibration, data: Measurements, held: Mask, targets: Rows
) -> tuple[Floats, Floats, Floats, Floats]:
    """Inputs (v, I) of rows, and derivatives of what they hold (v, m, ...) of some targets by the arm's
    parameters, by the unknowns of all set-ups, and by the joint values.

    They are taken where the posterior is linearised, at the constants: along what rows leave open, it is as
    wide as its prior, and derivatives from elsewhere, that turn into it ever so little, make that count.
    """
    task, point = task_of(found), found.models[CONSTANT]
    inputs, setup = model_inputs(task.arm, data, task.options.features), point.setup
    parameters = np.ascontiguousarray(point.parameters(inputs))
    joints = np.ascontiguousarray(inputs[:, : task.arm.robot.joint_count])
    problem = task.problem(core_set(task.arm.robot, data, task.selection, task.groups), [])
    own = setup_jacobian(problem, parameters, setup)[:, _columns(targets)]
    by_setup = np.zeros((*held.shape, setup_unknowns(task)))
    by_arm = np.zeros((*held.shape, task.arm.table.size))
    width = own.shape[2]
    for number, group in enumerate(task.groups):
        rows = np.flatnonzero(data.group == group)
        by_setup[rows, :, number * width : (number + 1) * width] = own[rows]
        for target, point in enumerate(setup.targets[number][targets]):
            end = np.eye(4)
            end[:AXES, AXES] = point
            chain = task.arm.chain(task.arm.robot.flange @ end)
            places = np.arange(AXES * target, AXES * (target + 1))
            by_arm[np.ix_(rows, places)] = chain.parameter_jacobian(joints[rows], parameters[rows])
    by_arm, by_setup = (np.where(held[:, :, None], part, 0.0) for part in (by_arm, by_setup))
    return inputs, by_arm, by_setup, by_arm[:, :, _joint_columns(task.arm.joints)]


def _joint_columns(joints: Sequence[str]) -> list[int]:
    """Columns of the parameters, five a link, that joints of these kinds move."""
    kinds = {"revolute": 0, "prismatic": 1}
    return [5 * link + kinds[joint] for link, joint in enumerate(joints) if joint in kinds]
