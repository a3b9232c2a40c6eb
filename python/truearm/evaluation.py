"""Errors of a calibration on measurements that it has not seen, mostly in a new set-up."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from truearm import kinds
from truearm._core import ANGLE_ARM_M, Setup
from truearm.arrays import hold_read_only
from truearm.calibration import Calibration
from truearm.defaults import FIRST_TARGET, SEED
from truearm.doubts.admitted import admitted
from truearm.doubts.as_calibrated import (
    AS_KNOWN,
    NOT_AS_CALIBRATED,
    can_be_updated,
    changed_since,
    not_as_calibrated,
)
from truearm.doubts.few_judged import UNDECIDED, FewJudged
from truearm.doubts.gross_rows import (
    FAR_ROWS,
    Expected,
    gross_frame_rows,
    gross_judged_rows,
    gross_rows_told,
)
from truearm.doubts.of_results import NO_HELP, no_help
from truearm.doubts.outliers import known_mean_mm
from truearm.doubts.slips import MOSTLY
from truearm.doubts.turning_sense import check_turns
from truearm.errors import InputError, Notice, TruearmError, UsageError, in_json, list_names, rows_in_words
from truearm.fits.core_set import Selection, Use, rotations, select, select_fitted
from truearm.fits.fitted_rows import known_rows
from truearm.fits.fitting import Task, fit_setup
from truearm.fits.measured_parts import held_parts
from truearm.fits.models import NOMINAL, ArmModel
from truearm.frame_rows import divide
from truearm.frame_share import FoundSetUps
from truearm.judgement.held_rows import HeldRows
from truearm.judgement.judging import (
    check_judged,
    holding_nothing,
    judge,
    model_inputs,
    never_found,
    where_found,
    without_parts,
)
from truearm.judgement.validation import Errors, means_in_words
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.registration import register
from truearm.rows.visits import pose_count, pose_numbers
from truearm.solving import rows_beyond_learnt
from truearm.stages import Stages, no_stages
from truearm.storage.summary import distance_at_floor_mm
from truearm.types import Floats, Mask

ELSEWHERE: Final = 0.1
"""Share of the error that is left with frame and tool found anew where these are elsewhere, whatever else is
not as it was. They take up as much of what a joint does that moved where the rows are of a small part of the
space, and of the first and the last joint all."""


@dataclass(frozen=True)
class EvaluationOptions:
    """How to judge a calibration on other measurements.

    Attributes:
        seed: Seed of the draw of frame rows.
        use: What of the measurements to use, as in calibrate.
        frame_rows: Rows of each set-up that find frame and tool, with all shots of their poses; by default
            those of a third of the poses, 400 at most, or of as many as hold twice as many measured values as
            frame and tool have unknowns, if that leaves a third to judge.
        keep_tool: Whether the tool stays as it was calibrated, so that the rows find the frame alone.
        keep_frames: Whether the set-ups are those of the calibration, so that all rows are judged.
        judge_target: Measured target, from 1, at which errors are judged. Where several were fitted, a row
            without the first is judged at the next that it holds.
    """

    seed: int = SEED
    use: Use | None = None
    frame_rows: int | None = None
    keep_tool: bool = False
    keep_frames: bool = False
    judge_target: int = FIRST_TARGET

    def __post_init__(self) -> None:
        kinds.settle(self, whole=("seed", "frame_rows", "judge_target"), flags=("keep_tool", "keep_frames"))
        kinds.check_values(self, positive=("frame_rows",), not_negative=("seed",))
        if self.keep_frames and self.frame_rows is not None:
            raise UsageError("frame rows find frames", rule="With --keep-frames there are none to find")


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Errors on other measurements.

    `evaluate` makes one.

    Attributes:
        n_frame: Rows that found what was not kept.
        n_frame_poses: How many poses they are of: shots of the same pose count once.
        n_judged: Rows that were judged and hold what is judged.
        n_judged_poses: How many poses those are of.
        errors: Errors of "nominal", "constant" and, if there is one, "variable".
        notices: What the user should know.
        rows: The rows that were to be judged, each with its errors, NaN where nothing is judged.
        finds: What was found: "frame", but in a known world, and "tool", as far as they were not kept.
    """

    n_frame: int
    n_frame_poses: int
    n_judged: int
    n_judged_poses: int
    errors: Mapping[str, Errors]
    notices: tuple[Notice, ...] = ()
    rows: HeldRows | None = None
    finds: tuple[str, ...] = ("frame", "tool")

    def __post_init__(self) -> None:
        hold_read_only(self, "errors")

    def __repr__(self) -> str:
        divided = f"frame of {self.frame_in_words}, {self.judged_in_words} judged"
        return f"<Evaluation: {divided}; {means_in_words(self.errors)}>"

    @property
    def frame_in_words(self) -> str:
        """How many found what was not kept: "50 rows", or "5 poses (50 rows)"."""
        return rows_in_words(self.n_frame, self.n_frame_poses)

    @property
    def judged_in_words(self) -> str:
        """How many were judged: "100 rows", or "10 poses (100 rows)"."""
        return rows_in_words(self.n_judged, self.n_judged_poses)

    def to_dict(self) -> dict[str, Any]:
        """JSON values, without the rows."""
        errors = {name: found.to_dict() for name, found in self.errors.items()}
        counts = ("n_frame", "n_frame_poses", "n_judged", "n_judged_poses")
        numbers = {name: getattr(self, name) for name in counts}
        return {**numbers, "errors": errors, "notices": in_json(self.notices)}


