"""Errors of schemes along a path and over the workspace, and their statistics over seeds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truearm._core import ANGLE_ARM_M, Chain
from truearm.fits.parameters import KIND_COUNT, A, D
from truearm.studies.experiment import Experiment
from truearm.studies.schemes import Scheme
from truearm.types import Floats
from truearm.units import MM_PER_METRE


@dataclass(frozen=True, eq=False)
class Trace:
    """A scheme along poses.

    Attributes:
        errors_mm: Real minus predicted points (n, 3).
        parameters: Its parameters there (n, L, 5).
    """

    errors_mm: Floats
    parameters: Floats

    @property
    def size_mm(self) -> Floats:
        """Lengths of the errors (n,)."""
        return np.asarray(np.linalg.norm(self.errors_mm, axis=1))


def trace(made: Experiment, scheme: Scheme, readings: Floats) -> Trace:
    """A scheme's errors at readings (n, N).

    The error of a prediction at q is the error that is left after compensation at the pose whose corrected
    joints are q: the real point there minus the point that was asked for.
    """
    chain = scheme_chain(made, scheme)
    parameters = np.ascontiguousarray(scheme.parameters(readings))
    values = np.ascontiguousarray(made.arm.robot.joints_from_readings(readings))
    missed = made.arm.true_position(readings) - chain.position(values, parameters)
    return Trace(missed * MM_PER_METRE, parameters)


def scheme_chain(made: Experiment, scheme: Scheme) -> Chain:
    """The chain from the base, as a row, to the point that a scheme predicts."""
    end = np.eye(4)
    end[:3, 3] = scheme.point_in_flange
    return made.identified.chain(made.arm.robot.flange @ end)


def sizes(errors_mm: Floats) -> dict[str, float]:
    """Mean, RMS and largest of lengths (n,)."""
    rms = float(np.sqrt(np.square(errors_mm).mean()))
    return {"mean_mm": float(errors_mm.mean()), "rms_mm": rms, "max_mm": float(errors_mm.max())}


def along(made: Experiment, found: Trace, readings: Floats) -> dict[str, float]:
    """Sizes along a path, and jumps between its neighbouring points.

    jump_mm is the largest change of the error vector, cep_jump that of a CEP for each mm of path (angles at
    300 mm).
    """
    step_mm = MM_PER_METRE * np.linalg.norm(np.diff(made.arm.robot.position(readings), axis=0), axis=1)
    ceps = scaled_ceps(found.parameters).reshape(len(readings), -1)
    change = np.abs(np.diff(ceps, axis=0)).max(axis=1) / step_mm
    jump = np.linalg.norm(np.diff(found.errors_mm, axis=0), axis=1)
    return {**sizes(found.size_mm), "jump_mm": float(jump.max()), "cep_jump": float(change.max())}


def scaled_ceps(parameters: Floats) -> Floats:
    """Parameters (n, L, 5) in mm, angles at 300 mm."""
    scale = np.full(KIND_COUNT, ANGLE_ARM_M)
    scale[[A, D]] = 1.0
    return np.asarray(parameters * (scale * MM_PER_METRE))


def over_seeds(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Results of several seeds as one: each number as its median, 5 % and 95 % quantile."""
    first = results[0]
    return {
        key: over_seeds([result[key] for result in results])
        if isinstance(first[key], Mapping)
        else quantiles([float(result[key]) for result in results])
        for key in first
    }


def quantiles(values: Sequence[float]) -> dict[str, float]:
    """Median, 5 % and 95 % quantile."""
    p05, median, p95 = np.quantile(values, [0.05, 0.5, 0.95])
    return {"median": float(median), "p05": float(p05), "p95": float(p95)}
