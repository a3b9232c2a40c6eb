"""The three fits of one set of rows: frame and tool alone, constants, and what varies."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from truearm._core import (
    ConstantFit,
    CoreError,
    FieldFit,
    MeasurementSet,
    Problem,
    fit_constant,
    fit_field,
)
from truearm.errors import InputError, UsageError, WorkError, list_names
from truearm.fits.core_set import Selection, anchor_names, core_set
from truearm.fits.enough_values import check_enough, check_set_ups, setup_unknowns
from truearm.fits.identifiability import Identifiability, identify
from truearm.fits.identified import IdentifiedArm
from truearm.fits.models import CONSTANT, NOMINAL, VARIABLE, ArmModel
from truearm.fits.options import CalibrationOptions
from truearm.fits.scheme_fitting import SchemeFit, SchemeRows, fit_scheme, well_determined
from truearm.fits.schemes import SCHEMES
from truearm.inputs import is_payload
from truearm.kinds import settle
from truearm.measurements import Measurements
from truearm.rows.own_sigmas import own_covariances, sigmas_of_turns
from truearm.rows.visits import fitted_poses, one_row_a_pose
from truearm.stages import Stages, no_stages
from truearm.types import AXES, Floats, Mask

if TYPE_CHECKING:
    from truearm._core import ConstantOptions, FieldOptions

Hyper = dict[str, list[float]]

ENOUGH_FOR_HYPER: Final = 400
"""The evidence is maximised on at most so many poses; hyper-parameters from as many serve any number."""
FAR_FROM_CONSTANTS: Final = 0.36
"""Weight that Cauchy's loss gives a point which noise takes so far off once in a million."""
LOWER: Final = 0.75
"""Ratio of what constants leave without what is far off and with it, below which that bends them.

What varies with the pose has longer tails than noise: a robust loss takes them for far off, too, but little
is gained without them.
"""
MOST_FAR: Final = 0.25
"""Share of such rows from which they are no outliers."""
SUSPECTED: Final = 1e-4
"""Weight of a row with which a fit begins that is to judge it."""
CLEARER: Final = 0.7
"""Ratio of the median distances of rows left out, below which a fit is believed that begins without some."""
PROMISING: Final = 0.85
"""That ratio of a rough fit, quick to make, above which the whole fit without these rows is not tried."""
ODDS: Final = 1e-6
"""That a pose is an outlier, before anything is known of it: evidence has to surpass it for each one."""
OTHER_MINIMUM: Final = 0.7
"""Ratio of what constants leave below which they were found in another, better minimum."""
SPOILING: Final = 0.1
"""Share of all squares that constants leave from which rows that are taken out have bent them."""


@dataclass(frozen=True, eq=False)
class KnownHyper:
    """What is known of a field's hyper-parameters before it is fitted.

    Attributes:
        exactly: Those to keep; None to search.
        near: A fit to nearly the same rows, at whose the search begins; None to begin from nothing.
        contested: Whether a search from nothing stands against that one, and the more probable wins.
        rough: Whether those of a search on a part of the rows are enough.
        suspected: Rows (n,) that the fit `near` took for outliers; None where there is no such fit.
    """

    exactly: Hyper | None = None
    near: FieldFit | None = None
    contested: bool = False
    rough: bool = False
    suspected: Mask | None = None


NOTHING_KNOWN: Final = KnownHyper()


