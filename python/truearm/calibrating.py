"""From measurements to a calibration: split, fit, validate, and fit to all rows."""

from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm import kinds
from truearm.calibration import Calibration
from truearm.certainty.standard_errors import counted_covariance, standard_errors
from truearm.certainty.uncertainty import SetupPlace, VariableSpread, noises_of
from truearm.doubts.conventions import fits_otherwise
from truearm.doubts.distance_zero import zero_notices
from truearm.doubts.exchanged import exchanges
from truearm.doubts.known_world import another_frame
from truearm.doubts.moved_joints import moved_joints
from truearm.doubts.of_results import (
    FAR_FROM_NOMINAL,
    NO_HELP,
    SINGLE_ROWS,
    WOULD_FIT,
    constant_is_better,
    doubts,
    mounting,
    orientations_left_out,
    poses_aside,
    seen_at_values,
    stated_too_large,
    stood_still,
)
from truearm.doubts.outliers import EXCHANGED, NO_OUTLIERS, Outliers
from truearm.doubts.plausibility import check_against
from truearm.doubts.points_together import points_together
from truearm.doubts.rounded_readings import rounded_notices
from truearm.doubts.row_lag import CHANGE, fits_shifted
from truearm.doubts.row_order import order_notices
from truearm.doubts.turning_sense import check_turns
from truearm.doubts.unbent import may_be_bent, unbent
from truearm.doubts.uneven_setups import uneven_setups
from truearm.doubts.unexplained import unexplained
from truearm.doubts.whitened import Whitened
from truearm.drifting import Drift, drift_details, drift_notices, fit_settled
from truearm.errors import InputError, Notice, UsageError, count_of
from truearm.fits.core_set import select
from truearm.fits.details import ConstantDetails, VariableDetails, left_m
from truearm.fits.endpoints import at_tool
from truearm.fits.enough_values import group_unknowns
from truearm.fits.fitted_rows import FittedRows, sides
from truearm.fits.fitting import (
    ENOUGH_FOR_HYPER,
    NOTHING_KNOWN,
    Fits,
    KnownHyper,
    Stages,
    Task,
    feature_ranges,
    feature_values,
    fit_rows,
    no_stages,
)
from truearm.fits.identifiability import Identifiability
from truearm.fits.identified import IdentifiedArm
from truearm.fits.known_scale import KnownScale, common_share
from truearm.fits.measured_parts import MeasuredParts, sureness
from truearm.fits.models import CONSTANT, NOMINAL, VARIABLE, ArmModel
from truearm.fits.options import Options
from truearm.fits.scheme_options import SchemeOptions
from truearm.fits.schemes import NETWORKS, REGIONS
from truearm.intervals import interval_coverage
from truearm.judgement.held_rows import HeldRows
from truearm.judgement.judging import check_judged, judge, where_found
from truearm.judgement.validation import Validation
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.rows.splitting import Split, measured_on_both_sides, split_rows
from truearm.rows.visits import pose_count, pose_counts
from truearm.storage.summary import distance_at_floor_mm, whole_noise_mm
from truearm.tables.columns import VALIDATE
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]

STUCK: Final = 0.2
"""Ratio of what constants leave below which those of the training rows were no minimum to judge."""
ASTRAY: Final = 2.0
"""Ratio of the median errors of held-out rows, known and not, from which a fit went astray."""
REFIT_ASTRAY: Final = "refit_astray"
OPEN_SETUP: Final = "open_setup"
WRONG_ROWS: Final = {NO_HELP, SINGLE_ROWS, *EXCHANGED, *WOULD_FIT}
"""Notices of what spoils a fit, so that what it leaves of rows tells nothing else."""


