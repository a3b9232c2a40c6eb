"""Candidate poses as a calibration sees them: derivatives, uncertainty and noise of what they would show."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from truearm._core import Problem, Setup, linearise, setup_jacobian
from truearm.arrays import HoldsReadOnly, as_rows, read_only
from truearm.calibration import Calibration
from truearm.certainty.uncertainty import task_of
from truearm.errors import UsageError, WorkError, count_of, did_you_mean, list_names
from truearm.fits.core_set import Selection, measured_points
from truearm.fits.endpoints import group_number
from truearm.fits.enough_values import setup_unknowns
from truearm.kinds import required
from truearm.types import AXES, Floats, Mask
from truearm.updating.parts import part_of, places_of
from truearm.updating.scale import usual_sigma_m

if TYPE_CHECKING:
    from truearm import _core


@dataclass(frozen=True, eq=False)
class Candidates(HoldsReadOnly):
    """c poses that can be measured, in a set-up of the calibration with what was measured there.

    Attributes:
        calibration: What is known.
        readings: Of the poses (c, N).
        group: Set-up they would be measured in; the calibration's last one by default.
        features: A number for each feature; the middle of what was measured by default.
    """

    calibration: Calibration
    readings: Floats
    group: str | int | None = None
    features: Mapping[str, float] | None = None

    def __post_init__(self) -> None:
        robot = required(self.calibration, Calibration, "the calibration").robot
        rows, _ = as_rows(self.readings, robot.joint_count, what=f"joint readings of {robot.name}")
        object.__setattr__(self, "readings", read_only(rows))
        if self.group is not None:
            number = group_number(self.calibration, self.group)
            object.__setattr__(self, "group", self.calibration.groups[number])
        names = self.calibration.options.features
        for name in self.features or {}:
            if name not in names:
                raise UsageError(
                    f'the calibration does not vary with "{name}"',
                    where="features",
                    rule=f"It varies with {list_names(names) or 'none'}",
                    way_out=did_you_mean(name, names),
                )
        if self.calibration.selection.distances:
            raise WorkError(
                "this calibration was made from distances",
                rule="Poses are proposed where points are measured",
            )

    def __len__(self) -> int:
        return len(self.readings)

    def values(self, readings: Floats) -> Floats:
        """Inputs (n, I) of the field at readings (n, N)."""
        return self.calibration.field_inputs(readings, self.feature_values)

    @cached_property
    def points(self) -> Floats:
        """The tool's points (c, 3) in the base frame, m."""
        return self.calibration.position(self.readings, features=self.feature_values)

    @cached_property
    def jacobian(self) -> Floats:
        """Derivatives (c, m, 5 L) of what is measured by the chain's parameters, base frame."""
        return linearise(self._problem, self._parameters, self._set_ups)[0]

    @cached_property
    def setup(self) -> Floats:
        """Derivatives (c, m, W) of it by the unknowns of the set-up."""
        return setup_jacobian(self._problem, self._parameters, self._set_ups)

    @cached_property
    def noise(self) -> Floats:
        """Covariance (c, m, m) of what a measurement shows anew, by a device as good as that of before."""
        found = self.calibration.spread.noise(self.jacobian, self.orientation)
        own = usual_sigma_m(self.calibration) ** 2 * np.diag(~self.orientation)
        return np.ascontiguousarray(found + own)

    def core(self, apart: float = 0.0) -> "_core.Candidates":
        """Internal: the candidates as the core chooses from them, at a distance from one another, m."""
        return {"noise": self.noise, "points": np.ascontiguousarray(self.points), "apart": apart}

    @property
    def set_up(self) -> str:
        """Name of the set-up they would be measured in."""
        return self.calibration.groups[self._number]

    @property
    def selection(self) -> Selection:
        """What would be measured: what the set-up showed when the arm was calibrated."""
        return self.calibration.measured.selection(self._number, self.calibration.selection)

    @property
    def shown(self) -> str:
        """What would be measured, in words."""
        turned = "with" if self.selection.orientation else "without"
        return f"{count_of(len(self.selection.targets), 'target')} {turned} orientation"

    @property
    def orientation(self) -> Mask:
        """Which of the m measured values are rotations."""
        selection = self.selection
        return np.array([False] * (AXES * len(selection.targets)) + [True] * (AXES * selection.orientation))

    def covariance(self, others: "Candidates | None" = None) -> Floats:
        """Covariance of what candidates would show, without noise, and of the first target at `others`.

        Returns:
            (c m + 3 t, c m + 3 t): the arm's and the set-up's part.
        """
        rows, own, inputs = self.parts(self.jacobian.shape[1])
        if others is not None:
            more = others.parts(AXES)
            pairs = zip((rows, own, inputs), more, strict=True)
            rows, own, inputs = (np.concatenate(pair) for pair in pairs)
        return np.ascontiguousarray(self.calibration.spread.joint(inputs, rows, own))

    def parts(self, values: int) -> tuple[Floats, Floats, Floats]:
        """Derivatives (k, 3, 5 L) and (k, 3, S) of so many values of each, the first ones; inputs (k, I)."""
        rows, own = self.jacobian[:, :values], self._setup_in_all()[:, :values]
        inputs = np.repeat(self.values(self.readings), values // AXES, axis=0)
        return rows.reshape(len(inputs), AXES, -1), own.reshape(len(inputs), AXES, -1), inputs

    @property
    def _number(self) -> int:
        if self.group is None:
            return len(self.calibration.groups) - 1
        return group_number(self.calibration, self.group)

    @cached_property
    def feature_values(self) -> Mapping[str, float]:
        """The number of each feature that the field varies with."""
        names = self.calibration.options.features
        given = self.features or {}
        learned = self.calibration.learned_from
        if learned is None and any(name not in given for name in names):
            raise WorkError(
                f"the features {list_names(names)} are not known",
                rule="The measurements were left out of this file",
                way_out="Use the file that still has them",
            )
        middle = {} if learned is None else {n: float(learned.data.features[n].median()) for n in names}
        return {name: given.get(name, middle.get(name, 0.0)) for name in names}

    @cached_property
    def _parameters(self) -> Floats:
        return self.calibration.model.parameters(self.values(self.readings))

    @cached_property
    def _problem(self) -> Problem:
        arm, selection, count = self.calibration.arm, self.selection, len(self)
        measured = measured_points(
            arm.robot.joints_from_readings(self.readings),
            np.zeros((count, len(selection.targets), AXES)),
            np.repeat(np.eye(AXES)[None], count, axis=0) if selection.orientation else None,
            group=self._number,
        )
        return Problem(arm.flange_chain, measured, list(range(arm.table.size)), arm.world_is_known)

    @property
    def _set_ups(self) -> Setup:
        """The calibration's set-ups with what would be measured."""
        return part_of(self.calibration.model.setup, self.selection, self.calibration.selection)

    def _setup_in_all(self) -> Floats:
        """Derivatives (c, m, S) by the unknowns of all set-ups that were fitted."""
        count = setup_unknowns(task_of(self.calibration))
        width = count // len(self.calibration.groups)
        found = np.zeros((*self.setup.shape[:2], count))
        places = places_of(self.calibration.arm, self.selection, self.calibration.selection)
        found[:, :, self._number * width + places] = self.setup
        return found