@dataclass(frozen=True, eq=False)
class Task:
    """What is the same for every set of rows that is fitted.

    Attributes:
        arm: The arm and its candidates.
        selection: What of the measurements is used.
        groups: Names of the set-ups, in the order of their numbers.
        options: How to fit.
        threads: Threads at the most; the result does not depend on it.
        stages: Told what is being done.
        sizes: Poses of each file that a share is held out of; empty where none is.
        starts: Fits of nearly the same rows: the search for constants begins there too, with their noise.
            With more the prior would draw constants away that are far from nominal.
        anchors: Names of the fixed points that distances lead to, in the order of their numbers.
    """

    arm: IdentifiedArm
    selection: Selection
    groups: Sequence[str]
    options: CalibrationOptions
    threads: int | None = None
    stages: Stages = no_stages
    sizes: tuple[int, ...] = ()
    starts: tuple[ConstantFit, ...] = ()
    anchors: Sequence[str] = ()

    def __post_init__(self) -> None:
        """Check what the core takes as it is."""
        settle(self, whole=("threads",))
        if self.threads is not None and self.threads < 1:
            raise UsageError(f"{self.threads} threads", rule="At least 1, or None for all there are")

    def problem(self, measured: MeasurementSet, columns: Sequence[int]) -> Problem:
        """The core's problem of rows and parameters asked for."""
        return Problem(self.arm.flange_chain, measured, list(columns), self.arm.world_is_known)

    def columns(self, names: Sequence[str]) -> list[int]:
        """Columns of the candidates of these names, ascending."""
        named = zip(self.arm.candidates.columns, self.arm.candidates.names, strict=True)
        return [column for column, name in named if name in names]


@dataclass(frozen=True, eq=False)
class Fits:
    """What one set of rows says.

    Attributes:
        data: The rows, n of them.
        nominal: Frame and tool alone.
        identifiability: What the rows determine.
        constant: Constants with frame and tool.
        variable: Constants, field, frame and tool together; None where only constants were asked for.
        seconds: Time of the constant fit and of the one that varies.
        scheme: One of the paper's schemes beside the constants; None where it was not asked for.
        scheme_name: Its name.
        evaluations: How often the evidence was evaluated to find the variable model's hyper-parameters.
        groups: Names of the set-ups, in the order of their numbers.
    """

    data: Measurements
    nominal: ConstantFit
    identifiability: Identifiability
    constant: ConstantFit
    variable: FieldFit | None
    seconds: dict[str, float]
    scheme: SchemeFit | None = None
    scheme_name: str = ""
    evaluations: int = 0
    groups: Sequence[str] = ()

    def after(self, before: "Fits | None") -> "Fits":
        """This one, with the time and the evaluations of a fit that its search began at."""
        if before is None:
            return self
        seconds = {name: spent + before.seconds[name] for name, spent in self.seconds.items()}
        return replace(self, seconds=seconds, evaluations=self.evaluations + before.evaluations)

    def models(self, arm: IdentifiedArm) -> dict[str, ArmModel]:
        """The fitted models by name."""
        models = {
            NOMINAL: ArmModel(arm.table, self.nominal.setup),
            CONSTANT: ArmModel(self.constant.parameters, self.constant.setup),
        }
        if self.variable is not None:
            models[VARIABLE] = ArmModel(self.variable.parameters, self.variable.setup, self.variable.field)
        if self.scheme is not None:
            constant = models[CONSTANT]
            models[self.scheme_name] = ArmModel(constant.constants, constant.setup, scheme=self.scheme.scheme)
        return models


def constant_variances(fits: Fits, selection: Selection) -> Floats:
    """Variances (n, m) that the constant fit took for what its rows hold, base frame, those of distances
    (n, 1).
    """
    position, orientation = fits.constant.noise
    data = fits.data
    own = np.square(data.stated_sigma_m)[:, None]
    if not selection.distances:
        covariances = own_covariances(data, fits.groups, fits.constant.setup.frames)
        own = np.tile(np.diagonal(covariances, axis1=1, axis2=2), (1, len(selection.targets)))
    variance = position**2 + own
    if selection.orientation:
        turned = orientation**2 + np.square(sigmas_of_turns(data))[:, None]
        variance = np.concatenate([variance, np.repeat(turned, AXES, axis=1)], axis=1)
    return variance