def calibrate(
    robot: Robot,
    data: Measurements | Sequence[Measurements],
    options: Options | None = None,
    *,
    threads: int | None = None,
    stages: Stages = no_stages,
    **more: Any,
) -> Calibration:
    """Calibrate an arm: fit to training rows, judge on held-out rows, then fit to all rows.

    Args:
        robot: The nominal arm.
        data: What was measured.
        options: How to calibrate; the command line's defaults without them.
        threads: Threads at the most; the result does not depend on it.
        stages: Called with the name of each stage; gives a context manager that surrounds it.
        **more: The same options as keywords, such as model="constant", train_size=400 or seed=1.

    Raises:
        UsageError: If options contradict each other or the data.
        InputError: If the data cannot be of this arm, or cannot be split as asked for.
        WorkError: If the rows determine too little.
    """
    chosen = kinds.chosen(Options, options, more, Options.of)
    robot, given = kinds.required(robot, Robot, "the robot"), Measurements.of(data)
    notices = check_against(given, robot)
    given, together = points_together(given.deduplicated())
    notices += [*together, *stood_still(robot, given.readings), *seen_at_values(robot, given.readings)]
    task = _task(robot, given, chosen, threads, stages)
    notices += orientations_left_out(given, task.selection, chosen.use)
    split = split_rows(given, chosen.split)
    notices += _of_split(task, given, split)
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
            *_of_fit(task, final, variable),
            *_over_time(task, given, drift, validation),
        ),
        seconds=trained.seconds,
        fitted_spread=_fitted_spread(task, final, variable, measured),
    )
    told = _told(task, found, (given, drift.progress[order]), stages)
    return replace(found, notices=(*found.notices, *told))


def _told(task: Task, found: Calibration, given: tuple[Measurements, Floats], stages: Stages) -> list[Notice]:
    """What speaks against a calibration, and unless rows are wrong, what it leaves of them; `given` are all
    rows, and the progress of the fitted ones (n,).
    """
    data, progress = given
    told = _doubts(task, found, data, stages)
    if {notice.kind for notice in told} & WRONG_ROWS:
        return told
    return [*told, *_of_left(task, found, progress)]


def _of_left(task: Task, found: Calibration, progress: Floats) -> list[Notice]:
    """What is left of the rows tells beside noise; `progress` (n,) is that of the fitted rows."""
    rows = found.rows
    if rows is None or found.scheme is not None or found.selection.distances:
        return []
    if may_be_bent(found) and rows.outliers():
        found, rows = _unbent(task, found, rows)
    seen = Whitened.of(found, rows, progress)
    return [*uneven_setups(found, rows, seen), *moved_joints(found, rows, seen, progress)]


def _unbent(task: Task, found: Calibration, rows: FittedRows) -> tuple[Calibration, FittedRows]:
    """The calibration with constants that its outliers do not bend, and the rows as these have them."""
    fits = unbent(task, rows)
    constant, models = _constant_details(task, fits), fits.models(task.arm)
    told = replace(found, models=models, identifiability=fits.identifiability, constant=constant)
    return told, FittedRows.of(fits, rows.side, task.selection)


def _of_split(task: Task, given: Measurements, split: Split) -> list[Notice]:
    """Of which held-out rows errors say less, and which are not judged."""
    train, held = given.select(split.train), given.select(split.holdout)
    return [*measured_on_both_sides(given, split), *check_judged(train, held, task.selection)]


def _over_time(task: Task, data: Measurements, drift: Drift, judged: Validation) -> list[Notice]:
    """What the order of the rows tells and hides."""
    return [*order_notices(task, data, drift.progress), *drift_notices(judged.drift)]


def _doubts(task: Task, found: Calibration, data: Measurements, stages: Stages) -> list[Notice]:
    """What makes a calibration doubtful; where it does not help, or found another arm, with what would
    fit instead.
    """
    doubted, shifted = _of_errors(task, found, data, Outliers.of(found)), list[Notice]()
    if _many_are_off(found, doubted):
        with stages("looking for lost rows"):
            shifted = fits_shifted(task, data)
    if shifted:
        doubted = _of_errors(task, found, data, NO_OUTLIERS)
        return [*doubted[:1], *shifted, *doubted[1:]]
    framed = _framed(task, found)
    exchanged = exchanges(task, found, doubted=_is_in_doubt(doubted) and not framed)
    if exchanged.notices:
        told = replace(found, notices=exchanged.notices)
        doubted = _of_errors(task, told, data, Outliers.of(told), exchanged.unbent)
    doubted[1:1] = framed
    wrong = {FAR_FROM_NOMINAL} if exchanged.notices else {NO_HELP, FAR_FROM_NOMINAL}
    if not framed and any(notice.kind in wrong for notice in doubted):
        with stages("trying other conventions"):
            doubted[1:1] = fits_otherwise(task, data)
    return [*exchanged.notices, *doubted]


