"""Axes of a device along which rows scatter more than along the others, where no sigma tells the fit so."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.doubts.scattering import (
    ERROR_OF_MEDIAN,
    LEAST_KEPT,
    LITTLE,
    Scattering,
    deviation_of,
    leaves,
    or_else,
    single_shot,
)
from truearm.doubts.whitened import Whitened
from truearm.errors import Notice
from truearm.fits.fitted_rows import FittedRows
from truearm.rows.own_sigmas import sigmas_of_axes
from truearm.types import AXES, Floats, Mask
from truearm.units import MM_PER_METRE

UNEVEN_AXES: Final = "uneven_axes"
WORSE: Final = 3.0
"""Times that an axis scatters as much as either of the others from which it is told: what a model does not
hold may lie along one as well, as what gives way under load lies along the vertical."""


def uneven_axes(found: Calibration, fitted: FittedRows, seen: Whitened) -> list[Notice]:
    """A warning where rows that do not say so scatter far more along one axis of their device than along both
    others, as those of a camera do along its depth.

    Args:
        found: The calibration.
        fitted: The rows that it was fitted to.
        seen: What it leaves of them.
    """
    names = fitted.data.group[seen.rows]
    groups = [name for name in found.groups if name in names]
    frames = found.models[found.model_name].setup.frames
    left, told = _Left.of(seen), []
    for name in groups:
        own = names == name
        stated = np.median(sigmas_of_axes(fitted.data.select(seen.rows[own])), axis=0)
        turned = frames[found.groups.index(name), :AXES, :AXES]
        every = [left.along(turned[axis], own, "xyz"[axis], float(stated[axis])) for axis in range(AXES)]
        told.extend(_worst(every, f" of {name}" if len(groups) > 1 else ""))
    if not told:
        return []
    text = (
        f"{leaves(found)} what scatters more along one axis of the device than along the others, as along "
        f"the depth of a camera: {'; '.join(told)}. Where rows do not state it all axes count the same, and "
        "the good ones are spoilt. Give columns sigma_x_mm, sigma_y_mm and sigma_z_mm, as the device's data "
        f"sheet says, or as told here and little ({LITTLE:g} mm) along the others, since what all have in "
        f"common is found beside it.{or_else(found)}"
    )
    return [Notice(UNEVEN_AXES, text)]


def _worst(every: Sequence[Scattering], of: str) -> list[str]:
    """The axis that is worse than both others, in words; none where there is none, or rows state it."""
    worst = max(every, key=lambda axis: axis.size)
    others = [axis for axis in every if axis is not worst]
    if worst.says_so or not all(worst.is_worse(other, WORSE) for other in others):
        return []
    next_to = max(others, key=lambda axis: axis.size)
    than = " and ".join(axis.name for axis in others)
    times = worst.size / next_to.size
    return [f"{worst.name}{of} {times:.2g} times as much as {than}, {worst.beyond(next_to)} to state"]


@dataclass(frozen=True, eq=False)
class _Left:
    """What a model leaves of t targets of v visits, base frame.

    Attributes:
        residual: (v, t, 3), m.
        kept: The covariances that it is expected to have (v, t, 3, 3), m^2.
        whole: Those of the noise, without what the fit took (v, t, 3, 3), m^2.
        held: What was measured (v, t).
        shots: How many shots a visit has (v, t).
        single: Variance of a single shot along an axis (v, t), m^2.
    """

    residual: Floats
    kept: Floats
    whole: Floats
    held: Mask
    shots: Floats
    single: Floats

    @classmethod
    def of(cls, seen: Whitened) -> "_Left":
        """That of whitened residuals."""
        root = np.linalg.inv(seen.root)
        points = (len(seen.left), -1, AXES)
        shots, single = seen.shots.reshape(points), seen.single.reshape(points)
        return cls(
            (root @ seen.left.ravel()).reshape(points),
            _blocks(root @ (np.eye(len(root)) - seen.taken) @ root.T, len(seen.left)),
            _blocks(root @ root.T, len(seen.left)),
            np.asarray(seen.held.reshape(points).all(axis=2)),
            shots.mean(axis=2),
            single.mean(axis=2),
        )

    def along(self, axis: Floats, visits: Mask, name: str, stated_m: float) -> Scattering:
        """How that of some visits (v,) scatters along an axis (3,) of the base, of this name."""
        held = self.held & visits[:, None]
        whole, kept = (np.einsum("i,nij,j->n", axis, each[held], axis) for each in (self.whole, self.kept))
        expected = np.sqrt(np.maximum(kept, LEAST_KEPT * whole))
        deviation = deviation_of(self.residual[held] @ axis / expected)
        of_visit, shots, single = (
            float(np.median(each)) for each in (whole, self.shots[held], self.single[held])
        )
        size = single_shot(deviation, of_visit, shots, single)
        error = float(ERROR_OF_MEDIAN / np.sqrt(held.sum()))
        return Scattering(name, deviation, MM_PER_METRE * size, error, MM_PER_METRE * stated_m)


def _blocks(covariance: Floats, visits: int) -> Floats:
    """Covariances (v, t, 3, 3) of each target of each visit, of all (v m, v m) together."""
    points = len(covariance) // AXES
    each = np.arange(points)
    blocks = covariance.reshape(points, AXES, points, AXES)[each, :, each]
    return blocks.reshape(visits, -1, AXES, AXES)