def fit_rows(task: Task, data: Measurements, known: KnownHyper = NOTHING_KNOWN) -> Fits:
    """Fit all models to all rows of `data`.

    Args:
        task: What to fit.
        data: The rows.
        known: What is known of the field's hyper-parameters; by default they are found from the rows.

    Raises:
        WorkError: If the rows are too few or too alike.
    """
    measured = core_set(task.arm.robot, data, task.selection, task.groups)
    check_enough(task, data, setup_unknowns(task))
    check_set_ups(task, data)
    began = time.perf_counter()
    constants = _fit_constants(task, measured, data)
    seconds, variable = {CONSTANT: time.perf_counter() - began}, None
    if task.options.model == VARIABLE:
        began = time.perf_counter()
        variable = _fit_field(task, measured, constants, data, known)
        if _spoilt(constants.constant, variable):
            if known.exactly is None:
                known = replace(known, near=variable, contested=not known.rough)
            constants, variable = _without_outliers(task, data, variable.weights, known)
        if known.exactly is None and not known.rough:
            constants, variable = _remembered(task, data, (constants, variable), known)
            constants, variable = _unmasked(task, data, (constants, variable))
        seconds[VARIABLE] = time.perf_counter() - began
    nominal, found, constant = constants.nominal, constants.identifiability, constants.constant
    scheme = None
    if task.options.model in SCHEMES:
        began = time.perf_counter()
        with task.stages("dividing the workspace, and learning"), core_errors(data):
            scheme = _fit_scheme(task, constant, found, one_row_a_pose(data))
        seconds[task.options.model] = time.perf_counter() - began
    evaluations = 0 if variable is None else variable.evaluations
    return Fits(
        data=data,
        nominal=nominal,
        identifiability=found,
        constant=constant,
        variable=variable,
        seconds=seconds,
        scheme=scheme,
        scheme_name=task.options.model,
        evaluations=evaluations,
        groups=task.groups,
    )


@dataclass(frozen=True, eq=False)
class _Constants:
    """What rows say of the arm without anything that varies."""

    nominal: ConstantFit
    identifiability: Identifiability
    constant: ConstantFit


def _fit_constants(task: Task, measured: MeasurementSet, data: Measurements) -> _Constants:
    with task.stages("finding frame and tool"), core_errors(data):
        # Pairs say nothing of a target along the axes of a SCARA: what is known of its reach, which comes
        # with any prior, keeps it there. Distances from anchors say where it is.
        prior = task.options.prior if task.selection.distances and not anchor_names(data) else None
        options = fit_options(task.threads, prior=prior, robust=task.options.robust)
        nominal = fit_constant(task.problem(measured, []), options)
    with task.stages("asking what the poses determine"):
        found = identify(task.arm, measured, nominal.setup)
        check_enough(task, data, found.total_rank)
    with task.stages("fitting the constants"), core_errors(data):
        chosen = task.problem(measured, task.columns(found.determined))
        options = fit_options(task.threads, prior=task.options.prior, robust=task.options.robust)
        constant = fit_constant(chosen, options)
        for start in task.starts:
            options |= {"parameters": start.parameters, "start": start.setup, "noise": start.noise}
            other = fit_constant(chosen, options)
            if _typically_left(other) < OTHER_MINIMUM * _typically_left(constant):
                constant = other
    return _Constants(nominal, found, constant)


def _typically_left(constant: ConstantFit) -> float:
    """Median of the residuals' absolute values."""
    return float(np.median(np.abs(constant.residuals)))


def _spoilt(constant: ConstantFit, variable: FieldFit) -> bool:
    """Whether rows that the variable model takes out have bent the constants that it begins with."""
    squares = np.square(constant.residuals.reshape(len(variable.weights), -1)).sum(axis=1) * constant.weights
    return float(squares[variable.weights < 1.0].sum()) > SPOILING * float(squares.sum())


def _without_outliers(
    task: Task, data: Measurements, weights: Floats, known: KnownHyper
) -> tuple[_Constants, FieldFit]:
    """All models anew, where rows (n,) begin with these weights."""
    measured = core_set(task.arm.robot, data, task.selection, task.groups, weights)
    constants = _fit_constants(task, measured, data)
    return constants, _fit_field(task, measured, constants, data, known)


