"""Points of a set-up: its frame in closed form, where its targets on the tool are known, and their spread."""

import numpy as np

from truearm.types import Floats


def register(
    in_base: Floats, in_world: Floats, turned_in_base: Floats, turned_in_world: Floats, lever_m: float
) -> Floats:
    """world_from_base (4, 4) that brings points and orientations closest to the measured ones.

    Least squares by singular value decomposition (Umeyama 1991, without scale). An orientation that is off
    by an angle counts like a point at `lever_m` that is off by that angle's arc.

    Args:
        in_base: Predicted points (k, 3).
        in_world: Measured points (k, 3).
        turned_in_base: Predicted orientations (j, 3, 3); j may be 0.
        turned_in_world: Measured orientations (j, 3, 3).
        lever_m: Noise of positions over noise of orientations.
    """
    middle_base, middle_world = in_base.mean(axis=0), in_world.mean(axis=0)
    together = (in_world - middle_world).T @ (in_base - middle_base)
    together += 0.5 * lever_m**2 * np.einsum("nij,nkj->ik", turned_in_world, turned_in_base)
    u, _, vt = np.linalg.svd(together)
    keep = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    world_from_base = np.eye(4)
    world_from_base[:3, :3] = u @ keep @ vt
    world_from_base[:3, 3] = middle_world - world_from_base[:3, :3] @ middle_base
    return world_from_base


def spread_m(points: Floats) -> float:
    """Median distance of points (n, 3) from their median point, m; one that is far off does not count."""
    return float(np.median(np.linalg.norm(points - np.median(points, axis=0), axis=1)))
