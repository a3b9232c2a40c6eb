"""The calibration after an update: offsets and set-ups are new, all else is as it was."""

from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from truearm.calibration import Calibration
from truearm.certainty.standard_errors import of_covariance
from truearm.certainty.uncertainty import UpdatedSpread
from truearm.errors import Notice, in_json
from truearm.fits.details import ConstantDetails
from truearm.fits.fitted_rows import TRAINED, FittedRows, farthest_m
from truearm.fits.models import NOMINAL, ArmModel
from truearm.judgement.held_rows import HeldRows
from truearm.judgement.judging import judge
from truearm.judgement.validation import RowErrors, Validation
from truearm.revision import Carried, Revision
from truearm.types import Floats
from truearm.updating.carrying import carried
from truearm.updating.estimating import Estimate
from truearm.updating.kept_parts import KeptParts
from truearm.updating.scene import Scene
from truearm.updating.validating import setup_of


def updated(
    kept: KeptParts,
    found: Estimate,
    judged: Mapping[str, RowErrors],
    report: Mapping[str, Any],
    notices: tuple[Notice, ...],
) -> Calibration:
    """The calibration with what was found put in.

    Args:
        kept: The calibration as it was, the measurements, all of which were used, and what stays of what was
            not measured.
        found: Values of the unknowns.
        judged: Errors of each model at poses that were left out in turn.
        report: What the update said.
        notices: What it warned of.
    """
    calibration, scene = kept.calibration, kept.scene
    task, unknowns = scene.task, scene.unknowns
    change = (unknowns.directions @ found.state.arm).reshape(-1, 5)
    models = {name: _model(calibration, scene, found, name, change) for name in calibration.models}
    fitted = judge(task, models, scene.data, scene.data)
    file = calibration.to_bytes() if calibration.file is None else calibration.file
    former = {**calibration.validation.to_dict(), "notices": in_json(calibration.notices)}
    report = {**report, "former": former}
    revision = Revision.of(report, unknowns.directions, kept.covariance(found.covariance), file)
    errors = kept.carried(carried(scene, found))
    if calibration.variable is not None:
        revision = replace(revision, carried=errors)
    new = replace(
        calibration,
        groups=tuple(task.groups),
        selection=kept.selection,
        measured=kept.measured,
        models={
            name: replace(model, setup=kept.setup(model.setup, calibration.models[name].setup))
            for name, model in models.items()
        },
        constant=_constant(calibration, scene, errors),
        validation=Validation(
            n_train=len(scene.data),
            n_train_poses=scene.pose_count,
            n_holdout=len(scene.data),
            n_holdout_poses=scene.pose_count,
            holdout={name: errors.statistics() for name, errors in judged.items()},
            train={name: errors.statistics() for name, errors in fitted.items()},
            left_out=True,
        ),
        rows=_rows(scene, found, kept),
        held=HeldRows.of(scene.data, judged),
        data_hash=scene.data.hash(),
        version=version("truearm"),
        notices=notices,
        seconds={},
        stored_conservative=None,
        fitted_spread=None,
        revision=revision,
        file=None,
    )
    if calibration.variable is None:
        return new
    return replace(new, fitted_spread=UpdatedSpread.of(new, calibration.spread))


def noted(new: Calibration, told: Mapping[str, Any], notices: tuple[Notice, ...]) -> Calibration:
    """An updated calibration with what is said of it once it is there, and all its notices."""
    revision = new.revision
    if revision is None:
        return new
    said = replace(revision, report={**revision.report, **told, "notices": in_json(notices)})
    return replace(new, notices=notices, revision=said)


def _model(calibration: Calibration, scene: Scene, found: Estimate, name: str, change: Floats) -> ArmModel:
    """A model in the new set-ups; those of others than the one that predicts are fitted to the same rows."""
    old = calibration.models[name]
    constants = old.constants if name == NOMINAL else old.constants + change
    model = ArmModel(np.ascontiguousarray(constants), old.setup, old.field, old.scheme)
    if name == calibration.model_name:
        return replace(model, setup=found.state.setup)
    passing = scene.in_passing(np.zeros_like(found.state.arm) if name == NOMINAL else found.state.arm)
    return replace(model, setup=setup_of(model, scene, passing))


def _constant(calibration: Calibration, scene: Scene, errors: Carried) -> ConstantDetails:
    """Details of the constants whose covariance is that of old and new offsets together, and of the set-ups.

    Offsets that were held are no constants for that. What standard errors hold beside the covariance stays.
    """
    old, asked = calibration.constant, calibration.arm.candidates
    column_of = dict(zip(asked.names, asked.columns, strict=True))
    before = [column_of[name] for name in old.names]
    directions, free = scene.unknowns.directions, scene.unknowns.free
    found = directions[:, free[: directions.shape[1]]]
    moved = set(np.flatnonzero(np.abs(found).sum(axis=1)).tolist())
    columns = [column for column in asked.columns if column in before or column in moved]
    places = [columns.index(column) for column in before]
    known = _carried_over(old.covariance, errors, before, columns, directions)
    beyond = np.zeros(len(columns))
    beyond[places] = np.square(old.standard_errors) - np.diagonal(old.covariance)[: len(before)]
    return replace(
        old,
        names=tuple(asked.names[asked.columns.index(column)] for column in columns),
        covariance=known,
        standard_errors=np.hypot(np.sqrt(np.maximum(beyond, 0.0)), of_covariance(known, len(columns))),
    )


def _carried_over(
    covariance: Floats, errors: Carried, before: list[int], columns: list[int], directions: Floats
) -> Floats:
    """Covariance (c + S, c + S) of constants in c columns and of the new set-ups, from (b + S', b + S')."""
    rows = errors.response.shape[1]
    shown = np.concatenate([errors.jacobian[:, :, before], errors.setup], axis=2).reshape(rows, -1)
    found = block_diag(directions[columns], np.eye(len(errors.tied)))
    kept = np.equal.outer(columns, before).astype(np.float64)
    stays = block_diag(kept, errors.tied) - found @ errors.response @ shown
    return np.asarray(stays @ covariance @ stays.T + found @ errors.own @ found.T)


def _rows(scene: Scene, found: Estimate, kept: KeptParts) -> FittedRows:
    left = np.zeros(scene.seen.shape)
    left[scene.seen] = found.linear.residual
    data, residual = kept.rows(scene.data, left)
    return FittedRows(
        data,
        np.full(len(scene.data), TRAINED, dtype=np.int64),
        np.ones(len(scene.data)),
        residual,
        np.zeros(len(scene.data)),
        farthest_m(residual, kept.selection),
        orientation=kept.selection.orientation,
    )