def _remembered(
    task: Task, data: Measurements, fits: tuple[_Constants, FieldFit], known: KnownHyper
) -> tuple[_Constants, FieldFit]:
    """The fits, or those that begin as a fit to nearly the same rows ended, if these are the clearer.

    Outliers that it found may be part of what varies in a fit that begins with all rows.
    """
    variable, suspected = fits[1], known.suspected
    if suspected is None or not (suspected & (variable.weights >= 1.0)).any():
        return fits
    weights = np.where(suspected, SUSPECTED, 1.0)
    found = _without_outliers(task, data, weights, known)
    return found if _is_clearer(found[1], variable, CLEARER) else fits


def _unmasked(
    task: Task, data: Measurements, fits: tuple[_Constants, FieldFit]
) -> tuple[_Constants, FieldFit]:
    """The fits, or those that begin without rows far from constants, if these are by far the clearer.

    Many outliers among few rows become part of the noise that the evidence finds, and no row is far off then.
    Rows that are innocent have their weight back once a model without them judges them. A rough fit that
    begins at the one to all rows tells first whether there is anything to find.
    """
    constants, variable = fits
    measured = core_set(task.arm.robot, data, task.selection, task.groups)
    problem = task.problem(measured, task.columns(constants.identifiability.determined))
    with core_errors(data):
        robust = fit_constant(problem, fit_options(task.threads, prior=task.options.prior, robust="cauchy"))
    far = robust.weights < FAR_FROM_CONSTANTS
    if (
        not far[variable.weights >= 1.0].any()
        or far.mean() > MOST_FAR
        or not bent(constants.constant, robust)
    ):
        return fits
    weights = np.where(far, SUSPECTED, 1.0)
    _, rough = _without_outliers(task, data, weights, KnownHyper(near=variable, rough=True))
    if not _is_clearer(rough, variable, PROMISING):
        return fits
    found = _without_outliers(task, data, weights, NOTHING_KNOWN)
    return found if _is_clearer(found[1], variable, CLEARER) else fits


def bent(constant: ConstantFit, without: ConstantFit) -> bool:
    """Whether constants leave far more than others that what is far off does not bend."""
    return any(less < LOWER * more for less, more in zip(without.noise, constant.noise, strict=True))


def _is_clearer(found: FieldFit, before: FieldFit, ratio: float) -> bool:
    """Whether a fit without some rows is better by the median of distances, or by evidence.

    Evidence counts what outliers cost: they have a noise of their own. Of more rows than hyper-parameters
    are found from it is of a part. It is of poses, and of other data where a fit took other rows for shots of
    one.
    """
    if np.median(found.distances) < ratio * np.median(before.distances):
        return True
    poses, former = (fitted_poses(fit.posterior, fit.residuals) for fit in (found, before))
    if len(poses) > ENOUGH_FOR_HYPER or not np.array_equal(poses, former):
        return False
    more = len(np.unique(poses[found.weights < 1.0])) - len(np.unique(poses[before.weights < 1.0]))
    return bool(found.evidence - before.evidence > -np.log(ODDS) * max(more, 1))


def _fit_scheme(task: Task, constant: ConstantFit, found: Identifiability, data: Measurements) -> SchemeFit:
    """The scheme beside constants; its rows are poses, since shots would vouch for one another."""
    if task.selection.distances:
        raise WorkError(
            "the measurements are distances alone",
            where=", ".join(data.files),
            rule="The paper's schemes are built for positions",
            way_out="Give --model constant (model='constant')",
        )
    determined = task.columns(found.determined)
    if not determined:
        raise WorkError(
            "the rows determine no parameter of the arm",
            where=", ".join(data.files),
            rule="The paper's schemes are made of the parameters that the rows determine",
            way_out="Give --model constant (model='constant'), or measure where the arm's parameters tell",
        )
    measured = core_set(task.arm.robot, data, task.selection, task.groups)
    columns = well_determined(task.problem(measured, determined), constant, determined)
    values = task.arm.robot.joints_from_readings(data.readings)
    joints, seed = task.arm.robot.joints, task.options.split.seed
    rows = SchemeRows(task.problem(measured, columns), columns, constant, values, joints, seed)
    return fit_scheme(task.options.model, rows, task.options.scheme)


