"""What an update makes of the errors that the calibration had before it."""

from typing import TYPE_CHECKING

import numpy as np

from truearm.revision import Carried
from truearm.updating.estimating import Estimate, posterior
from truearm.updating.scene import RANK, Scene

if TYPE_CHECKING:
    from numpy.typing import NDArray


def carried(scene: Scene, found: Estimate) -> Carried:
    """How what was found follows errors that were there before, and what else it is off by.

    With K the gain of what was estimated and H the derivatives by it, it is off by `(1 - K H) x - K (e + n)`:
    x what moved, e what the errors before show, n the noise. What of e the set-ups found anew can make up for
    is theirs, whatever their priors.
    """
    unknowns, linear, state = scene.unknowns, found.linear, found.state
    known = posterior(linear, found.scatter, unknowns.std, unknowns.free)
    gain = known @ linear.jacobian.T @ found.scatter.precision
    left = np.eye(len(known)) - gain @ linear.jacobian
    anew = unknowns.anew
    taken = np.zeros_like(gain)
    taken[anew] = np.linalg.pinv(linear.jacobian[:, anew], rcond=RANK)
    own: NDArray[np.float64] = (left * unknowns.std**2) @ left.T + gain @ scene.scatter(state) @ gain.T
    response = np.zeros((len(gain), scene.seen.size))
    response[:, scene.seen.reshape(-1)] = gain + left @ taken
    return Carried(
        response=response,
        own=own + found.covariance - known,
        inputs=scene.inputs,
        jacobian=scene.arm_jacobian(state),
        setup=scene.tied_jacobian(state),
        tied=scene.tied,
    )
