"""A kernel that is a sum over joints, for scikit-learn's Gaussian process."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.gaussian_process.kernels import Hyperparameter, Kernel, StationaryKernelMixin

from truearm.types import Floats


class SumOverJoints(StationaryKernelMixin, Kernel):  # type: ignore[misc]
    """k(x, y) = sum over joints of height^2 exp(-chord^2 / (2 length^2)), each joint with its own two.

    The chord of joints that turn is 2 sin(difference / 2), else the difference.

    Attributes:
        heights: Squared heights (N,).
        lengths: Lengths (N,).
        turns: Whether each joint turns (N,).
    """

    def __init__(self, heights: Floats, lengths: Floats, turns: NDArray[np.bool_]) -> None:
        self.heights = heights
        self.lengths = lengths
        self.turns = turns

    @property
    def hyperparameter_heights(self) -> Any:  # noqa: ANN401
        """Squared heights as the library optimises them."""
        return Hyperparameter("heights", "numeric", (1e-5, 1e2), len(self.heights))

    @property
    def hyperparameter_lengths(self) -> Any:  # noqa: ANN401
        """Lengths as the library optimises them, rad."""
        return Hyperparameter("lengths", "numeric", (1e-2, 1e2), len(self.lengths))

    def __call__(self, X: Floats, Y: Floats | None = None, eval_gradient: bool = False) -> Any:  # noqa: N803, ANN401
        """The kernel (n, m), and with `eval_gradient` its derivatives by the logarithms (n, n, 2 N)."""
        other = X if Y is None else Y
        gap = X[:, None, :] - other[None, :, :]
        chord = np.where(self.turns, 2.0 * np.sin(gap / 2.0), gap)
        scaled = np.square(chord / self.lengths)
        parts = np.asarray(self.heights) * np.exp(-0.5 * scaled)
        if not eval_gradient:
            return parts.sum(axis=2)
        return parts.sum(axis=2), np.concatenate([parts, parts * scaled], axis=2)

    def diag(self, X: Floats) -> Floats:  # noqa: N803
        """Variances (n,)."""
        return np.full(len(X), float(np.sum(self.heights)))
