"""The calibration after an update: offsets and set-ups are new, all else is as it was."""

from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truearm.calibration import Calibration
from truearm.details import ConstantDetails
from truearm.fitted_rows import TRAINED, FittedRows
from truearm.held_rows import HeldRows
from truearm.judging import judge
from truearm.measured_parts import MeasuredParts
from truearm.models import NOMINAL, ArmModel
from truearm.revision import Revision
from truearm.standard_errors import of_covariance
from truearm.uncertainty import UpdatedSpread
from truearm.updating.estimating import Estimate
from truearm.updating.scene import Scene
from truearm.updating.validating import setup_of
from truearm.validation import RowErrors, Validation

Floats = NDArray[np.float64]


def updated(
    calibration: Calibration,
    scene: Scene,
    found: Estimate,
    judged: Mapping[str, RowErrors],
    report: Mapping[str, Any],
) -> Calibration:
    """The calibration with what was found put in.

    Args:
        calibration: As it was.
        scene: The measurements, all of which were used.
        found: Values of the unknowns.
        judged: Errors of each model at poses that were left out in turn.
        report: What the update said.
    """
    task, unknowns = scene.task, scene.unknowns
    change = (unknowns.directions @ found.state.arm).reshape(-1, 5)
    models = {name: _model(calibration, scene, found, name, change) for name in calibration.models}
    fitted = judge(task, models, scene.data, scene.data)
    file = calibration.to_bytes() if calibration.file is None else calibration.file
    report = {**report, "former": calibration.validation.to_dict()}
    revision = Revision.of(report, unknowns.directions, found.covariance, file)
    new = replace(
        calibration,
        groups=tuple(task.groups),
        selection=task.selection,
        measured=MeasuredParts.of(scene.data, task.selection, task.groups),
        models=models,
        constant=_constant(calibration, scene, found),
        validation=Validation(
            n_train=len(scene.data),
            n_train_poses=len(scene.data),
            n_holdout=len(scene.data),
            n_holdout_poses=len(scene.data),
            holdout={name: errors.statistics() for name, errors in judged.items()},
            train={name: errors.statistics() for name, errors in fitted.items()},
            left_out=True,
        ),
        rows=_rows(scene, found),
        held=HeldRows.of(scene.data, judged),
        data_hash=scene.data.hash(),
        version=version("truearm"),
        notices=(),
        seconds={},
        stored_conservative=None,
        fitted_spread=None,
        revision=revision,
        file=None,
    )
    if calibration.variable is None:
        return new
    return replace(new, fitted_spread=UpdatedSpread.of(new, calibration.spread))


def _model(calibration: Calibration, scene: Scene, found: Estimate, name: str, change: Floats) -> ArmModel:
    """A model in the new set-ups; those of others than the one that predicts are fitted to the same rows."""
    old = calibration.models[name]
    constants = old.constants if name == NOMINAL else old.constants + change
    model = ArmModel(np.ascontiguousarray(constants), old.setup, old.field, old.scheme)
    if name == calibration.model_name:
        return replace(model, setup=found.state.setup)
    return replace(model, setup=setup_of(model, scene, scene.data))


def _constant(calibration: Calibration, scene: Scene, found: Estimate) -> ConstantDetails:
    """Details of the constants whose covariance holds that of the new offsets, and of the new set-ups."""
    old, arm = calibration.constant, calibration.arm
    before = [
        c for c, name in zip(arm.candidates.columns, arm.candidates.names, strict=True) if name in old.names
    ]
    directions, count = scene.unknowns.directions, len(scene.unknowns.arm_names)
    moved = np.flatnonzero(np.abs(directions).sum(axis=1))
    asked = dict(zip(arm.candidates.columns, arm.candidates.names, strict=True))
    columns = sorted(set(before) | {int(c) for c in moved if int(c) in asked})
    whole = np.zeros((len(columns) + len(found.covariance) - count,) * 2)
    places = [columns.index(c) for c in before]
    whole[np.ix_(places, places)] = old.covariance[: len(before), : len(before)]
    carry = np.zeros((len(whole), len(found.covariance)))
    carry[: len(columns), :count] = directions[columns]
    carry[len(columns) :, count:] = np.eye(len(found.covariance) - count)
    carried = carry @ found.covariance @ carry.T
    errors = np.zeros(len(columns))
    errors[places] = old.standard_errors
    return replace(
        old,
        names=tuple(asked[c] for c in columns),
        covariance=whole + carried,
        standard_errors=np.hypot(errors, of_covariance(carried, len(columns))),
    )


def _rows(scene: Scene, found: Estimate) -> FittedRows:
    residual = np.zeros(scene.seen.shape)
    residual[scene.seen] = found.linear.residual
    return FittedRows(
        scene.data,
        np.full(len(scene.data), TRAINED, dtype=np.int64),
        np.ones(len(scene.data)),
        residual,
        np.zeros(len(scene.data)),
        np.linalg.norm(residual[:, :3], axis=1),
        orientation=scene.task.selection.orientation,
    )