class _Gross(NamedTuple):
    """Notices of rows.

    Attributes:
        spoiled: Of those that spoil frame and tool.
        doubts: Of gross ones among those that were judged, and of what frame and tool add to all.
        changed: That the arm is not as it was calibrated.
    """

    spoiled: list[Notice]
    doubts: list[Notice]
    changed: list[Notice]


def evaluate(
    calibration: Calibration,
    data: Measurements | Sequence[Measurements],
    options: EvaluationOptions | None = None,
    *,
    stages: Stages | None = None,
    **more: Any,
) -> Evaluation:
    """Errors of a calibration's models on `data`.

    Each model finds its own frames and tools on the same rows; nothing else of it moves.

    Args:
        calibration: What is judged.
        data: Measurements of the same arm.
        options: How to judge; defaults without them.
        stages: Called with the name of each stage; gives a context manager that surrounds it; None
            for nobody.
        **more: The same options as keywords, such as frame_rows=10.

    Raises:
        UsageError: If options contradict each other or the data.
        InputError: If the data cannot be of this arm, or has too few rows.
        WorkError: If the frame rows determine too little.
    """
    chosen, stages = kinds.chosen(EvaluationOptions, options, more), stages or no_stages
    calibration, data = kinds.required(calibration, Calibration, "the calibration"), Measurements.of(data)
    data, notices = admitted(data, calibration.robot)
    selection, left_out = _selection(calibration, data, chosen)
    notices += [*known_rows(calibration, data), *rows_beyond_learnt(calibration, data), *left_out]
    if selection.orientation:
        check_turns(data, calibration.robot)
    task = Task(calibration.arm, selection, data.groups, calibration.options, stages=stages)
    given, lost = data, _lost_parts(task, calibration, data, chosen)
    data = without_parts(lost, data, selection)
    frame, judged = divide(task, data, chosen)
    found_by = data.select(frame if len(frame) else judged)
    given_rows, own_lost = given.select(judged), lost[judged]
    chosen_rows, not_judged = _found_again(found_by, given_rows, selection, chosen, own_lost)
    notices += not_judged
    with stages("finding frame and tool"):
        models = {
            name: ArmModel(
                model.constants,
                _setup(task, calibration, name, data.select(frame), chosen),
                model.field,
                model.scheme,
            )
            for name, model in calibration.models.items()
        }
    with stages("judging"):
        errors = judge(task, models, chosen_rows, found_by)
        held, best = HeldRows.of(chosen_rows, errors), calibration.model_name
        rows = chosen_rows, held
        gross = _gross(task, calibration, models[best], found_by, rows, chosen)
    notices += [*_warnings(calibration, given, chosen, stages, held=held, gross=gross), *gross.doubts]
    statistics = {name: found.statistics() for name, found in errors.items()}
    known = chosen_rows.select(errors[best].measured)
    counts = len(frame), pose_count(data.select(frame)), len(known), pose_count(known)
    return Evaluation(*counts, statistics, tuple(notices), held, _finds(task, chosen))


