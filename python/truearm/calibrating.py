"""From measurements to a calibration: split, fit, validate, and fit to all rows."""

from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm import kinds
from truearm.calibration import Calibration
from truearm.certainty.standard_errors import constant_details
from truearm.certainty.uncertainty import SetupPlace, VariableSpread, noises_of
from truearm.doubts.admitted import admitted
from truearm.doubts.masked_rows import judged_unbent
from truearm.doubts.of_calibration import of_fit, of_result, of_split
from truearm.doubts.of_results import orientations_left_out, seen_at_values, stood_still
from truearm.doubts.row_order import order_notices
from truearm.doubts.turning_sense import check_turns
from truearm.doubts.unexplained import unexplained
from truearm.drifting import Drift, drift_details, drift_notices, fit_settled
from truearm.errors import InputError, Notice, UsageError, count_of
from truearm.fits.core_set import anchor_names, distance_count, distance_ends, select
from truearm.fits.details import ConstantDetails, VariableDetails, left_m
from truearm.fits.fitted_rows import FittedRows, sides
from truearm.fits.fitting import (
    ENOUGH_FOR_HYPER,
    NOTHING_KNOWN,
    Fits,
    KnownHyper,
    Task,
    feature_ranges,
    feature_values,
    fit_rows,
)
from truearm.fits.identified import IdentifiedArm
from truearm.fits.measured_parts import MeasuredParts, sureness
from truearm.fits.models import NOMINAL, VARIABLE
from truearm.fits.options import CalibrationOptions
from truearm.fits.scheme_options import SchemeOptions
from truearm.fits.schemes import NETWORKS, REGIONS
from truearm.intervals import interval_coverage
from truearm.judgement.held_rows import HeldRows
from truearm.judgement.judging import judge, where_found
from truearm.judgement.validation import Validation
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.rows.splitting import Split, split_rows
from truearm.rows.visits import pose_count, pose_counts
from truearm.stages import Stages, no_stages
from truearm.tables.columns import VALIDATE
from truearm.units import MM_PER_METRE

STUCK: Final = 0.2
"""Ratio of what constants leave below which those of the training rows were no minimum to judge."""
ASTRAY: Final = 2.0
"""Ratio of the median errors of held-out rows, known and not, from which a fit went astray."""
REFIT_ASTRAY: Final = "refit_astray"


def calibrate(
    robot: Robot,
    data: Measurements | Sequence[Measurements],
    options: CalibrationOptions | None = None,
    *,
    threads: int | None = None,
    stages: Stages | None = None,
    **more: Any,
) -> Calibration:
    """Calibrate an arm: fit to training rows, judge on held-out rows, then fit to all rows.

    Args:
        robot: The nominal arm.
        data: What was measured.
        options: How to calibrate; the command line's defaults without them.
        threads: Threads at the most; the result does not depend on it.
        stages: Called with the name of each stage; gives a context manager that surrounds it; None
            for nobody.
        **more: The same options as keywords, such as model="constant", train_size=400 or seed=1.

    Raises:
        UsageError: If options contradict each other or the data.
        InputError: If the data cannot be of this arm, or cannot be split as asked for.
        WorkError: If the rows determine too little.
    """
    chosen = kinds.chosen(CalibrationOptions, options, more, CalibrationOptions.of)
    robot, stages = kinds.required(robot, Robot, "the robot"), stages or no_stages
    given, notices = admitted(Measurements.of(data), robot)
    notices += [*stood_still(robot, given.readings), *seen_at_values(robot, given.readings)]
    task = _task(robot, given, chosen, threads, stages)
    notices += orientations_left_out(given, task.selection, chosen.use)
    split = split_rows(given, chosen.split)
    notices += of_split(task, given, split)
    task = replace(task, sizes=() if split.planned else pose_counts(given))
    order = np.random.default_rng(chosen.split.seed).permutation(len(given)) if chosen.refit else split.train
    trained, drift, final = _fit_both(task, given, split.train, order)
    with stages("judging on held-out rows"):
        validation, held = _validate(task, trained, drift, (given, split))
        astray = _astray(task, (trained, final), drift.taken_out(given).select(split.holdout), held)
    if astray:
        final, order = trained, split.train
    constant, variable, measured = _details(task, final, trained if _keeps_hyper(trained) else final)
    found = Calibration(
        robot=robot,
        options=chosen,
        groups=tuple(task.groups),
        selection=task.selection,
        measured=measured,
        models=final.models(task.arm),
        identifiability=final.identifiability,
        constant=constant,
        variable=variable,
        validation=validation,
        held=held,
        rows=_fitted_rows(task, final, drift, (given, order, split)),
        data_hash=given.hash(),
        version=version("truearm"),
        scheme=None if final.scheme is None else final.scheme.details,
        notices=(
            *notices,
            *astray,
            *of_fit(task, final, variable),
            *_over_time(task, given, drift, validation),
        ),
        seconds=trained.seconds,
        fitted_spread=_fitted_spread(task, final, variable, measured),
    )
    told = of_result(task, found, (given, drift.progress[order]), stages)
    return replace(found, notices=(*found.notices, *told))


