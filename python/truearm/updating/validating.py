"""What each model misses at a pose when all that an update estimates is found from the other poses."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import Setup
from truearm.calibration import Calibration
from truearm.fits.fitting import fit_setup
from truearm.fits.models import NOMINAL, ArmModel
from truearm.judgement.judging import model_inputs
from truearm.judgement.validation import RowErrors, at_first_measured, row_errors
from truearm.types import Floats, Mask
from truearm.updating.estimating import Estimate, folds, left_out
from truearm.updating.scene import Scene

TURN: Final = 3


def left_out_errors(calibration: Calibration, scene: Scene, found: Estimate) -> dict[str, RowErrors]:
    """Errors of all models in each row of an update, whose pose had no part in what they were found from.

    Args:
        calibration: As it was.
        scene: The measurements, n rows.
        found: Values of the unknowns from all poses.
    """
    own = errors_at_left_out(scene, found, scene.unknowns.free)
    return {
        name: own if name == calibration.model_name else _others(name, model, scene, found)
        for name, model in calibration.models.items()
    }


def errors_at_left_out(scene: Scene, found: Estimate, free: NDArray[np.bool_]) -> RowErrors:
    """Errors of the model that predicts: of the first target that each row holds, and of the orientation."""
    left = np.full(scene.seen.shape, np.nan)
    left[scene.seen] = left_out(found, scene.unknowns.std, free)
    turned = left[:, -TURN:] if scene.task.selection.orientation else None
    return RowErrors(at_first_measured(left, scene.data, scene.task.selection), turned)


def _others(name: str, model: ArmModel, scene: Scene, found: Estimate) -> RowErrors:
    """Errors of a model that does not predict: its frame and tool, and its offsets but for the nominal
    model's, are found from the other poses.
    """
    task, data, unknowns = scene.task, scene.data, scene.unknowns
    position = np.full((len(data), TURN), np.nan)
    turned = np.full((len(data), TURN), np.nan)
    for poses, step in folds(found, unknowns.std, unknowns.free):
        out = np.isin(scene.poses, poses)
        change = np.zeros(len(unknowns.arm_names))
        if name != NOMINAL:
            change = found.state.arm + step[: len(change)]
        constants = model.constants + (unknowns.directions @ change).reshape(-1, 5)
        shifted = ArmModel(np.ascontiguousarray(constants), model.setup, model.field, model.scheme)
        passing, judged = scene.in_passing(change), data.select(out)
        setup = setup_of(shifted, scene, passing, ~out)
        at = shifted.parameters(model_inputs(task.arm, judged, task.options.features)) + passing[out]
        missed = row_errors(task.arm, judged, task.selection, task.groups, at, setup)
        position[out] = missed.position
        if missed.orientation is not None:
            turned[out] = missed.orientation
    return RowErrors(position, turned if task.selection.orientation else None)


def setup_of(model: ArmModel, scene: Scene, passing: Floats, rows: Mask | slice = slice(None)) -> Setup:
    """Frames and tools of a model that some rows of an update find, all without an argument.

    `passing` is how parameters (n, L, 5) of all rows differ by what is no constant.
    """
    task, data = scene.task, scene.data.select(rows)
    at = model.parameters(model_inputs(task.arm, data, task.options.features)) + passing[rows]
    return fit_setup(task, data, at).setup
