"""All that rows, fits and errors may tell against a calibration, looked for when it is made."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from truearm.calibration import Calibration
from truearm.certainty.standard_errors import constant_details
from truearm.defaults import NO_DRIFT
from truearm.doubts.conventions import BETTER, NEAR_M, fits_otherwise
from truearm.doubts.distance_zero import zero_notices
from truearm.doubts.exchanged import exchanges
from truearm.doubts.few_judged import FewJudged
from truearm.doubts.known_world import another_frame
from truearm.doubts.masked_rows import bent_notice
from truearm.doubts.moved_joints import moved_joints
from truearm.doubts.of_results import (
    FAR_FROM_NOMINAL,
    NO_HELP,
    SINGLE_ROWS,
    WOULD_FIT,
    constant_is_better,
    doubts,
    mounting,
    poses_aside,
    stated_too_large,
)
from truearm.doubts.one_anchor import one_anchor
from truearm.doubts.outliers import EXCHANGED, NO_OUTLIERS, STATED_TOO_LARGE, Outliers, judged_means_mm
from truearm.doubts.rounded_readings import rounded_notices
from truearm.doubts.row_lag import CHANGE, fits_shifted
from truearm.doubts.slips import Slip, main_slips, slips
from truearm.doubts.tool_slips import tool_slips
from truearm.doubts.turned_later import turned_in_setups, turned_later
from truearm.doubts.unbent import may_be_bent, unbent
from truearm.doubts.uneven_axes import uneven_axes
from truearm.doubts.uneven_setups import uneven_setups, uneven_turns
from truearm.doubts.whitened import Whitened
from truearm.errors import Notice
from truearm.fits.details import VariableDetails, left_m
from truearm.fits.endpoints import at_tool
from truearm.fits.enough_values import group_unknowns
from truearm.fits.fitted_rows import FittedRows
from truearm.fits.fitting import Fits, Task, fit_rows
from truearm.fits.identifiability import Identifiability
from truearm.fits.models import CONSTANT, NOMINAL, ArmModel
from truearm.judgement.judging import check_judged
from truearm.measurements import Measurements
from truearm.rows.linked_pairs import pairs_between
from truearm.rows.splitting import Split, measured_on_both_sides
from truearm.rows.visits import pose_count
from truearm.stages import Stages, no_stages
from truearm.storage.summary import distance_at_floor_mm, whole_noise_mm
from truearm.types import Floats

OPEN_SETUP: Final = "open_setup"
UNFOLLOWED: Final = 3.0
"""Mean error of held-out rows, in what noise alone would leave, that those which trained do not tell of."""
REASONS: Final = {*EXCHANGED, *WOULD_FIT}
"""Notices of what is wrong with rows."""
WRONG_ROWS: Final = {NO_HELP, SINGLE_ROWS, *REASONS}
"""Notices of what spoils a fit, so that what it leaves of rows tells nothing else."""


def of_split(task: Task, given: Measurements, split: Split) -> list[Notice]:
    """Of which held-out rows errors say less, and which are not judged."""
    train, held = given.select(split.train), given.select(split.holdout)
    return [
        *measured_on_both_sides(given, split),
        *pairs_between(given, split),
        *one_anchor(given, task.selection),
        *check_judged(train, held, task.selection),
    ]


def of_fit(task: Task, final: Fits, variable: VariableDetails | None) -> list[Notice]:
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


def of_result(
    task: Task, found: Calibration, given: tuple[Measurements, Floats], stages: Stages
) -> list[Notice]:
    """What speaks against a calibration, and unless rows are wrong, what it leaves of them; `given` are all
    rows, and the progress of the fitted ones (n,).
    """
    data, progress = given
    told, robust = _doubted(task, found, data, stages)
    kinds = {notice.kind for notice in told}
    if kinds & WRONG_ROWS:
        return _unless_chance(found, told if kinds & REASONS else [*told, *_reason(task, found, progress)])
    return [*told, *_of_left(task, found, progress, robust)]


def _unless_chance(found: Calibration, told: list[Notice]) -> list[Notice]:
    """What speaks against a calibration, where so few poses were held out that they may be to blame."""
    judged, best, outliers = found.validation, found.model_name, Outliers.of(found)
    means = judged_means_mm(judged, outliers)
    few = FewJudged(found.held, judged.n_holdout_poses, judged.judged, best, outliers)
    return few.told(told, means[NOMINAL], means[best], "mean error")


def _of_left(task: Task, found: Calibration, progress: Floats, robust: Fits | None) -> list[Notice]:
    """What is left of the rows tells beside noise; `progress` (n,) is that of the fitted rows, and `robust`
    are constants that rows far off did not bend, if there are such.
    """
    rows, bent = found.rows, list[Notice]()
    if rows is None:
        return []
    if may_be_bent(found) and rows.outliers():
        robust = robust or unbent(task, rows)
        bent = bent_notice(found, robust)
    if found.scheme is not None or found.selection.distances:
        return bent
    if robust is not None and rows.outliers():
        found, rows = _of_constants(task, found, rows, robust)
    seen = Whitened.of(found, rows, progress)
    if seen is None:
        return [*bent, *(slip.notice for slip in _slips_by_constants(task, found, rows, progress))]
    slipped = slips(found, rows, seen, progress) or _slips_by_constants(task, found, rows, progress)
    uneven = [
        *uneven_setups(found, rows, seen),
        *uneven_turns(found, rows),
        *uneven_axes(found, rows, seen),
    ]
    return [*bent, *uneven, *moved_joints(found, rows, seen, progress, slipped)]


def _reason(task: Task, found: Calibration, progress: Floats) -> list[Notice]:
    """What stands otherwise from some row on, where that explains most of what a calibration leaves."""
    if found.rows is None or found.scheme is not None or found.selection.distances:
        return []
    slipped = main_slips(found, found.rows, progress)
    slipped = slipped or _slips_by_constants(task, found, found.rows, progress)
    return [slip.notice for slip in slipped]


def _slips_by_constants(task: Task, found: Calibration, rows: FittedRows, progress: Floats) -> list[Slip]:
    """Slips of a tool with several targets, which what varies follows at the poses that it was fitted to.

    Asked where it is far more off at others than noise would leave it.
    """
    if found.variable is None or found.options.drift == NO_DRIFT or len(found.selection.targets) < 2:
        return []
    if found.validation.holdout[found.model_name].position.mean < UNFOLLOWED * distance_at_floor_mm(found):
        return []
    options = replace(task.options, model=CONSTANT)
    fits = fit_rows(replace(task, options=options, starts=(), stages=no_stages), rows.fitted)
    of_constants = replace(found, options=options, variable=None, fitted_spread=None)
    return tool_slips(*_of_constants(task, of_constants, rows, fits), progress)


def _of_constants(
    task: Task, found: Calibration, rows: FittedRows, fits: Fits
) -> tuple[Calibration, FittedRows]:
    """The calibration with constants of other fits to its rows, and the rows as these have them."""
    constant, models = constant_details(task, fits), fits.models(task.arm)
    told = replace(found, models=models, identifiability=fits.identifiability, constant=constant)
    return told, FittedRows.of(task, fits, rows.side)


def _doubted(
    task: Task, found: Calibration, data: Measurements, stages: Stages
) -> tuple[list[Notice], Fits | None]:
    """What makes a calibration doubtful; where it does not help, or found another arm, with what would
    fit instead; and the constants that rows far off did not bend, if these were looked for.
    """
    doubted, shifted = _of_errors(task, found, data, Outliers.of(found)), list[Notice]()
    too_large = any(notice.kind == STATED_TOO_LARGE for notice in doubted)
    if not too_large and _many_are_off(found, doubted):
        with stages("looking for lost rows"):
            shifted = fits_shifted(task, data)
    if shifted:
        doubted = _of_errors(task, found, data, NO_OUTLIERS)
        return [*doubted[:1], *shifted, *doubted[1:]], None
    framed = _framed(task, found)
    exchanged = exchanges(task, found, doubted=_is_in_doubt(doubted) and not framed)
    if exchanged.notices:
        told = replace(found, notices=exchanged.notices)
        robust = None if exchanged.unbent is None else exchanged.unbent.models(task.arm)[CONSTANT]
        doubted = _of_errors(task, told, data, Outliers.of(told), robust)
    doubted[1:1] = framed
    wrong = {FAR_FROM_NOMINAL} if exchanged.notices else {NO_HELP, FAR_FROM_NOMINAL}
    if not (framed or too_large) and any(notice.kind in wrong for notice in doubted):
        with stages("trying other conventions"):
            otherwise = (
                turned_in_setups(task, data, BETTER, NEAR_M)
                or fits_otherwise(task, data)
                or turned_later(task, data, BETTER, NEAR_M)
            )
        if otherwise:
            # What takes parameters far from nominal is known then, and is no other robot.
            doubted = [notice for notice in doubted if notice.kind != FAR_FROM_NOMINAL]
        doubted[1:1] = otherwise
    return [*exchanged.notices, *doubted], exchanged.unbent


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
    too_large = stated_too_large(data, judged, best, points, outliers)
    outliers = replace(outliers, stated_too_large=bool(too_large))
    return [
        *too_large,
        *zero_notices(
            task, data, [found.models[name] for name in (NOMINAL, CONSTANT)], found.identifiability.determined
        ),
        *doubts(task.arm, models, judged, best, distance_at_floor_mm(found), outliers),
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
