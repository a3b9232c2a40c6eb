"""What rows leave in fits without them, from one fit to all."""

from dataclasses import dataclass

import numpy as np

from truearm.types import Floats


@dataclass(frozen=True, eq=False)
class LeftOut:
    """What n rows leave in fits without them, each in a fit to all the others.

    Attributes:
        alone: Residual of each row in the fit without it (n, 3), m.
        lengths: Its length, of which what the others leave uncertain is taken off (n,), m: as long as noise.
        squares: Sum of squares that the fit to all rows leaves, m^2.
        rank: How many unknowns the rows tell.
    """

    alone: Floats
    lengths: Floats
    squares: float
    rank: int


def left_out(residuals: Floats, jacobian: Floats) -> LeftOut:
    """What rows leave in fits without them.

    Args:
        residuals: What each row leaves (n, 3), m.
        jacobian: Derivatives of what each row says by the p unknowns (n, 3, p).
    """
    n, unknowns = len(residuals), jacobian.shape[2]
    basis = _basis(jacobian.reshape(3 * n, unknowns))
    left = residuals.reshape(-1) - basis @ (basis.T @ residuals.reshape(-1))
    blocks, of_row = basis.reshape(n, 3, -1), left.reshape(n, 3)
    free = np.eye(3) - blocks @ blocks.transpose(0, 2, 1)
    alone = np.einsum("nij,nj->ni", np.linalg.pinv(free, rcond=1e-6, hermitian=True), of_row)
    lengths = np.sqrt(np.maximum(np.einsum("ni,ni->n", of_row, alone), 0.0))
    return LeftOut(alone, lengths, float(left @ left), basis.shape[1])


def _basis(jacobian: Floats) -> Floats:
    """Orthonormal columns that span those of a Jacobian, whatever the sizes of its unknowns."""
    scaled = jacobian / np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
    u, sizes, _ = np.linalg.svd(scaled, full_matrices=False)
    return np.asarray(u[:, sizes > 1e-10 * sizes[0]])