def _warnings(
    calibration: Calibration,
    data: Measurements,
    options: EvaluationOptions,
    stages: Stages,
    *,
    held: HeldRows,
    gross: _Gross,
) -> list[Notice]:
    """What makes the calibration of no use, and what is not as it was when it was made."""
    if gross.spoiled:
        return gross.spoiled
    told = _of_no_use(calibration, held, gross.changed) or gross.changed
    if told and (options.keep_frames or options.keep_tool):
        told = _moved(calibration, data, options, held.median_mm(calibration.model_name)) or told
    return _with_slips(calibration, data, options, stages, told) if gross.changed else told


def _with_slips(
    calibration: Calibration,
    data: Measurements,
    options: EvaluationOptions,
    stages: Stages,
    told: list[Notice],
) -> list[Notice]:
    """What slipped while rows were measured: where that is most of what they miss, in place of what was told
    of the arm; where nothing did, which other scale or load explains them.
    """
    from truearm.updating.comparing import (  # noqa: PLC0415 - scipy is slow to import
        explained_otherwise,
        slipped_meanwhile,
    )

    if not can_be_updated(calibration):
        return told
    with stages("looking for what slipped"):
        slipped = slipped_meanwhile(calibration, data, options.use)
        otherwise = [] if slipped else explained_otherwise(calibration, data, options.use)
    most = any(slip.share > MOSTLY for slip in slipped)
    return [*([] if most else told), *otherwise, *(slip.notice for slip in slipped)]


def _finds(task: Task, options: EvaluationOptions) -> tuple[str, ...]:
    """What the rows of the frame find."""
    frame = not (options.keep_frames or task.arm.world_is_known)
    tool = not (options.keep_tool or options.keep_frames)
    return (*["frame"] * frame, *["tool"] * tool)


def _selection(
    calibration: Calibration, data: Measurements, options: EvaluationOptions
) -> tuple[Selection, list[Notice]]:
    """What of the measurements is used: what is kept was fitted, what is found need not have been."""
    if options.keep_frames or options.keep_tool:
        selection, left_out = select_fitted(data, options.use, calibration.selection, options.judge_target)
    else:
        selection, left_out = select(data, options.use, options.judge_target), []
    if selection.distances:
        raise InputError(
            "distances were measured, not points",
            where=", ".join(data.files),
            rule="A calibration is judged at measured points",
        )
    return selection, left_out


def _lost_parts(task: Task, calibration: Calibration, data: Measurements, options: EvaluationOptions) -> Mask:
    """What rows hold and the calibration has not measured in the set-up that is kept (n, t + 1)."""
    held = held_parts(data, task.selection)
    if not (options.keep_frames or options.keep_tool):
        return np.zeros_like(held)
    numbers, chosen = _kept(task, calibration)
    found = calibration.measured.held(chosen)[numbers]
    lost: Mask = held & ~found[[task.groups.index(name) for name in data.group]]
    for group in data.groups if options.keep_tool else ():
        rows = data.group == group
        if (lost[rows] == held[rows]).all():
            never_found(lost[rows], data.select(rows), task.selection)
    return lost


def _found_again(
    found_by: Measurements, judged: Measurements, selection: Selection, options: EvaluationOptions, lost: Mask
) -> tuple[Measurements, list[Notice]]:
    """The judged rows with what is known on the tool, and a notice of what is not.

    `lost` is what of the rows is not known in the set-up that is kept.
    """
    if (options.keep_frames or options.keep_tool) and not selection.judges_another:
        notices = [*never_found(lost, judged, selection), *holding_nothing(judged, selection)]
        return without_parts(lost, judged, selection), notices
    notices = check_judged(found_by, judged, selection)
    return where_found(found_by, judged, selection), notices


