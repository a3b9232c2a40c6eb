"""Whether a calibration can be updated with measurements, and what is found is believed."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.doubts.of_results import LARGE_MM
from truearm.errors import InputError, Notice, TooFewError, UsageError, WorkError, count_of, list_names
from truearm.fits.core_set import select_fitted
from truearm.fits.enough_values import measured_values
from truearm.fits.fitting import Task
from truearm.judgement.validation import mean_distance
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.rows.visits import pose_count
from truearm.solving import FEATURE_RANGE
from truearm.stages import Stages
from truearm.storage.summary import noise_mm
from truearm.update_words import way_out_of_keeping
from truearm.updating.estimating import MOST_PARTS, Estimate
from truearm.updating.options import UpdateOptions
from truearm.updating.scene import Scene
from truearm.updating.unknowns import Unknowns

FOUND_FROM: Final = 3
"""Poses of a set-up that find its frame and target when others are left out."""
IMPLAUSIBLE: Final = 5.0
"""An estimate of an offset so many standard deviations off, of what the prior lets it be, is not believed."""


def task_of_update(
    calibration: Calibration, data: Measurements, options: UpdateOptions, stages: Stages
) -> tuple[Task, list[Notice]]:
    """What is compared, and a notice of what is not."""
    if calibration.scheme is not None:
        raise WorkError(
            f"this calibration is of the scheme {calibration.model_name}",
            rule="An update needs standard deviations, and schemes do not tell them",
            way_out="Calibrate with --model variable or constant",
        )
    _check_of_use(calibration)
    where = ", ".join(data.files)
    selection, left_out = select_fitted(data, options.use, calibration.selection)
    if selection.distances or calibration.selection.distances:
        raise InputError("distances were measured, not points", where=where, rule="An update needs points")
    if calibration.arm.world_is_known and len(data.groups) > 1:
        raise InputError(f"there are {len(data.groups)} set-ups", where=where, rule="The world is one")
    task = Task(calibration.arm, selection, data.groups, calibration.options, stages=stages)
    return task, left_out


def check_kept(calibration: Calibration, task: Task, unknowns: Unknowns, options: UpdateOptions) -> None:
    """Raise UsageError where something is to be kept that the calibration does not know."""
    kept = ("keep_tool",) if task.arm.world_is_known else ("keep_frame", "keep_tool")
    asked = [name for name in kept if getattr(options, name)]
    strange = [g for g, known in zip(task.groups, unknowns.known, strict=True) if known is None]
    if asked and strange:
        raise UsageError(
            f"the calibration knows no frame and tool of set-up {list_names(strange)} that could be kept",
            rule=f"It knows {list_names(calibration.groups)}, with what was measured there",
            way_out='Name the set-up that is meant in a column "group", or leave '
            f"{' and '.join('--' + name.replace('_', '-') for name in asked)} out",
        )


def check_scale(calibration: Calibration, options: UpdateOptions) -> None:
    """Raise UsageError where a scale is to be taken along that no constants hold."""
    if options.take_scale and "prismatic" in calibration.robot.joints:
        raise UsageError(
            "a joint of this arm slides",
            where="take_scale",
            rule="What a rail slides is no length of the table, and cannot be scaled",
            way_out="Leave --take-scale out, and calibrate anew if the arm works at another temperature",
        )


def check_enough(data: Measurements, task: Task, unknowns: Unknowns) -> None:
    """Raise TooFewError where there are not more measured values than unknowns."""
    values, wanted = measured_values(task, data), int(unknowns.free.sum())
    if values > wanted:
        return
    count = pose_count(data)
    per_pose = max(values // max(count, 1), 1)
    raise TooFewError(
        f"{values} measured values in {count_of(count, 'pose')} cannot tell {wanted} unknowns of "
        "offsets, frame and tool",
        where=", ".join(data.files),
        rule="There must be more measured values than unknowns",
        way_out=f"Measure at least {wanted // per_pose + 1} poses; 10 to 20 are a good number: "
        "truearm plan --acceptance 15 --from CALIB",
    )


def check_groups(data: Measurements, task: Task) -> None:
    """Each pose is judged by the others: they have to find its frame and target."""
    fewest = FOUND_FROM + -(-pose_count(data) // MOST_PARTS)
    seen = data.seen(task.selection.targets).any(axis=1)
    for group in task.groups:
        count = pose_count(data.select(seen & (data.group == group)))
        if count < fewest:
            raise TooFewError(
                f"{count_of(count, 'pose')} of set-up {list_names([group])}",
                where=", ".join(data.files),
                rule=f"An update needs at least {fewest} of each, outliers not counted",
                way_out="Measure more poses there, or leave the set-up out",
            )


def check_plausible(scene: Scene, found: Estimate, notices: Sequence[Notice]) -> None:
    """Raise WorkError where an offset is too far off for what may have moved, as far as the poses tell it."""
    own = slice(scene.task.arm.robot.joint_count)
    std, change = scene.unknowns.std[own], np.abs(found.state.arm[own])
    variance = np.maximum(std**2 - np.diag(found.covariance)[own], np.finfo(np.float64).tiny)
    surprise = change / np.sqrt(variance)
    wild = int(np.argmax(surprise))
    if surprise[wild] > IMPLAUSIBLE:
        times = change[wild] * std[wild] / variance[wild]
        kept = way_out_of_keeping(scene.unknowns.kept)
        check = f"{kept}; check" if kept else "Check"
        guessed = "".join(f"{notice} " for notice in notices if notice.kind == FEATURE_RANGE)
        raise WorkError(
            f"joint {wild + 1} would be off by {times:.0f} times what is allowed for",
            where=", ".join(scene.data.files),
            rule=f"Up to {IMPLAUSIBLE:g} times --offset-deg is believed",
            way_out=f"{guessed}{check} that these are measurements of this arm; after a larger change give a "
            "larger --offset-deg",
        )


def _check_of_use(calibration: Calibration) -> None:
    """Raise WorkError where a calibration is so far off that nothing is unlike what it expects."""
    (missed_mm, how), left_mm = _missed_mm(calibration), mean_distance(noise_mm(calibration), distances=False)
    if max(missed_mm, left_mm) < LARGE_MM:
        return
    said = f"leaves {length_mm(left_mm, 3)} of the rows that it was fitted to on average"
    if missed_mm >= LARGE_MM:
        said = f"misses {calibration.validation.judged} rows of its own by {length_mm(missed_mm, 3)} {how}"
    raise WorkError(
        f"this calibration {said}",
        rule="It expects so little that no measurements are unlike it",
        way_out="Calibrate anew when the reason is found: truearm report CALIB names what to check",
    )


def _missed_mm(calibration: Calibration) -> tuple[float, str]:
    """What a calibration misses its held-out rows by, and how that is told: single ones may be far off, so by
    the median where the file has them.
    """
    name, held = calibration.model_name, calibration.held
    if held is None:
        return calibration.validation.holdout[name].position.mean, "on average"
    return held.median_mm(name), "in the median"
