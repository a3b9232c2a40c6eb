"""A work object from points of it that were touched, and where they are on it."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import Notice, WorkError, count_of
from truearm.framing.agreement import check_agreement, check_places, far_rows, tell_handedness
from truearm.framing.identified_frame import IdentifiedFrame
from truearm.registration import register
from truearm.rotations import rigid_motion
from truearm.types import Floats

FEWEST: Final = 3
LEAST_SPREAD_M: Final = 1e-3
LEAST_SHARE: Final = 1e-3
FACES: Final = 0.7
"""Cosine from which on the normal of a plane counts as an axis."""


def object_from_points(
    base_from_tool: Floats,
    point_in_object: Floats,
    rows: NDArray[np.int64],
    wrist_in_tool: Floats,
    tip_covariance: Floats | None = None,
) -> IdentifiedFrame:
    """The object whose points the tool's tip touched.

    Args:
        base_from_tool: Poses of the calibrated tool (n, 4, 4).
        point_in_object: Where the touched points truly are (n, 3), m.
        rows: Number of each touch in its file (n,).
        wrist_in_tool: Where the wrist is in the tool's own axes (3,), m: the tool came from that side.
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
    if not tell_handedness(touched, point_in_object):
        came_from = transform[:3, :3].T @ (base_from_tool[:, :3, :3].mean(axis=0) @ wrist_in_tool)
        notices += _turned_over(point_in_object, came_from)
    pseudo_inverse = np.linalg.pinv(jacobian.reshape(-1, 6))
    covariance = noise**2 * pseudo_inverse @ pseudo_inverse.T
    if tip_covariance is not None:
        gain = pseudo_inverse @ base_from_tool[:, :3, :3].reshape(-1, 3)
        covariance = covariance + gain @ tip_covariance @ gain.T
    what = f"{len(touched)} points of it"
    return IdentifiedFrame(
        "object", transform, covariance, residuals, rows, noise, freedom, what, tuple(notices)
    )


def _turned_over(places: Floats, came_from: Floats) -> list[Notice]:
    """A notice that the object may be its mirror image, unless its z axis points to where the tool came from.

    That is how objects mostly are that are touched on the face that z stands on.

    Args:
        places: Points of one plane, in the object's frame (n, 3).
        came_from: Direction from the tip to the wrist there (3,).
    """
    normal = np.linalg.svd(places - places.mean(axis=0))[2][2]
    faces_z = abs(normal[2]) > FACES
    if faces_z and came_from[2] > 0.0:
        return []
    seen = ", and its z axis points away from where the tool came from" if faces_z else ""
    text = (
        f"The touched points hardly leave a plane, in which an object and its mirror image are alike{seen}: "
        "check the signs and the order of x, y and z and the direction of z, or touch a point beside it"
    )
    return [Notice("one_plane", text)]


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
