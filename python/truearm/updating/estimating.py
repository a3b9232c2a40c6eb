"""Gaussian estimate of what moved: correlated noise, wide priors, linearised until it stands still."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from truearm.errors import WorkError
from truearm.types import Floats, Mask
from truearm.update_words import way_out_of_keeping
from truearm.updating.scattering import Scatter
from truearm.updating.scene import Linear, Scene, State

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
        scatter: What the residuals of an unchanged arm may scatter by.
    """

    state: State
    linear: Linear
    covariance: Floats
    scatter: Scatter


def begun(scene: Scene) -> tuple[Scene, State]:
    """Where the search of what moved begins: what rows say of all unknowns if only noise scatters them.

    What an unchanged arm may scatter by is linearised there. The set-ups of the unchanged arm are no place
    for that: they make up for the offsets that moved.

    Returns:
        The same rows with what is found anew held there, ever so gently, and visits to a pose as far apart as
        they are seen to be; and the state.
    """
    state = scene.first()
    noise = Scatter(scene.scatter(state))
    for _ in range(MOST_STEPS):
        state, step = _stepped(scene, noise, state, scene.unknowns.free)
        if step < NEAR:
            break
    return scene.begun(state), state


def estimate(scene: Scene, scatter: Scatter, state: State, free: Mask) -> Estimate:
    """The most likely values of the unknowns that are `free` (u,), from a state on.

    Gauss-Newton on `r^T V^-1 r + x^T P^-1 x`: V is the covariance of what an unchanged arm may scatter by,
    field, noise and kept set-ups; P the prior's variances.

    Raises:
        WorkError: If V is not positive definite, or the steps do not come to a standstill.
    """
    for _ in range(MOST_STEPS):
        state, step = _stepped(scene, scatter, state, free)
        if step < STANDS_STILL:
            break
    else:
        raise _unsettled(scene)
    linear = scene.linear(state)
    return Estimate(state, linear, posterior(linear, scatter, scene.unknowns.std, free), scatter)


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


def _stepped(scene: Scene, scatter: Scatter, state: State, free: Mask) -> tuple[State, float]:
    """A state after one more step, and how long that was, in prior standard deviations."""
    std = scene.unknowns.std
    step = solved(scene.linear(state), scatter, std, free)
    return scene.moved(state, step), float(np.abs(step[free] / std[free]).max(initial=0.0))


def posterior(linear: Linear, scatter: Scatter, std: Floats, free: Mask) -> Floats:
    """Covariance (u, u) of the unknowns, zero for those that are not free."""
    covariance = np.zeros((len(std), len(std)))
    spread = std[free, None] * _Least.of(linear, scatter, std, free).inverse
    covariance[np.ix_(free, free)] = spread @ spread.T
    return covariance


def solved(linear: Linear, scatter: Scatter, std: Floats, free: Mask) -> Floats:
    """The step (u,) to the most likely values of the free unknowns."""
    least = _Least.of(linear, scatter, std, free)
    right = np.concatenate([scatter.whitened(linear.residual), -linear.departure[free] / std[free]])
    step = np.zeros(len(std))
    step[free] = std[free] * (least.inverse @ (least.directions.T @ right))
    return step


@dataclass(frozen=True, eq=False)
class _Least:
    """Least squares of whitened rows and of the prior's rows below, for k unknowns in prior deviations.

    By QR: of exact rows the squares, as normal equations have them, leave nothing of the prior.

    Attributes:
        directions: Orthonormal directions (R + k, k) of both.
        inverse: What unit lengths along them are of the unknowns (k, k), upper triangular.
    """

    directions: Floats
    inverse: Floats

    @classmethod
    def of(cls, linear: Linear, scatter: Scatter, std: Floats, free: Mask) -> "_Least":
        """That of the free unknowns."""
        scaled = scatter.whitened(linear.jacobian[:, free] * std[free])
        prior = np.eye(scaled.shape[1])
        directions, triangle = np.linalg.qr(np.vstack([scaled, prior]))
        return cls(directions, np.asarray(solve_triangular(triangle, prior)))


def left_out(found: Estimate, std: Floats, free: Mask) -> Floats:
    """Residuals (R,) of each pose's values when the free unknowns are found from the other poses."""
    linear = found.linear
    left = np.empty_like(linear.residual)
    for poses, step in folds(found, std, free):
        out = np.isin(linear.pose, poses)
        left[out] = linear.residual[out] - linear.jacobian[out] @ step
    return left


def folds(found: Estimate, std: Floats, free: Mask) -> Iterator[tuple[NDArray[np.int64], Floats]]:
    """Poses that are left out together, and the step (u,) that the others make of the free unknowns.

    With P the inverse of the covariance of all values, that of the others alone is `P - P_o^T P_oo^-1 P_o`,
    o being the values left out: one inverse serves all parts. Unknowns are taken along the directions in
    which all values and the prior tell one unit of each.
    """
    linear, precision = found.linear, found.scatter.precision
    inverse = _Least.of(linear, found.scatter, std, free).inverse
    along = (linear.jacobian[:, free] * std[free]) @ inverse
    pulls = precision @ np.column_stack([along, linear.residual])
    right = along.T @ pulls[:, -1] - inverse.T @ (linear.departure[free] / std[free])
    poses = np.unique(linear.pose)
    for part in range(min(MOST_PARTS, len(poses))):
        left = poses[part::MOST_PARTS]
        out = np.isin(linear.pose, left)
        taken = pulls[out, :-1].T @ np.linalg.solve(precision[np.ix_(out, out)], pulls[out])
        step = np.zeros(len(std))
        moved = np.linalg.solve(np.eye(len(inverse)) - taken[:, :-1], right - taken[:, -1])
        step[free] = std[free] * (inverse @ moved)
        yield left, step


def unexplained(found: Estimate, std: Floats, free: Mask) -> tuple[Floats, Floats]:
    """Inverse covariance (R, R) of all values without what the free unknowns explain, and the residuals that
    there are without these (R,).
    """
    linear, precision = found.linear, found.scatter.precision
    along = (linear.jacobian[:, free] * std[free]) @ _Least.of(linear, found.scatter, std, free).inverse
    pulls = precision @ along
    inverse = precision - pulls @ pulls.T
    return inverse, linear.residual + linear.jacobian[:, free] @ linear.departure[free]
