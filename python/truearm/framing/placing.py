"""A work object from points of it that were touched, and where they are on it."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import WorkError, count_of
from truearm.framing.agreement import check_agreement, check_places, far_rows
from truearm.framing.identified_frame import IdentifiedFrame
from truearm.registration import register
from truearm.rotations import rigid_motion

Floats = NDArray[np.float64]

FEWEST: Final = 3
LEAST_SPREAD_M: Final = 1e-3
LEAST_SHARE: Final = 1e-3


def object_from_points(
    base_from_tool: Floats,
    point_in_object: Floats,
    rows: NDArray[np.int64],
    tip_covariance: Floats | None = None,
) -> IdentifiedFrame:
    """The object whose points the tool's tip touched.

    Args:
        base_from_tool: Poses of the calibrated tool (n, 4, 4).
        point_in_object: Where the touched points truly are (n, 3), m.
        rows: Number of each touch in its file (n,).
        tip_covariance: Covariance of the tool's tip in its own axes (3, 3). It moves all points together,
            so the residuals do not show it.

    Raises:
        WorkError: If there are fewer than three points, or they lie on a line.
    """
    touched = base_from_tool[:, :3, 3]
    _check_count(point_in_object)
    _check_spread(point_in_object, LEAST_SHARE * float(np.ptp(point_in_object, axis=0).max()))
    check_places(touched, point_in_object)
    _check_spread(point_in_object, LEAST_SPREAD_M)
    none = np.empty((0, 3, 3))
    transform = register(point_in_object, touched, none, none, 0.0)
    residuals = touched - point_in_object @ transform[:3, :3].T - transform[:3, 3]
    freedom = residuals.size - 6
    noise = float(np.sqrt(np.square(residuals).sum() / freedom))
    jacobian = rigid_motion(point_in_object @ transform[:3, :3].T)
    notices = far_rows(residuals, jacobian, rows)
    check_agreement(noise, notices)
    pseudo_inverse = np.linalg.pinv(jacobian.reshape(-1, 6))
    covariance = noise**2 * pseudo_inverse @ pseudo_inverse.T
    if tip_covariance is not None:
        gain = pseudo_inverse @ base_from_tool[:, :3, :3].reshape(-1, 3)
        covariance = covariance + gain @ tip_covariance @ gain.T
    what = f"{len(touched)} points of it"
    return IdentifiedFrame(
        "object", transform, covariance, residuals, rows, noise, freedom, what, tuple(notices)
    )


def _check_count(points: Floats) -> None:
    if len(points) < FEWEST:
        raise _too_little(count_of(len(points), "point"))


def _check_spread(points: Floats, least_m: float) -> None:
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / np.sqrt(len(points))
    if spread[1] <= least_m:
        raise _too_little(f"the {len(points)} points lie on a line")


def _too_little(what: str) -> WorkError:
    return WorkError(
        what,
        rule="Three points that span a plane tell where an object is",
        way_out="Touch points far from each other, some more than three",
    )
