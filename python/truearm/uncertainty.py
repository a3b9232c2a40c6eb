"""Covariance of what a calibration predicts: the arm's part, without noise and set-up."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from truearm._core import Posterior
from truearm.core_set import core_set
from truearm.errors import WorkError
from truearm.fitting import Task, feature_values, field_options
from truearm.models import CONSTANT

if TYPE_CHECKING:
    from truearm.calibration import Calibration

Floats = NDArray[np.float64]

LENGTHS: Final = (1, 2)
"""Places of d and a among a link's parameters."""


class Spread(Protocol):
    """Knows how uncertain the arm's parameters are."""

    def covariance(self, inputs: Floats, jacobian: Floats) -> Floats:
        """Covariance (n, m, m) of `jacobian` (n, m, 5 L) times parameters at inputs (n, I)."""

    def prior(self, inputs: Floats, jacobian: Floats) -> Floats:
        """Variances (n, m) of the same before any measurement."""


@dataclass(frozen=True, eq=False)
class ConstantSpread:
    """Constants: one covariance for the whole arm."""

    columns: list[int]
    of_constants: Floats
    before: Floats

    @classmethod
    def of(cls, calibration: "Calibration") -> "ConstantSpread":
        """That of a calibration's constant model."""
        columns = task_of(calibration).columns(calibration.constant.names)
        size = len(columns)
        length, angle, scaled = calibration.options.prior
        scale = calibration.constant.prior_scale if scaled else 1.0
        before = scale * np.where(np.isin(np.array(columns) % 5, LENGTHS), length, angle)
        return cls(columns, calibration.constant.covariance[:size, :size], before**2)

    def covariance(self, inputs: Floats, jacobian: Floats) -> Floats:
        """Covariance (n, m, m), the same rule everywhere."""
        chosen = jacobian[:, :, self.columns]
        return np.asarray(chosen @ self.of_constants @ chosen.transpose(0, 2, 1))

    def prior(self, inputs: Floats, jacobian: Floats) -> Floats:
        """Variances (n, m) that the prior of the constants gives."""
        return np.asarray(np.square(jacobian[:, :, self.columns]) @ self.before)


@dataclass(frozen=True, eq=False)
class VariableSpread:
    """Constants and field: the exact posterior given the rows that were fitted."""

    columns: list[int]
    posterior: Posterior
    inflation: float

    @classmethod
    def of(cls, calibration: "Calibration") -> "VariableSpread":
        """That of a calibration's variable model, from its rows.

        Raises:
            WorkError: If the rows were left out of the file.
        """
        rows, details = calibration.rows, calibration.variable
        if rows is None or details is None:
            raise WorkError(
                "standard deviations need the measurements that the calibration was fitted to",
                rule="They were left out of this file",
                way_out="Use the file that still has them",
            )
        task = task_of(calibration)
        measured = core_set(
            calibration.robot, rows.data, calibration.selection, calibration.groups, rows.weight
        )
        values = feature_values(rows.data, calibration.options.features)
        names = calibration.identifiability.determined
        options = field_options(task, names, values, details.feature_ranges, details.hyper)
        columns = list(calibration.arm.candidates.columns)
        point = calibration.models[CONSTANT]
        posterior = Posterior(task.problem(measured, columns), point.constants, point.setup, options)
        return cls(columns, posterior, details.inflation)

    def covariance(self, inputs: Floats, jacobian: Floats) -> Floats:
        """Covariance (n, m, m) at inputs (n, I)."""
        chosen = np.ascontiguousarray(jacobian[:, :, self.columns])
        return self.posterior.covariance(np.ascontiguousarray(inputs), chosen) * self.inflation**2

    def prior(self, inputs: Floats, jacobian: Floats) -> Floats:
        """Variances (n, m) that constants and field have before any measurement."""
        chosen = np.ascontiguousarray(jacobian[:, :, self.columns])
        return self.posterior.prior(np.ascontiguousarray(inputs), chosen) * self.inflation**2


def task_of(calibration: "Calibration") -> Task:
    """The task that made a calibration."""
    return Task(calibration.arm, calibration.selection, calibration.groups, calibration.options)