def _over_time(task: Task, data: Measurements, drift: Drift, judged: Validation) -> list[Notice]:
    """What the order of the rows tells and hides."""
    return [*order_notices(task, data, drift.progress), *drift_notices(judged.drift)]


def _task(
    robot: Robot, data: Measurements, options: CalibrationOptions, threads: int | None, stages: Stages
) -> Task:
    _check_train_on(options)
    selection = select(data, options.use, options.judge_target)
    where = ", ".join(data.files)
    if selection.orientation:
        check_turns(data, robot)
    if selection.distances and options.model == "variable":
        raise UsageError(
            "the measurements are distances alone",
            where=where,
            rule="Only the constant model is built for distances, the variable one is not",
            way_out="Give --model constant (model='constant')",
        )
    if options.frame == "world" and len(data.groups) > 1:
        raise InputError(
            f"there are {len(data.groups)} set-ups",
            where=where,
            rule="With the world as frame the base is part of the arm, so there can be one set-up only",
            way_out="Calibrate from one of them, or leave --frame out",
        )
    _check_features(data, options.features)
    arm = IdentifiedArm(robot, options.frame, options.parallel_within_deg)
    anchors = anchor_names(data) if selection.distances else []
    return Task(arm, selection, data.groups, options, threads, stages, anchors=anchors)


def _check_train_on(options: CalibrationOptions) -> None:
    if options.model == REGIONS and options.scheme.train_on != SchemeOptions.train_on:
        raise UsageError(
            f'"{options.scheme.train_on}" with the model {REGIONS}',
            where="train_on",
            rule="Networks are trained, regions are not",
            way_out=f"Leave it out, or --model {' or '.join(NETWORKS)}",
        )


def _check_features(data: Measurements, names: Sequence[str]) -> None:
    """Raise InputError where a feature is missing, empty in a row, or the same in all rows."""
    for name, values in zip(names, feature_values(data, names).T, strict=True):
        if np.ptp(values) == 0.0:
            raise InputError(
                f'the feature "{name}" is {values[0]:g} in all rows',
                where=", ".join(data.files),
                rule="What parameters are to vary with has to vary",
                way_out="Measure over its range, or leave it out",
            )


def _validate(
    task: Task, trained: Fits, drift: Drift, given: tuple[Measurements, Split]
) -> tuple[Validation, HeldRows]:
    """Errors of the fits without the drift; `given` are all rows as they were measured, and the split."""
    data, split = given
    models = trained.models(task.arm)
    held = where_found(trained.data, drift.taken_out(data).select(split.holdout), task.selection)
    errors = judge(task, models, held, trained.data)
    on_training = judge(task, models, trained.data, trained.data)
    judged = held if task.selection.distances else held.select(errors[NOMINAL].measured)
    validation = Validation(
        n_train=len(trained.data),
        n_train_poses=pose_count(trained.data),
        n_holdout=len(judged),
        n_holdout_poses=pose_count(judged),
        n_holdout_distances=distance_count(held) if task.selection.distances else None,
        n_planned=_planned(judged) if split.planned else 0,
        holdout={name: found.statistics() for name, found in errors.items()},
        train={name: found.statistics() for name, found in on_training.items()},
        coverage_95=interval_coverage(task, trained, held),
        drift=drift_details(task, trained, drift, (data, split.holdout, errors)),
    )
    by_row = errors
    if task.selection.distances:
        ends = distance_ends(held)[:, 0]
        by_row = {name: found.at_rows(ends, len(held)) for name, found in errors.items()}
    return validation, HeldRows.of(held, by_row)


def _planned(judged: Measurements) -> int:
    """How many rows were planned to validate."""
    return 0 if judged.purpose is None else int(np.sum(judged.purpose == VALIDATE))


def _fitted_rows(
    task: Task, final: Fits, drift: Drift, given: tuple[Measurements, NDArray[np.int64], Split]
) -> FittedRows:
    """The rows of the last fit as they were measured; `given` are all rows, which of them, and the split."""
    data, order, split = given
    rows = FittedRows.of(task, final, sides(len(data), split)[order])
    rows = judged_unbent(task, rows, final)
    if not drift:
        return rows
    return replace(rows, data=data.select(order), moved=drift.moved[order], progress=drift.progress[order])