def _is_in_doubt(doubted: Sequence[Notice]) -> bool:
    """Whether errors or parameters are such that rows may be wrong of which none is an outlier."""
    return any(notice.kind in {NO_HELP, SINGLE_ROWS, FAR_FROM_NOMINAL} for notice in doubted)


def _framed(task: Task, found: Calibration) -> list[Notice]:
    """Whether rows of a known world would fit far better with a frame that is found."""
    left = left_m(found.constant, found.variable)
    return [] if found.rows is None else another_frame(task, found.rows.fitted, left)


def _of_errors(
    task: Task,
    found: Calibration,
    data: Measurements,
    outliers: Outliers,
    unbent: ArmModel | None = None,
) -> list[Notice]:
    """What the errors of a calibration say against it, and which outliers may be to blame.

    Constants that these did not bend are held against the table in place of its own, if there are such.
    """
    judged, best = found.validation, found.model_name
    points = None if found.selection.distances else found.held
    models = found.models if unbent is None else {**found.models, CONSTANT: unbent, best: unbent}
    return [
        *zero_notices(task, data, [found.models[name] for name in (NOMINAL, CONSTANT)]),
        *doubts(task.arm, models, judged, best, distance_at_floor_mm(found), outliers),
        *stated_too_large(data, judged, best, points, outliers),
        *constant_is_better(judged, best, points, outliers),
        *_rounded(found, data),
    ]


def _rounded(found: Calibration, data: Measurements) -> list[Notice]:
    """Whether readings have so few decimals that what is taken for noise is theirs."""
    points = found.measured.points(found.model.setup.targets)
    if found.selection.distances or not len(points):
        return []
    at_point = replace(found.robot, tool=at_tool(found.robot, points[0]))
    return rounded_notices(at_point, data.readings, whole_noise_mm(found))


def _many_are_off(found: Calibration, doubted: Sequence[Notice]) -> bool:
    """Whether so many rows are off, or off from some row on, that they may belong to other points."""
    drift, outliers = found.validation.drift, [] if found.rows is None else found.rows.outliers()
    of_no_use = any(notice.kind in {NO_HELP, SINGLE_ROWS} for notice in doubted)
    return of_no_use or len(outliers) > CHANGE or (drift is not None and bool(drift.jumps))


def _task(robot: Robot, data: Measurements, options: Options, threads: int | None, stages: Stages) -> Task:
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
    return Task(arm, selection, data.groups, options, threads, stages)


def _check_train_on(options: Options) -> None:
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
        n_planned=_planned(judged) if split.planned else 0,
        holdout={name: found.statistics() for name, found in errors.items()},
        train={name: found.statistics() for name, found in on_training.items()},
        coverage_95=interval_coverage(task, trained, held),
        drift=drift_details(task, trained, drift, (data, split.holdout, errors)),
    )
    return validation, HeldRows.of(held, errors)


def _planned(judged: Measurements) -> int:
    """How many rows were planned to validate."""
    return 0 if judged.purpose is None else int(np.sum(judged.purpose == VALIDATE))


def _fitted_rows(
    task: Task, final: Fits, drift: Drift, given: tuple[Measurements, NDArray[np.int64], Split]
) -> FittedRows:
    """The rows of the last fit as they were measured; `given` are all rows, which of them, and the split."""
    data, order, split = given
    rows = FittedRows.of(final, sides(len(data), split)[order], task.selection)
    if not drift:
        return rows
    return replace(rows, data=data.select(order), moved=drift.moved[order], progress=drift.progress[order])


