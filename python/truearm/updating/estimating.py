"""Gaussian estimate of what moved: correlated noise, wide priors, linearised until it stands still."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from truearm.errors import WorkError
from truearm.updating.scene import Linear, Scene, State
from truearm.updating.untested import way_out_of_keeping

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOST_STEPS: Final = 30
STANDS_STILL: Final = 1e-6
"""In prior standard deviations."""
NEAR: Final = 1e-3
"""The same, for a state to linearise at."""
MOST_PARTS: Final = 30
"""Values are left out in so many parts at the most."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """A state, linearised there.

    Attributes:
        state: The values.
        linear: Residuals and derivatives.
        covariance: Of all unknowns (u, u); zero for those that are kept.
        factor: Lower Cholesky factor (R, R) of the residuals' covariance.
    """

    state: State
    linear: Linear
    covariance: Floats
    factor: Floats


def begun(scene: Scene) -> tuple[Scene, State]:
    """Where the search of what moved begins: what rows say of all unknowns if only noise scatters them.

    What an unchanged arm may scatter by is linearised there. The set-ups of the unchanged arm are no place
    for that: they make up for the offsets that moved.

    Returns:
        The same rows with what is found anew held there, ever so gently; and the state.
    """
    state = scene.first()
    factor = factored(scene.scatter(state))
    for _ in range(MOST_STEPS):
        state, step = _stepped(scene, factor, state, scene.unknowns.free)
        if step < NEAR:
            break
    return scene.about(state.setup), state


def estimate(scene: Scene, spread: Floats, state: State, free: Mask) -> Estimate:
    """The most likely values of the unknowns that are `free` (u,), from a state on.

    Gauss-Newton on `r^T V^-1 r + x^T P^-1 x`: V (R, R) is what an unchanged arm may scatter by, field, noise
    and kept set-ups; P the prior's variances.

    Raises:
        WorkError: If V is not positive definite, or the steps do not come to a standstill.
    """
    factor = factored(spread)
    for _ in range(MOST_STEPS):
        state, step = _stepped(scene, factor, state, free)
        if step < STANDS_STILL:
            break
    else:
        raise _unsettled(scene)
    linear = scene.linear(state)
    return Estimate(state, linear, posterior(linear, factor, scene.unknowns.std, free), factor)


def _unsettled(scene: Scene) -> WorkError:
    """That no values were found; what is kept may be the cause."""
    kept = scene.unknowns.kept
    sought = f"with the {' and the '.join(kept)} kept, all else" if kept else "offsets, frame and tool"
    check = "check that the measurements are of this arm, and their units"
    return WorkError(
        f"{sought} did not settle in {MOST_STEPS} steps",
        where=", ".join(scene.data.files),
        way_out=f"{way_out_of_keeping(kept)}; {check}" if kept else f"C{check[1:]}",
    )


def _stepped(scene: Scene, factor: Floats, state: State, free: Mask) -> tuple[State, float]:
    """A state after one more step, and how long that was, in prior standard deviations."""
    std = scene.unknowns.std
    step = solved(scene.linear(state), factor, std, free)
    return scene.moved(state, step), float(np.abs(step[free] / std[free]).max(initial=0.0))


def posterior(linear: Linear, factor: Floats, std: Floats, free: Mask) -> Floats:
    """Covariance (u, u) of the unknowns, zero for those that are not free."""
    covariance = np.zeros((len(std), len(std)))
    scaled = _whitened(linear.jacobian[:, free] * std[free], factor)
    inverse = np.linalg.inv(scaled.T @ scaled + np.eye(scaled.shape[1]))
    covariance[np.ix_(free, free)] = inverse * np.outer(std[free], std[free])
    return covariance


def factored(spread: Floats) -> Floats:
    """Lower Cholesky factor.

    Raises:
        WorkError: If there is none.
    """
    try:
        return np.asarray(np.linalg.cholesky(spread))
    except np.linalg.LinAlgError:
        raise WorkError(
            "the calibration's spread at these poses is not positive definite",
            way_out="Look for poses that were measured several times without noise",
        ) from None


def solved(linear: Linear, factor: Floats, std: Floats, free: Mask) -> Floats:
    """The step (u,) to the most likely values of the free unknowns."""
    scaled = _whitened(linear.jacobian[:, free] * std[free], factor)
    right = scaled.T @ _whitened(linear.residual, factor) - linear.departure[free] / std[free]
    step = np.zeros(len(std))
    step[free] = std[free] * np.linalg.solve(scaled.T @ scaled + np.eye(scaled.shape[1]), right)
    return step


def left_out(linear: Linear, spread: Floats, std: Floats, free: Mask) -> Floats:
    """Residuals (R,) of each pose's values when the free unknowns are found from the others."""
    found = np.empty_like(linear.residual)
    for poses, step in folds(linear, spread, std, free):
        out = np.isin(linear.pose, poses)
        found[out] = linear.residual[out] - linear.jacobian[out] @ step
    return found


def folds(
    linear: Linear, spread: Floats, std: Floats, free: Mask
) -> Iterator[tuple[NDArray[np.int64], Floats]]:
    """Poses that are left out together, and the step (u,) that the others make of the free unknowns."""
    poses = np.unique(linear.pose)
    for part in range(min(MOST_PARTS, len(poses))):
        left = poses[part::MOST_PARTS]
        out = np.isin(linear.pose, left)
        rest = Linear(linear.residual[~out], linear.jacobian[~out], linear.departure, linear.pose[~out])
        yield left, solved(rest, factored(spread[np.ix_(~out, ~out)]), std, free)


def surprise(linear: Linear, spread: Floats, std: Floats, free: Mask) -> tuple[Floats, NDArray[np.int64]]:
    """Of each pose (n,) how unlikely it is given all others: squared standardised length, and its values."""
    scaled = linear.jacobian[:, free] * std[free]
    whole = cho_factor(spread + scaled @ scaled.T, lower=True)
    inverse = cho_solve(whole, np.eye(len(spread)))
    pull = inverse @ (linear.residual + linear.jacobian[:, free] @ linear.departure[free])
    poses = np.unique(linear.pose)
    squares = np.empty(len(poses))
    for k, pose in enumerate(poses):
        own = linear.pose == pose
        squares[k] = pull[own] @ np.linalg.solve(inverse[np.ix_(own, own)], pull[own])
    return squares, np.array([int((linear.pose == pose).sum()) for pose in poses])


def _whitened(values: Floats, factor: Floats) -> Floats:
    return np.asarray(solve_triangular(factor, values, lower=True))