def _fitted_spread(
    task: Task, fits: Fits, details: VariableDetails | None, measured: MeasuredParts
) -> VariableSpread | None:
    """The posterior of the field's fit, which a large set would take long to find again."""
    if fits.variable is None or details is None:
        return None
    columns = list(task.arm.candidates.columns)
    noises, place = noises_of(details.hyper), SetupPlace.of(task, measured)
    return VariableSpread(columns, fits.variable.posterior, details.inflation, noises, place)


def _measured(task: Task, fits: Fits, left: float) -> MeasuredParts:
    """What the rows of each set-up hold of what was fitted, of which the model leaves so much, m."""
    sure = sureness(fits.data.stated_sigma_m, left, (fits.variable or fits.constant).weights)
    return MeasuredParts.of(fits.data, task.selection, task.groups, sure)


def _fit_both(
    task: Task, data: Measurements, train: NDArray[np.int64], order: NDArray[np.int64]
) -> tuple[Fits, Drift, Fits]:
    """The fits to the training rows, their drift, and the fits to the rows in order."""
    trained, drift = fit_settled(task, data, train)
    if order is train:
        return trained, drift, trained
    final = _fit_all(task, trained, (drift.taken_out(data), train, order))
    if final.constant.noise[0] < STUCK * trained.constant.noise[0]:
        trained, drift = fit_settled(_begun_at(task, final), data, train)
        final = _fit_all(task, trained, (drift.taken_out(data), train, order))
    return trained, drift, final


def _fit_all(
    task: Task, trained: Fits, rows: tuple[Measurements, NDArray[np.int64], NDArray[np.int64]]
) -> Fits:
    """The fits to all rows; neither constants nor outliers are lost that the training rows found.

    `rows` are all rows, which of them trained, and the order of the fit. Hyper-parameters are found again
    where few rows trained, and not without those that were validated: a search may end at a lesser maximum.
    """
    known, (data, train, order) = NOTHING_KNOWN, rows
    if trained.variable is not None and _keeps_hyper(trained):
        known = KnownHyper(trained.variable.hyper)
    elif trained.variable is not None:
        suspected = np.zeros(len(data), dtype=np.bool_)
        suspected[train] = trained.variable.weights < 1.0
        known = KnownHyper(near=trained.variable, contested=True, suspected=suspected[order])
    return fit_rows(_begun_at(task, trained), data.select(order), known)


def _begun_at(task: Task, fits: Fits) -> Task:
    """The task where constants are looked for near those of fits as well."""
    return replace(task, starts=(fits.constant,))


def _keeps_hyper(trained: Fits) -> bool:
    """Whether hyper-parameters of the training rows serve all rows."""
    return trained.variable is not None and len(trained.data) >= ENOUGH_FOR_HYPER


def _astray(task: Task, fits: tuple[Fits, Fits], held: Measurements, judged: HeldRows) -> list[Notice]:
    """A notice where the fit to all rows misses held-out rows by far more than one that did not know them."""
    trained, final = fits
    if final is trained or final.variable is None or not len(held):
        return []
    found = judge(task, {VARIABLE: final.models(task.arm)[VARIABLE]}, held, trained.data)
    before, after = (
        float(MM_PER_METRE * np.nanmedian(errors[VARIABLE].distance_m)) for errors in (judged.errors, found)
    )
    if after <= ASTRAY * before:
        return []
    text = (
        f"Fitted to all rows the variable model misses the held-out rows by {length_mm(after, 4)} in the "
        f"median, fitted to {count_of(len(trained.data), 'training row')} by {length_mm(before, 4)}: the "
        "calibration in the file stays that of the training rows. Look at the table of the robot, and for "
        "rows that are wrong."
    )
    return [Notice(REFIT_ASTRAY, text)]


def _details(
    task: Task, final: Fits, searched: Fits
) -> tuple[ConstantDetails, VariableDetails | None, MeasuredParts]:
    """More about both models, and what of what was fitted the set-ups measured."""
    constant, variable = constant_details(task, final), _variable_details(task, final, searched)
    return constant, variable, _measured(task, final, left_m(constant, variable))


def _variable_details(task: Task, final: Fits, searched: Fits) -> VariableDetails | None:
    if final.variable is None or searched.variable is None:
        return None
    values = feature_values(final.data, task.options.features)
    return VariableDetails(
        hyper=final.variable.hyper,
        evidence=searched.variable.evidence,
        evaluations=searched.evaluations,
        inflation=final.variable.inflation,
        unexplained_m=unexplained(task, final.variable, final.data),
        feature_ranges=tuple(feature_ranges(values)),
        feature_lowest=tuple(values.min(axis=0).tolist()),
    )