def _of_fit(task: Task, final: Fits, variable: VariableDetails | None) -> list[Notice]:
    """What the last fit shows of the set-up and of how the arm stands."""
    aside = 0 if final.variable is None else final.variable.stood_aside
    return [
        *_open_setup(task, final.identifiability, final.data),
        *poses_aside(aside, pose_count(final.data)),
        *mounting(variable),
    ]


def _open_setup(task: Task, found: Identifiability, data: Measurements) -> list[Notice]:
    """A notice where frames and targets cannot all be told apart, as on a SCARA or from poses too alike."""
    if task.selection.distances:
        return []
    unknowns = sum(group_unknowns(task, data.select(data.group == group)) for group in task.groups)
    rank = found.total_rank - found.rank
    if rank >= unknowns:
        return []
    text = (
        f"The poses determine {rank} of {unknowns} unknowns of frame and target: predictions of the measured "
        "target are not harmed, but along what is left open neither the base's place in the world nor the "
        "target's on the flange is known, and corrections for other tools depend on that."
    )
    return [Notice(OPEN_SETUP, text)]


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
    fit, sigma = fits.variable or fits.constant, fits.data.sigma_m
    own = np.zeros(len(fits.data)) if sigma is None else np.nan_to_num(sigma)
    return MeasuredParts.of(fits.data, task.selection, task.groups, sureness(own, left, fit.weights))


def _fit_both(
    task: Task, data: Measurements, train: NDArray[np.int64], order: NDArray[np.int64]
) -> tuple[Fits, Drift, Fits]:
    """The fits to the training rows, their drift, and the fits to the rows in order."""
    trained, drift = fit_settled(task, data, train)
    if order is train:
        return trained, drift, trained
    final = _fit_all(task, trained, drift.taken_out(data).select(order))
    if final.constant.noise[0] < STUCK * trained.constant.noise[0]:
        trained, drift = fit_settled(_begun_at(task, final), data, train)
        final = _fit_all(task, trained, drift.taken_out(data).select(order))
    return trained, drift, final


def _fit_all(task: Task, trained: Fits, rows: Measurements) -> Fits:
    """The fits to all rows; constants are not lost that the training rows found.

    Hyper-parameters are found again where few rows trained, and not without those that were validated: a
    search may end at a lesser maximum.
    """
    known = NOTHING_KNOWN
    if trained.variable is not None and _keeps_hyper(trained):
        known = KnownHyper(trained.variable.hyper)
    elif trained.variable is not None:
        known = KnownHyper(near=trained.variable, contested=True)
    return fit_rows(_begun_at(task, trained), rows, known)


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
    constant, variable = _constant_details(task, final), _variable_details(task, final, searched)
    return constant, variable, _measured(task, final, left_m(constant, variable))


def _constant_details(task: Task, fits: Fits) -> ConstantDetails:
    names, fit, covariance = fits.identifiability.determined, fits.constant, counted_covariance(task, fits)
    common = common_share(fit.residuals, fit.weights, len(task.selection.targets), fit.noise[0])
    scale = KnownScale.of(fit.residuals, fits.identifiability.total_rank, fits.data.sigma_m, common)
    return ConstantDetails.of(names, fit, covariance, standard_errors(task, fits, covariance), scale)


def _variable_details(task: Task, final: Fits, searched: Fits) -> VariableDetails | None:
    if final.variable is None or searched.variable is None:
        return None
    values = feature_values(final.data, task.options.features)
    return VariableDetails(
        hyper=final.variable.hyper,
        evidence=searched.variable.evidence,
        evaluations=searched.variable.evaluations,
        inflation=final.variable.inflation,
        unexplained_m=unexplained(task, final.variable, final.data),
        feature_ranges=tuple(feature_ranges(values)),
        feature_lowest=tuple(values.min(axis=0).tolist()),
    )
