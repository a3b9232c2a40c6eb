"""Gaussian processes (kriging) of the residual, by scikit-learn."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from truearm.studies.accuracy.fitted import Correction
from truearm.studies.accuracy.libraries import quiet
from truearm.studies.accuracy.methods.searching import Effort
from truearm.studies.accuracy.methods.spaces import Kind, Space
from truearm.studies.accuracy.poses import Poses
from truearm.types import Floats

Inputs = Callable[[Poses], Floats]

FIRST_LOOK: Final = 150
"""Poses on which kernels are compared; the best is then looked into further."""
SECOND_LOOK: Final = 400
STARTS: Final = (1.0, 4.0)
LENGTHS: Final = (2e-2, 1e2)
NOISE: Final = (1e-4, 2.0)
SHAPES: Final = ("rbf", "matern")


@dataclass(frozen=True, eq=False)
class Trial:
    """A kernel to try on inputs."""

    inputs: Inputs
    kernel: Any
    settings: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Process:
    """A fitted process, the same kernel for x, y and z."""

    inputs: Inputs
    process: Any
    settings: Mapping[str, Any]

    def predict(self, poses: Poses) -> Floats:
        """The correction in the base frame (n, 3), m."""
        found: Floats = self.process.predict(self.inputs(poses))
        return found

    def spread(self, poses: Poses) -> Floats:
        """Standard deviation of a measured coordinate (n, 3), m; the noise is part of the kernel."""
        _, found = self.process.predict(self.inputs(poses), return_std=True)
        return np.asarray(found, dtype=np.float64)


def fit_joint(poses: Poses, residuals: Floats, effort: Effort) -> Correction:
    """A kernel of the joints together, each with its own length."""
    return _best(_anisotropic(("circles", "joints"), poses, effort), poses, residuals, effort)


def fit_cartesian(poses: Poses, residuals: Floats, effort: Effort) -> Correction:
    """A kernel of the target's place, each axis with its own length."""
    return _best(_anisotropic(("cartesian",), poses, effort), poses, residuals, effort)


def fit_additive(poses: Poses, residuals: Floats, effort: Effort) -> Correction:
    """A sum of kernels of single joints, each with its own height and length."""
    from sklearn.gaussian_process.kernels import WhiteKernel  # noqa: PLC0415

    from truearm.studies.accuracy.methods.additive import SumOverJoints  # noqa: PLC0415

    count = poses.joints.shape[1]
    trials = [
        Trial(
            _joints,
            SumOverJoints(np.full(count, 1.0 / count), np.full(count, length), poses.revolute)
            + WhiteKernel(0.2, NOISE),
            {"start": length},
        )
        for length in effort.some((1.0, 0.15))
    ]
    return _best(trials, poses, residuals, effort)


def _joints(poses: Poses) -> Floats:
    return poses.joints


def _anisotropic(kinds: Sequence[Kind], poses: Poses, effort: Effort) -> list[Trial]:
    from sklearn.gaussian_process.kernels import (  # noqa: PLC0415
        RBF,
        ConstantKernel,
        Matern,
        WhiteKernel,
    )

    trials = []
    for kind in kinds:
        space = Space.of(kind, poses)
        count = space.coordinates(poses).shape[1]
        for shape in SHAPES:
            for start in STARTS[:1] if len(kinds) > 1 else STARTS:
                lengths = np.full(count, start)
                part = RBF(lengths, LENGTHS) if shape == "rbf" else Matern(lengths, LENGTHS, nu=2.5)
                kernel = ConstantKernel(1.0, (1e-3, 1e2)) * part + WhiteKernel(0.2, NOISE)
                settings = {"inputs": kind, "kernel": shape, "start": start}
                trials.append(Trial(space.coordinates, kernel, settings))
    return effort.some(trials)


def _best(trials: Sequence[Trial], poses: Poses, residuals: Floats, effort: Effort) -> Process:
    """The kernel with the largest evidence: on few poses all, on more the best, then conditioned on all."""
    first, second = (np.arange(min(count, len(poses))) for count in (FIRST_LOOK, SECOND_LOOK))
    looked = [_process(one, poses.select(first), residuals[first], effort) for one in trials]
    best = max(range(len(trials)), key=lambda k: float(looked[k].log_marginal_likelihood_value_))
    chosen, found = trials[best], looked[best]
    if len(second) > len(first):
        again = Trial(chosen.inputs, found.kernel_, chosen.settings)
        found = _process(again, poses.select(second), residuals[second], effort)
    if len(poses) > len(second):
        found = _process(Trial(chosen.inputs, found.kernel_, {}), poses, residuals, effort, optimise=False)
    return Process(chosen.inputs, found, {**chosen.settings, "kernel_found": str(found.kernel_)})


def _process(trial: Trial, poses: Poses, residuals: Floats, effort: Effort, *, optimise: bool = True) -> Any:  # noqa: ANN401
    from sklearn.gaussian_process import GaussianProcessRegressor  # noqa: PLC0415

    process = GaussianProcessRegressor(
        trial.kernel,
        alpha=1e-8,
        optimizer="fmin_l_bfgs_b" if optimise else None,
        normalize_y=True,
        random_state=effort.seed,
    )
    with quiet():
        return process.fit(trial.inputs(poses), residuals)
