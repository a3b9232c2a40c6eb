"""How far the constants of the constant model are from those of the arm."""

import numpy as np

from truearm._core import linearise, setup_jacobian
from truearm.defaults import ROBUST
from truearm.fits.core_set import core_set, distances_apart
from truearm.fits.details import ConstantDetails
from truearm.fits.fitted_rows import scores_of_constants
from truearm.fits.fitting import Fits, Task, constant_variances
from truearm.fits.known_scale import KnownScale, common_share
from truearm.fits.measured_parts import held_parts
from truearm.rows.shots import variance_factor
from truearm.rows.visits import pose_numbers
from truearm.types import AXES, Floats


def of_covariance(covariance: Floats, count: int) -> Floats:
    """Standard errors (count,) of the first unknowns of a covariance (u, u)."""
    return np.sqrt(np.diagonal(covariance)[:count])


def counted_covariance(task: Task, fits: Fits) -> Floats:
    """Covariance (u, u) of the constant fit, in which shots and targets of a pose count as far as they do not
    agree.

    The fit took each for a measurement of its own. All shots of a pose share what the arm did not repeat
    there, and what constants do not hold; its targets have a part of that in common.
    """
    constant, data, selection = fits.constant, fits.data, task.selection
    poses, variances = pose_numbers(data.readings, data.group), constant_variances(fits, selection)
    weights = constant.weights
    covariance = constant.covariance
    if selection.distances:
        rows, poses = distances_apart(data, poses)
        variances, weights, held = variances[rows], weights[rows], np.ones((len(rows), 1), dtype=np.bool_)
    else:
        parts = held_parts(data, selection)
        held = np.repeat(parts if selection.orientation else parts[:, :-1], AXES, axis=1)
        covariance = covariance + _in_common(task, fits, weights[:, None] / variances)
    missed = constant.residuals.reshape(held.shape) * np.sqrt(weights[:, None] / variances)
    factor = variance_factor(np.where(held, missed, np.nan), poses, len(constant.covariance))
    return np.asarray(factor * covariance)


def _in_common(task: Task, fits: Fits, precisions: Floats) -> Floats:
    """Covariance (u, u) to add for what targets of a pose have in common, `C J^T W (V - D) W J C`.

    C is the fit's own covariance, W the precisions that it took and D their inverse: V holds beside it the
    share of the noise that two targets of one pose have in common along each axis. So a constant that moves
    them alike is told less well, and one that is told by their difference as well as before.

    Args:
        task: What was fitted.
        fits: The fits.
        precisions: Of what rows hold (n, m).
    """
    constant, data, targets = fits.constant, fits.data, len(task.selection.targets)
    share = _share(task, fits)
    if share == 0.0:
        return np.zeros_like(constant.covariance)
    measured = core_set(task.arm.robot, data, task.selection, task.groups)
    problem = task.problem(measured, task.columns(fits.identifiability.determined))
    arm, _ = linearise(problem, constant.parameters, constant.setup)
    own = setup_jacobian(problem, constant.parameters, constant.setup)
    is_own = data.group[:, None] == np.array(task.groups)
    of_all = (own[:, :, None] * is_own[:, None, :, None]).reshape(*own.shape[:2], -1)
    rows = np.concatenate([arm, of_all], axis=2) * precisions[:, :, None]
    points = rows[:, : AXES * targets].reshape(len(rows), targets, AXES, -1)
    pairs = _squares(points.sum(axis=1)) - _squares(points)
    return np.asarray(share * constant.noise[0] ** 2 * (constant.covariance @ pairs @ constant.covariance))


def _share(task: Task, fits: Fits) -> float:
    """Share of the noise of the constant fit that targets of a pose have in common."""
    fit, targets = fits.constant, len(task.selection.targets)
    return common_share(fit.residuals, fit.weights, targets, fit.noise[0], fits.data.stated_sigma_m)


def _squares(rows: Floats) -> Floats:
    """Sum (u, u) of the products of rows (..., u) with themselves."""
    flat = rows.reshape(-1, rows.shape[-1])
    return np.asarray(flat.T @ flat)


def standard_errors(task: Task, fits: Fits, covariance: Floats) -> Floats:
    """Standard errors (k,) of the constants that a fit determined, rad and m; `covariance` (u, u) is theirs.

    Constants that are fitted alone take over what they can imitate of everything that varies, however many
    poses there are; their own covariance, to which that is noise, does not know of it. Where a field was
    fitted beside constants, its posterior N(m, V) says where the arm's are, and the root mean square
    distance of the estimate c from them is `sqrt((c - m)^2 + V)`.
    """
    names, variable = fits.identifiability.determined, fits.variable
    if variable is None:
        return of_covariance(covariance, len(names))
    columns = list(task.arm.candidates.columns)
    column_of = dict(zip(task.arm.candidates.names, columns, strict=True))
    variances = dict(zip(columns, np.diagonal(variable.constant_covariance), strict=True))
    apart = np.ravel(fits.constant.parameters) - np.ravel(variable.parameters)
    chosen = [column_of[name] for name in names]
    known = np.array([variances[column] for column in chosen])
    return np.asarray(np.sqrt(apart[chosen] ** 2 + np.maximum(known, 0.0)))


def _widened(task: Task, fits: Fits) -> float:
    """Root mean square of what constants of a robust loss leave of rows that are no outliers, in units of its
    noise.
    """
    if fits.variable is not None or task.selection.distances or task.options.robust == ROBUST:
        return 1.0
    residual = fits.constant.residuals.reshape(len(fits.data), -1)
    clear = scores_of_constants(fits, residual, task.selection) <= 1.0
    kept = residual[clear]
    squares = kept**2 / constant_variances(fits, task.selection)[clear]
    freedom = max(int(np.count_nonzero(kept)) - fits.identifiability.total_rank, 1)
    return float(np.sqrt(squares.sum() / freedom)) or 1.0


def constant_details(task: Task, fits: Fits) -> ConstantDetails:
    """What a fit found beside its constants, with how far these are off."""
    names, fit, covariance = fits.identifiability.determined, fits.constant, counted_covariance(task, fits)
    common = _share(task, fits)
    rank, widened = fits.identifiability.total_rank, _widened(task, fits)
    scale = KnownScale.of(fit.residuals, rank, fits.data, common, widened)
    return ConstantDetails.of(names, fit, covariance, standard_errors(task, fits, covariance), scale)