def _setup(
    task: Task, calibration: Calibration, name: str, data: Measurements, options: EvaluationOptions
) -> Setup:
    """Frames and tools of a model in the set-ups of `task`, found from rows or kept."""
    model = calibration.models[name]
    if options.keep_frames:
        return _stored(task, calibration, model.setup)
    parameters = model.parameters(model_inputs(task.arm, data, task.options.features))
    if options.keep_tool:
        return _registered(task, calibration, data, parameters, _stored(task, calibration, model.setup))
    return fit_setup(task, data, parameters).setup


def _of_no_use(calibration: Calibration, held: HeldRows, changed: list[Notice]) -> list[Notice]:
    """A warning where the calibration does not help, with what was `changed` if it did before."""
    best, floor_mm = calibration.model_name, distance_at_floor_mm(calibration)
    before_mm, after_mm, what = held.median_mm(NOMINAL), held.median_mm(best), "median error"
    told = no_help(before_mm, after_mm, f"{what} on the rows that were judged", floor_mm, best=best)
    poses = len(np.unique(pose_numbers(held.readings, held.sources)))
    told = FewJudged(held, poses, "judged", best).told(told, before_mm, after_mm, what)
    since = changed_since(calibration, changed, held) if told else []
    return since or (changed if any(notice.kind == UNDECIDED for notice in told) else []) or told


def _moved(
    calibration: Calibration, data: Measurements, options: EvaluationOptions, kept_mm: float
) -> list[Notice]:
    """A warning that the instrument or the tool is elsewhere, where the calibration fits with both found
    anew, or misses far less; with it, if so, that the arm is not as it was either. None where neither can be
    found, or the calibration does not help then.
    """
    try:
        anew = evaluate(calibration, data, replace(options, keep_frames=False, keep_tool=False))
    except TruearmError:
        return []
    best = calibration.model_name
    known_mm, misses = known_mean_mm(calibration), {notice.kind for notice in anew.notices}
    if anew.rows is None or known_mm is None or {NO_HELP, UNDECIDED, FAR_ROWS} & misses:
        return []
    after_mm = anew.rows.median_mm(best)
    fits = NOT_AS_CALIBRATED not in misses and after_mm <= AS_KNOWN * known_mm
    if after_mm > (1.0 if fits else ELSEWHERE) * kept_mm:
        return []
    given = {"--keep-frames": options.keep_frames, "--keep-tool": options.keep_tool}
    with_frame = options.keep_frames and not calibration.arm.world_is_known
    what = "frame and tool" if with_frame else "tool"
    where = "instrument or the target stands" if with_frame else "target sits"
    text = (
        f"With the {what} of the calibration the median error is {length_mm(kept_mm, 4)}, with what can be "
        f"found anew {length_mm(after_mm, 4)}: the {where} elsewhere than then"
        f"{', and the calibration itself fits' if fits else ', or a joint does'}. "
        f"{'Leave' if fits else _told_by_update(calibration, keeps_frame=with_frame)} "
        f"{' and '.join(option for option, is_given in given.items() if is_given)} out."
    )
    beside = [
        Notice(notice.kind, f"With what can be found anew: {notice.message[0].lower()}{notice.message[1:]}")
        for notice in anew.notices
        if notice.kind == NOT_AS_CALIBRATED
    ]
    return [Notice("setup_moved", text), *beside]


def _told_by_update(calibration: Calibration, *, keeps_frame: bool) -> str:
    """How to ask whether a joint moved, where frame and tool found anew take up most of that but not all."""
    if not can_be_updated(calibration):
        return "Leave"
    kept = "--keep-frame --keep-tool" if keeps_frame else "--keep-tool"
    return f"If nobody moved these, truearm update {kept} tells which joint it is. Otherwise leave"


