"""What a model leaves of the poses that it was fitted to, against what it expects there."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import setup_jacobian
from truearm.calibration import Calibration
from truearm.certainty.uncertainty import ConstantSpread, task_of
from truearm.doubts.at_once import evidence
from truearm.doubts.visited import Visits, columns_of
from truearm.fits.core_set import core_set
from truearm.fits.enough_values import setup_unknowns
from truearm.fits.fitted_rows import FittedRows
from truearm.fits.models import CONSTANT
from truearm.judgement.judging import model_inputs
from truearm.measurements import Measurements
from truearm.types import AXES, Floats, Mask, Rows

TRUSTED: Final = 0.5
"""Rows of a lesser weight are outliers."""
FAINT: Final = 0.01
"""Part of a column that is left beside what was fitted, below which that imitates it."""
ROUNDING: Final = 1e-4
"""Part of its variance by which more may seem to be taken of a residual than there is of it."""
LEAST_TOLD: Final = 1e-9
"""Part of what rows tell of the unknown that they tell most of, below which they tell nothing."""


@dataclass(frozen=True, eq=False)
class Whitened:
    """Residuals of v visits to poses, and what the fit has taken of them.

    Residuals r of a fit with noise of covariance R, whose predictions have the posterior covariance S at the
    rows, have the covariance R - S. They are looked at as z = R^(-1/2) r, with the covariance I - T. Visits
    to one pose have part of their noise in common, as in the fit, and each its place in time.

    Attributes:
        rows: Place of the first row of each visit among the fitted rows (v,), set-up after set-up, each in
            the order of measuring.
        left: z, of positions (v, m), three for each target; zero where not measured.
        shots: How many shots of the visit hold it (v, m); zero where not measured.
        root: R^(-1/2) (v m, v m), upper triangular, without anything between set-ups.
        taken: T (v m, v m).
        joints: Derivatives (v, m, N) by the joint values, not their readings, base frame; zero where not
            measured.
        single: Variance (v, m) of a single shot, m^2.
        setup: Derivatives (v, m, W) by the unknowns of the own set-up, base frame; zero where not measured.
        scaled: Derivatives (v, m) by a common scale of all lengths, about the middle of the set-up's points:
            their places from there, m, base frame; zero where not measured.
    """

    rows: Rows
    left: Floats
    shots: Floats
    root: Floats
    taken: Floats
    joints: Floats
    single: Floats
    setup: Floats
    scaled: Floats

    @classmethod
    def of(
        cls, found: Calibration, fitted: FittedRows, progress: Floats, *, outliers: bool = False
    ) -> "Whitened | None":
        """Those of a calibration from positions, of rows that it was fitted to; None where more was taken of
        them than there is, by a fit that knew of another noise: nothing can be told there.

        Noise and posterior are as the fit took them, without the factors on standard deviations.

        Args:
            found: The calibration, of constants or of what varies.
            fitted: Its rows, n of them.
            progress: When each was measured, from 0 for the first of its set-up to 1 for the last (n,).
            outliers: Whether outliers of what varies are among them.
        """
        # What varies is without its outliers; constants keep them, and are looked at by medians.
        trusted = (fitted.weight >= TRUSTED) | (found.variable is None) | outliers
        seen = Visits.of(found, fitted, progress, trusted)
        held, data = seen.held, fitted.fitted.select(seen.pose)
        size = held.shape[1]
        inputs, arm, setup, joints, places = _derivatives(found, data, held, seen.targets)
        own = setup.reshape(*held.shape, len(found.groups), -1).sum(axis=2)
        of_row = found.spread.noise(arm, np.zeros(size, dtype=np.bool_)) / _scale(found)
        noise, single = seen.noise(of_row, joints)
        root = np.linalg.cholesky(np.linalg.inv(noise)).T
        weight = np.repeat(seen.weight, size)
        if isinstance(found.spread, ConstantSpread):
            rows = found.spread.unknown_to(arm, setup).reshape(held.size, -1)
            taken, residual = _fitted_again(root, weight, seen.residual.ravel(), rows)
        else:
            known = found.spread.joint(inputs, arm, setup) / (_scale(found) * _beyond(found))
            known, residual = _in_full(noise, weight, seen.residual.ravel(), known)
            taken = root @ known @ root.T
        if np.linalg.eigvalsh(taken)[-1] > 1.0 + ROUNDING:
            return None
        left = (root @ residual).reshape(held.shape)
        shots, scaled = (
            seen.count[:, None] * held,
            about_middle(places[:, :, None], held, data.group)[:, :, 0],
        )
        return cls(seen.rows, left, shots, root, taken, joints, single, own, scaled)

    @property
    def precision(self) -> Floats:
        """R^-1 (v m, v m)."""
        return np.asarray(self.root.T @ self.root)

    @property
    def variance(self) -> Floats:
        """Variances (v, m) of the means of shots, m^2: the diagonal of R."""
        return np.asarray(np.square(np.linalg.inv(self.root)).sum(axis=1).reshape(self.left.shape))

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
        factor = np.linalg.cholesky(np.eye(len(left)) - (1.0 - FAINT) * self.taken)
        return float(np.square(np.linalg.solve(factor, left)).sum())

    def explained(self, columns: Floats) -> "Explained":
        """How well so many columns (v, m, k) explain what is left, in metres per unit of each.

        It is the score test of generalised least squares: the columns are fitted beside all that was fitted,
        without its being searched again.
        """
        from scipy.special import betaincc  # noqa: PLC0415 - slow to import

        whitened = self.root @ columns.reshape(self.left.size, -1)
        size = np.linalg.norm(whitened, axis=0)
        whitened /= np.where(size > 0.0, size, 1.0)
        known, directions = np.linalg.eigh(whitened.T @ whitened - whitened.T @ self.taken @ whitened)
        directions, known = directions[:, known > FAINT], known[known > FAINT]
        score = directions.T @ (whitened.T @ self.left.ravel())
        share = min(float((np.square(score) / known).sum() / self.square), 1.0)
        found = directions @ (score / known) / np.where(size > 0.0, size, 1.0)
        rank, free = len(known), self.freedom - len(known)
        if rank == 0 or free <= rank:
            return Explained(1.0, -np.inf, found)
        gain = evidence(np.array(share), np.array(rank), free, self.freedom)
        return Explained(float(betaincc(0.5 * rank, 0.5 * free, share)), float(gain), found)


@dataclass(frozen=True, eq=False)
class Explained:
    """What some columns explain of what a fit leaves.

    Attributes:
        chance: How likely chance explains as much, from 0 to 1.
        gain: Logarithm of its evidence over that of none.
        sizes: Coefficients of the columns (k,).
    """

    chance: float
    gain: float
    sizes: Floats


def about_middle(columns: Floats, held: Mask, group: NDArray[np.str_]) -> Floats:
    """Columns (v, m, k) of points without their mean over those of each set-up, zero where not `held` (v, m).

    Whatever moves all points alike is no part of them: that frames and the drift of a set-up take up.
    """
    points = columns.reshape(len(columns), -1, AXES, columns.shape[-1])
    known = held.reshape(len(held), -1, AXES)[:, :, :, None]
    centred = np.zeros_like(points)
    for name in np.unique(group):
        own = group == name
        count = np.maximum(known[own].sum(axis=(0, 1)), 1)
        centred[own] = np.where(
            known[own], points[own] - (points[own] * known[own]).sum(axis=(0, 1)) / count, 0.0
        )
    return centred.reshape(columns.shape)


def _in_full(noise: Floats, weight: Floats, residual: Floats, known: Floats) -> tuple[Floats, Floats]:
    """Posterior (n, n) and residuals (n,) where all values count in full, of a fit that gave some less.

    What their weight (n,) lacks of a value's precision is a further measurement of it. Else what the fit did
    without would be held against what it made of the rest, and the rest would tell nothing of it.
    """
    less = np.flatnonzero(weight < 1.0)
    if not len(less):
        return known, residual
    lacking = np.sqrt(1.0 - weight[less])
    both = np.ix_(less, less)
    gain = np.linalg.solve(known[both] + noise[both] / (lacking[:, None] * lacking), known[less]).T
    return known - gain @ known[less], residual - gain @ residual[less]


def _fitted_again(root: Floats, weight: Floats, residual: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """What a fit of constants takes by derivatives (n, u), in units of noise (n, n), and the residuals (n,).

    They were fitted to all rows as if noise were of each value by itself. So much of it as poses, and targets
    of one pose, have in common they count right here, as generalised least squares do.

    Args:
        root: Root (n, n) of the inverse covariance of the noise.
        weight: Weights of the values in the fit (n,).
        residual: What it left of them (n,).
        rows: The derivatives by what was fitted (n, u).
    """
    size = np.linalg.norm(rows, axis=0)
    rows = rows[:, size > 0.0] / size[size > 0.0]
    counted = root * np.sqrt(weight)
    directions, told, back = np.linalg.svd(counted @ rows, full_matrices=False)
    is_told = told > LEAST_TOLD * told.max(initial=0.0)
    directions, told, back = directions[:, is_told], told[is_told], back[is_told]
    step = back.T @ (directions.T @ (counted @ residual) / told)
    return directions @ directions.T, residual - rows @ step


def _scale(found: Calibration) -> float:
    """Factor on variances of a spread by which what was left surpassed what the fit took for noise."""
    return 1.0 if found.variable is None else found.variable.inflation**2


def _beyond(found: Calibration) -> float:
    """Factor on variances that is meant for where nothing was measured."""
    return 1.0 if found.variable is None else found.variable.hyper["extrapolation"][0] ** 2


def _derivatives(
    found: Calibration, data: Measurements, held: Mask, targets: Rows
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Inputs (v, I) of rows; derivatives of what they hold (v, m, ...) of some targets by the arm's
    parameters, by the unknowns of all set-ups, and by the joint values; and the places of these (v, m), base
    frame.

    They are taken where the posterior is linearised, at the constants: along what rows leave open, it is as
    wide as its prior, and derivatives from elsewhere, that turn into it ever so little, make that count.
    """
    task, point = task_of(found), found.models[CONSTANT]
    inputs, setup = model_inputs(task.arm, data, task.options.features), point.setup
    parameters = np.ascontiguousarray(point.parameters(inputs))
    joints = np.ascontiguousarray(inputs[:, : task.arm.robot.joint_count])
    problem = task.problem(core_set(task.arm.robot, data, task.selection, task.groups), [])
    own = setup_jacobian(problem, parameters, setup)[:, columns_of(targets)]
    by_setup = np.zeros((*held.shape, setup_unknowns(task)))
    by_arm, points = np.zeros((*held.shape, task.arm.table.size)), np.zeros(held.shape)
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
            points[np.ix_(rows, places)] = chain.position(joints[rows], parameters[rows])
    by_arm, by_setup = (np.where(held[:, :, None], part, 0.0) for part in (by_arm, by_setup))
    return inputs, by_arm, by_setup, by_arm[:, :, _joint_columns(task.arm.joints)], points


def _joint_columns(joints: Sequence[str]) -> list[int]:
    """Columns of the parameters, five a link, that joints of these kinds move."""
    kinds = {"revolute": 0, "prismatic": 1}
    return [5 * link + kinds[joint] for link, joint in enumerate(joints) if joint in kinds]
