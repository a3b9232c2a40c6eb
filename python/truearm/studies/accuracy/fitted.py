"""Fitted methods: where they put the target, and how sure they are."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from truearm._core import NORMAL_95, residuals
from truearm.fits.core_set import core_set
from truearm.fits.models import ArmModel
from truearm.judgement.judging import model_inputs
from truearm.measurements import Measurements
from truearm.studies.accuracy.poses import Poses, Prepared
from truearm.types import Floats

Settings = Mapping[str, Any]


class Fitted(Protocol):
    """A method that was fitted to the training rows of a cell."""

    @property
    def settings(self) -> Settings:
        """What its search chose."""

    def errors(self, prepared: Prepared, data: Measurements) -> Floats:
        """Measured minus predicted position of the judged target, base frame (n, 3), m."""

    def coverage(self, prepared: Prepared) -> float | None:
        """Share of the held-out coordinates within the 95 % intervals; None where it gives none."""


class Correction(Protocol):
    """What is added to the constant model's position, depending on the pose."""

    @property
    def settings(self) -> Settings:
        """What its search chose."""

    def predict(self, poses: Poses) -> Floats:
        """The correction in the base frame (n, 3), m."""

    def spread(self, poses: Poses) -> Floats | None:
        """Standard deviation of a measured coordinate (n, 3), m; None where it is not told."""


@dataclass(frozen=True, eq=False)
class FittedArm:
    """A model of the arm: parameters that are constant or vary.

    Attributes:
        model: The model.
        settings: What its search chose.
        share: Share of held-out coordinates within its intervals, if it gives any.
    """

    model: ArmModel
    settings: Settings = field(default_factory=dict)
    share: float | None = None

    def errors(self, prepared: Prepared, data: Measurements) -> Floats:
        """Measured minus predicted position of the judged target, base frame (n, 3), m."""
        task, target = prepared.task, prepared.cell.cut.target
        parameters = self.model.parameters(model_inputs(task.arm, data, ()))
        measured = core_set(task.arm.robot, data, prepared.selection(target), task.groups)
        left = residuals(task.problem(measured, []), parameters, prepared.setup(self.model, target))
        return left[:, :3]

    def coverage(self, _: Prepared) -> float | None:
        """As it was found with the fit."""
        return self.share


@dataclass(frozen=True, eq=False)
class CorrectedArm:
    """The constant model with a correction of its position.

    At another target than the fitted one the correction is that of its place, and the point of the target on
    the tool is found from the training rows, as for all methods.
    """

    correction: Correction

    @property
    def settings(self) -> Settings:
        """What the correction's search chose."""
        return self.correction.settings

    def errors(self, prepared: Prepared, data: Measurements) -> Floats:
        """Measured minus predicted position of the judged target, base frame (n, 3), m."""
        target, constant = prepared.cell.cut.target, FittedArm(prepared.constant)
        poses = prepared.poses(data, target)
        left = constant.errors(prepared, data) - self.correction.predict(poses)
        if target == 0:
            return left
        train = prepared.train.select(prepared.train.seen(target))
        seen = prepared.poses(train, target)
        known = constant.errors(prepared, train) - self.correction.predict(seen)
        return left - _shifts(seen, known, train.group, poses, data.group)

    def coverage(self, prepared: Prepared) -> float | None:
        """Share of the held-out coordinates within mean plus or minus 1.96 standard deviations."""
        if prepared.cell.cut.target > 0:
            return None
        spread = self.correction.spread(prepared.poses(prepared.held, 0))
        if spread is None:
            return None
        return float((np.abs(self.errors(prepared, prepared.held)) <= NORMAL_95 * spread).mean())


def _shifts(
    seen: Poses, known: Floats, seen_group: NDArray[np.str_], poses: Poses, group: NDArray[np.str_]
) -> Floats:
    """What a shift of the target on the tool, the mean of `known` in the flange frame, changes (n, 3)."""
    shifts = np.zeros_like(poses.points)
    in_flange = np.einsum("nji,nj->ni", seen.rotations, known)
    for name in set(group.tolist()):
        rows = group == name
        shifts[rows] = poses.rotations[rows] @ in_flange[seen_group == name].mean(axis=0)
    return shifts