def _gross(
    task: Task,
    calibration: Calibration,
    model: ArmModel,
    frame: Measurements,
    held: tuple[Measurements, HeldRows],
    options: EvaluationOptions,
) -> _Gross:
    """What is told of rows and what they were found by.

    Where frame and tool are found, a robust fit says where the first of them belong.
    """
    finds = {f"finds_{part}": part in _finds(task, options) for part in ("frame", "tool")}
    of_frame = Expected(task, calibration, model, frame, **finds)
    judged = Expected(task, calibration, model, held[0], **finds)
    once = replace(of_frame, data=frame.select(np.unique(pose_numbers(frame.readings, frame.group))))
    gross = gross_judged_rows(judged, once, held[1])
    outliers = gross_rows_told(gross, held[0], held[1])
    changed = not_as_calibrated(judged, once, held[1], gross)
    if finds["finds_tool"]:
        setup = fit_setup(task, frame, of_frame.parameters, robust="cauchy").setup
        of_frame = replace(of_frame, model=replace(model, setup=setup))
    spoiled = gross_frame_rows(of_frame)
    if options.keep_frames or spoiled:
        return _Gross(spoiled, outliers, changed)
    found = FoundSetUps(task, model, frame, options.keep_tool, _lever_m(calibration))
    added = found.notices(held[0], held[1].errors[calibration.model_name])
    return _Gross(spoiled, [*outliers, *added], changed)


def _lever_m(calibration: Calibration) -> float:
    """Noise of positions over that of orientations, m/rad."""
    details = calibration.constant
    return details.noise_m / details.noise_rad if details.noise_rad > 0.0 else ANGLE_ARM_M


def _kept(task: Task, calibration: Calibration) -> tuple[list[int], list[int]]:
    """The calibration's own set-up for each of the task's groups: by name, or its only one; and the places of
    the task's targets among its own.
    """
    known = calibration.groups
    numbers = [
        0 if len(known) == 1 else known.index(group)
        for group in task.groups
        if group in known or len(known) == 1
    ]
    if len(numbers) < len(task.groups):
        missing = [group for group in task.groups if group not in known]
        raise UsageError(
            f"the calibration has no set-up {list_names(missing)}",
            rule=f"It knows {list_names(known)}",
            way_out='Name the set-up that is meant in a column "group"',
        )
    fitted, wanted = calibration.selection.targets, task.selection.targets
    lacking = [target + 1 for target in wanted if target not in fitted]
    if lacking:
        raise UsageError(
            f"target {lacking[0]} took no part in the calibration",
            rule="Only what was fitted can be kept",
            way_out="Give --use position, or let the set-up be found",
        )
    return numbers, [fitted.index(target) for target in wanted]


def _stored(task: Task, calibration: Calibration, setup: Setup) -> Setup:
    """The calibration's own set-up for each of the task's groups, with the task's targets."""
    numbers, chosen = _kept(task, calibration)
    return Setup(
        np.ascontiguousarray(setup.frames[numbers]),
        np.ascontiguousarray(setup.targets[numbers][:, chosen]),
        np.ascontiguousarray(setup.rotations[numbers]),
        setup.anchors,
    )


def _registered(
    task: Task, calibration: Calibration, data: Measurements, parameters: Floats, known: Setup
) -> Setup:
    """Frames from the rows, with the tools of `known`."""
    if task.arm.world_is_known:
        return known
    joints = task.arm.robot.joints_from_readings(data.readings)
    flange = task.arm.flange_chain.pose(joints, parameters)
    measured, turned = data.targets[:, list(task.selection.targets)], rotations(data)
    frames, lever_m = [], _lever_m(calibration)
    for number, group in enumerate(task.groups):
        rows = data.group == group
        points = flange[rows, None, :3, 3] + np.einsum(
            "nij,tj->nti", flange[rows, :3, :3], known.targets[number]
        )
        seen = np.isfinite(measured[rows]).all(axis=2)
        with_turn = np.isfinite(turned[rows]).all(axis=(1, 2)) & task.selection.orientation
        predicted = flange[rows][with_turn, :3, :3] @ known.rotations[number]
        # Where no row holds what is known on the tool nothing is judged.
        frame = known.frames[number]
        if seen.any():
            frame = register(points[seen], measured[rows][seen], predicted, turned[rows][with_turn], lever_m)
        frames.append(frame)
    return Setup(np.stack(frames), known.targets, known.rotations, known.anchors)
