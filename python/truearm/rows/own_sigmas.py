"""What rows state of how far they may be off, as fits take it."""

from collections.abc import Sequence

import numpy as np

from truearm.measurements import Measurements
from truearm.types import AXES, Floats


def sigmas_of_axes(data: Measurements) -> Floats:
    """Stated standard deviations (n, 3) of positions along x, y and z of world, m; zero where none is."""
    alike = np.repeat(data.stated_sigma_m[:, None], AXES, axis=1)
    axes = data.sigma_axes_m
    return alike if axes is None else np.where(np.isfinite(axes), axes, alike)


def sigmas_of_turns(data: Measurements) -> Floats:
    """Stated standard deviations (n,) of orientations, rad; zero where none is."""
    return np.zeros(len(data)) if data.sigma_rad is None else np.nan_to_num(data.sigma_rad)


def own_covariances(data: Measurements, groups: Sequence[str], frames: Floats) -> Floats:
    """Stated covariances (n, 3, 3) of positions, base frame, m^2.

    Args:
        data: The rows, n of them.
        groups: Names of the set-ups, in the order of their numbers.
        frames: world_from_base of each (G, 4, 4).
    """
    if data.sigma_axes_m is None:
        return np.square(data.stated_sigma_m)[:, None, None] * np.eye(AXES)
    number = {name: k for k, name in enumerate(groups)}
    turned = frames[[number[name] for name in data.group.tolist()], :AXES, :AXES]
    return np.asarray(np.einsum("nki,nk,nkj->nij", turned, np.square(sigmas_of_axes(data)), turned))


def of_all_targets(covariances: Floats, targets: int) -> Floats:
    """Covariances (n, 3 t, 3 t) of t targets, each with that of a row (n, 3, 3), and none in common."""
    size = AXES * targets
    whole = np.einsum("tu,nij->ntiuj", np.eye(targets), covariances)
    return np.asarray(whole.reshape(-1, size, size))