def fit_setup(task: Task, data: Measurements, parameters: Floats, robust: str | None = None) -> ConstantFit:
    """Frames and targets alone of the set-ups of a task, with the arm's `parameters` (n, L, 5) as they are.

    Raises:
        WorkError: If the rows determine too little.
    """
    measured = core_set(task.arm.robot, data, task.selection, task.groups)
    options = fit_options(task.threads, robust=robust, parameters=parameters)
    with core_errors(data):
        return fit_constant(task.problem(measured, []), options)


def fit_options(
    threads: int | None,
    prior: tuple[float, float, bool] | None = None,
    robust: str | None = None,
    parameters: Floats | None = None,
) -> "ConstantOptions":
    """The core's options of a constant fit; `parameters` (n, L, 5) are the arm where it is not fitted."""
    return {
        "prior": prior,
        "noise": None,
        "robust": robust,
        "start": None,
        "parameters": parameters,
        "threads": threads,
    }


def field_options(
    task: Task, names: Sequence[str], features: Floats, ranges: Sequence[float], known: KnownHyper
) -> "FieldOptions":
    """The core's options of a field.

    Args:
        task: What to fit.
        names: Names of the candidates whose constants the data determines.
        features: Values of the features (n, F).
        ranges: How far the values of each feature reach.
        known: What is known of the hyper-parameters.
    """
    candidates = task.arm.candidates
    return {
        "determined": [k for k, name in enumerate(candidates.names) if name in names],
        "driven": list(candidates.driven),
        "features": np.ascontiguousarray(features),
        "feature_ranges": list(ranges),
        "payloads": [k for k, name in enumerate(task.options.features) if is_payload(name)],
        "coupling": np.ascontiguousarray(task.arm.robot.coupling),
        "degree": task.options.degree,
        "prior": task.options.prior,
        "hyper": known.exactly,
        "near": known.near,
        "contested": known.contested,
        "rough": known.rough,
        "threads": task.threads,
    }


def _fit_field(
    task: Task, measured: MeasurementSet, constants: _Constants, data: Measurements, known: KnownHyper
) -> FieldFit:
    values = feature_values(data, task.options.features)
    names = constants.identifiability.determined
    options = field_options(task, names, values, feature_ranges(values), known)
    with task.stages("searching what varies" if known.rough else "fitting what varies"), core_errors(data):
        return fit_field(task.problem(measured, task.arm.candidates.columns), constants.constant, options)


def feature_values(data: Measurements, names: Sequence[str]) -> Floats:
    """Values (n, F) of the named columns.

    Raises:
        InputError: If a column is missing, or empty in some rows.
    """
    values = np.empty((len(data), len(names)))
    for k, name in enumerate(names):
        where = ", ".join(data.files)
        if name not in data.features.columns:
            raise InputError(
                f'there is no column "{name}" to use as a feature',
                where=where,
                rule="Features are columns beside readings and what was measured; there are "
                + (list_names(map(str, data.features.columns)) or "none"),
            )
        values[:, k] = data.features[name].to_numpy(np.float64)
        bad = ~np.isfinite(values[:, k])
        if bad.any():
            raise InputError(
                f'the feature "{name}" is empty in {data.row_names(bad)}',
                where=where,
                rule="The field needs its features at every pose",
                way_out="Fill the cells or leave out the rows",
            )
    return values


def feature_ranges(values: Floats) -> list[float]:
    """How far each column of `values` (n, F) reaches."""
    return [float(reach) for reach in np.ptp(values, axis=0)] if values.shape[1] else []


@contextmanager
def core_errors(data: Measurements) -> Iterator[None]:
    """Errors of the core as WorkError that names the files."""
    try:
        yield
    except CoreError as error:
        raise WorkError(str(error), where=", ".join(data.files)) from error
