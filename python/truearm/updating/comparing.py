"""Update a calibration with 10 to 20 new poses: what moved, and whether the old one still holds."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, Literal

import numpy as np

from truearm import kinds
from truearm.calibration import Calibration
from truearm.doubts.admitted import admitted
from truearm.doubts.at_once import STEP_KINDS
from truearm.doubts.of_results import LARGE_MM
from truearm.doubts.slips import Slip
from truearm.doubts.turning_sense import check_turns
from truearm.errors import (
    InputError,
    Notice,
    TooFewError,
    TruearmError,
    UsageError,
    WorkError,
    count_of,
    in_words,
    list_names,
)
from truearm.fits.core_set import Use, select_fitted
from truearm.fits.enough_values import measured_values
from truearm.fits.fitted_rows import known_rows
from truearm.fits.fitting import Task
from truearm.judgement.validation import Errors, mean_distance
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.rows.visits import one_row_a_visit, pose_count
from truearm.solving import FEATURE_RANGE, rows_beyond_learnt
from truearm.stages import Stages, no_stages
from truearm.storage.summary import noise_mm
from truearm.types import Rows
from truearm.update_words import way_out_of_keeping
from truearm.updating.certainty import expected_mm, less_certain
from truearm.updating.estimating import MOST_PARTS, Estimate, begun, estimate
from truearm.updating.kept_parts import KeptParts
from truearm.updating.meanwhile import meanwhile
from truearm.updating.moved import Judge, Motion, Offset, motions, offsets, untold
from truearm.updating.options import UpdateOptions
from truearm.updating.revisits import shots_of
from truearm.updating.scale import known_scale, silent_rows
from truearm.updating.scattering import Scatter
from truearm.updating.scene import Scene, State
from truearm.updating.some_poses import some_poses
from truearm.updating.squares import SquaresTest, change_test, rest_test
from truearm.updating.unknowns import Unknowns
from truearm.updating.unsupported import unsupported
from truearm.updating.updated import noted, updated
from truearm.updating.validating import errors_at_left_out, left_out_errors

Verdict = Literal["holds", "moved", "field"]

MOST_OUTLIERS: Final = 0.2
FOUND_FROM: Final = 3
"""Poses of a set-up that find its frame and target when others are left out."""
IMPLAUSIBLE: Final = 5.0
"""An estimate of an offset so many standard deviations off, of what the prior lets it be, is not believed."""


@dataclass(frozen=True, eq=False)
class Update:
    """What new measurements say about an old calibration.

    `update` makes one.

    Attributes:
        calibration: With offsets, frames and tools estimated again; the old one is kept in it.
        verdict: "holds": the old calibration still does. "moved": offsets, tool or the base of a known
            world changed, and the field still fits. "field": what is left is more than field and noise may
            leave.
        level: Share of unchanged arms that are not said to hold. `changed` and `rest` share it.
        offsets: Of the joints.
        frames: Motions of the set-ups' frames, where the calibration knows them; in a known world that of
            the base.
        tools: Motions of the targets, where the calibration knows them.
        changed: The test of offsets and tool, and of the base of a known world.
        rest: The test of what is left.
        before: Errors of the old calibration in each row, its frame found from the other poses.
        after: The same with offsets and tool found from the other poses too.
        n_poses: Poses that were used, outliers among them, each once however often it was visited.
        outliers: Data rows that were left out, of a visit all its shots.
        notices: What the user should know.
        expected_mm: Where the old calibration holds, its expected standard deviation over the poses that it
            was learned from, and that of the updated one, of what frame and target, found anew, do not take
            over; root of the sum of squares of x, y and z. None where it does not hold.
    """

    calibration: Calibration
    verdict: Verdict
    level: float
    offsets: tuple[Offset, ...]
    frames: tuple[Motion, ...]
    tools: tuple[Motion, ...]
    changed: SquaresTest
    rest: SquaresTest
    before: Errors
    after: Errors
    n_poses: int
    outliers: tuple[int, ...]
    notices: tuple[Notice, ...] = ()
    expected_mm: tuple[float, float] | None = None

    def __repr__(self) -> str:
        poses, outliers = count_of(self.n_poses, "pose"), count_of(len(self.outliers), "outlier")
        return f"<Update of {self.calibration.robot.name}: {self.verdict}, {poses}, {outliers}>"

    @property
    def threshold(self) -> float:
        """Below which the p of each of the two tests counts: half the level."""
        return _threshold(self.level)

    @property
    def estimated(self) -> tuple[str, ...]:
        """What was estimated: "offsets", and unless kept "frame" (in a known world "base") and "tool"."""
        return ("offsets", *(name for name in (self._frame, "tool") if name not in self.kept))

    @property
    def kept(self) -> tuple[str, ...]:
        """What of "frame" (in a known world "base") and "tool" was kept as it was."""
        parts = ((self._frame, self.frames), ("tool", self.tools))
        return tuple(name for name, found in parts if found and all(motion.kept for motion in found))

    @property
    def tested(self) -> tuple[str, ...]:
        """What was tested for a change: "offsets", and unless kept the "base" of a known world, and "tool"
        unless it is another one.
        """
        parts = ((self._frame, self.frames), ("tool", self.tools))
        compared = (name for name, found in parts if any(motion.p is not None for motion in found))
        return ("offsets", *compared)

    @property
    def _frame(self) -> str:
        """What says where the arm stands: "frame", or in a known world "base"."""
        return "base" if self.calibration.arm.world_is_known else "frame"

    @property
    def is_less_certain(self) -> bool:
        """Whether the old calibration is to be kept: it holds, and is clearly the more certain of the two."""
        return bool(less_certain(self.expected_mm))

    def _expected(self) -> dict[str, float | None]:
        before, after = self.expected_mm or (None, None)
        return {"expected_before_mm": before, "expected_after_mm": after}

    @property
    def changed_meanwhile(self) -> bool:
        """Whether something stood otherwise from some row on: the arm is then not told as changed by it."""
        return any(notice.kind in STEP_KINDS for notice in self.notices)

    def to_dict(self) -> dict[str, Any]:
        """JSON values, without the calibration."""
        return {
            "verdict": self.verdict,
            "level": self.level,
            "threshold": self.threshold,
            "n_poses": self.n_poses,
            "outliers": list(self.outliers),
            "estimated": list(self.estimated),
            "tested": list(self.tested),
            "offsets": [entry.to_dict() for entry in self.offsets],
            "frames": [entry.to_dict() for entry in self.frames],
            "tools": [entry.to_dict() for entry in self.tools],
            "changed": self.changed.to_dict(),
            "rest": self.rest.to_dict(),
            "before": self.before.to_dict(),
            "after": self.after.to_dict(),
            **self._expected(),
            "notices": in_words(self.notices),
        }


def update(
    calibration: Calibration,
    data: Measurements | Sequence[Measurements],
    options: UpdateOptions | None = None,
    *,
    stages: Stages | None = None,
    **more: Any,
) -> Update:
    """Take a calibration over to the arm as it is now, after re-mastering, a crash or a change of motor.

    Offsets of the joints, frames and tools are estimated again under wide Gaussian priors; the field stays,
    and what it leaves uncertain is correlated noise.

    Args:
        calibration: With its measurements.
        data: New measurements of the same arm, of 10 to 20 poses all over the workspace. Of more than 1500
            measured values (500 points) so many are used, spread evenly over the poses.
        options: What may have moved; defaults without them.
        stages: Called with the name of each stage; gives a context manager that surrounds it; None
            for nobody.
        **more: The same options as keywords, such as keep_frame=True.

    Raises:
        UsageError: If options contradict each other or the data.
        InputError: If the data cannot be of this arm, or has too few rows.
        WorkError: If the calibration is of a scheme, has a field and is stripped, or does not tell from how
            many values its scale is known; or if what is found is not plausible.
    """
    chosen, stages = kinds.chosen(UpdateOptions, options, more), stages or no_stages
    calibration, data = kinds.required(calibration, Calibration, "the calibration"), Measurements.of(data)
    data, notices = admitted(data, calibration.robot)
    notices += [*known_rows(calibration, data), *rows_beyond_learnt(calibration, data)]
    given, merged = data, one_row_a_visit(data)
    task, left_out = _task(calibration, merged, chosen, stages)
    data, unused = some_poses(merged, task.selection)
    if unused:
        task, left_out = _task(calibration, data, chosen, stages)
    notices += [*unused, *silent_rows(calibration, data), *left_out]
    if task.selection.orientation:
        check_turns(data, calibration.robot)
    unknowns = Unknowns.of(calibration, task, chosen, data)
    _check_kept(calibration, task, unknowns, chosen)
    _check_enough(data, task, unknowns)
    _check_groups(data, task)
    with stages("asking what the calibration expects"):
        _ = calibration.spread
    with stages("finding what moved"):
        rows = _Rows.of(Scene(task, data, calibration, unknowns))
        held = untold(rows.scene, rows.scatter, rows.scene.unchanged(rows.start))
        if held:
            rows = _Rows.of(Scene(task, data, calibration, unknowns.holding(held)))
        rows, outliers = _without_outliers(calibration, rows)
        _check_groups(rows.scene.data, task)
        found = _Found(calibration, rows, chosen, held)
        shots = shots_of(data.select(outliers), merged, given)
        told = (*notices, *_outlier_notices(given, shots))
        return found.told(pose_count(data), given.rows[shots].tolist(), told)


def slipped_meanwhile(calibration: Calibration, data: Measurements, use: Use | None = None) -> list[Slip]:
    """What stood otherwise from some row on while an arm was measured that is not as it was calibrated.

    Args:
        calibration: The calibration.
        data: The new measurements.
        use: What of them to use.

    Returns:
        Nothing where an update cannot be made of them.
    """
    try:
        data = one_row_a_visit(data)
        options = UpdateOptions(use=use)
        data, _ = some_poses(data, _task(calibration, data, options, no_stages)[0].selection)
        task, _ = _task(calibration, data, options, no_stages)
        unknowns = Unknowns.of(calibration, task, options, data)
        rows, _ = _without_outliers(calibration, _Rows.of(Scene(task, data, calibration, unknowns)))
        return meanwhile(rows.scene, estimate(rows.scene, rows.scatter, rows.start, unknowns.free))
    except TruearmError:
        return []


@dataclass(frozen=True, eq=False)
class _Rows:
    """Measurements, where the search for what moved begins, and how an unchanged arm may scatter there."""

    scene: Scene
    start: State
    scatter: Scatter

    @classmethod
    def of(cls, whole: Scene) -> "_Rows":
        scene, start = begun(whole)
        return cls(scene, start, Scatter(scene.covariance(start)))

    @property
    def visit_by_visit(self) -> "_Rows":
        """The same, with visits to a pose that vouch for one another as poses do."""
        scene = self.scene.visit_by_visit
        return (
            self if scene is self.scene else _Rows(scene, self.start, Scatter(scene.covariance(self.start)))
        )


@dataclass(frozen=True, eq=False)
class _Found:
    """A calibration, the measurements that count, and joints that are not told."""

    calibration: Calibration
    rows: _Rows
    options: UpdateOptions
    held: dict[int, str]

    def told(self, poses: int, outliers: list[int], notices: tuple[Notice, ...]) -> Update:
        """What the measurements say, from so many poses; `outliers` are the rows that do not count."""
        scene, start, scatter = self.rows.scene, self.rows.start, self.rows.scatter
        unknowns, level = scene.unknowns, self.options.level
        found = estimate(scene, scatter, start, unknowns.free)
        _check_plausible(scene, found, notices)
        anew = unknowns.free & unknowns.anew
        still = estimate(scene, scatter, scene.unchanged(start), anew)
        known = known_scale(self.calibration).freedom
        changed, rest = change_test(still, unknowns, known), rest_test(found, unknowns, known)
        judge = Judge.of(changed, _threshold(level), unknowns, known)
        verdict = _verdict(changed, rest, level)
        if verdict == "field":
            # What is left says itself how much it scatters, and the calibration no longer does.
            found = replace(found, covariance=found.covariance * max(rest.squares / rest.freedom, 1.0))
            judge = replace(judge, known=min(judge.known, rest.freedom))
        frames, tools = motions(scene, found, judge)
        kept = KeptParts(self.calibration, scene, {tool.group for tool in tools if tool.moved})
        notices = (*notices, *kept.notices, *(slip.notice for slip in self._slipped(found)))
        judged = left_out_errors(self.calibration, scene, found)
        told = Update(
            calibration=self.calibration,
            verdict=verdict,
            level=level,
            offsets=offsets(scene, found, self.held, judge),
            frames=frames,
            tools=tools,
            changed=changed,
            rest=rest,
            before=errors_at_left_out(scene, still, anew).statistics(),
            after=judged[self.calibration.model_name].statistics(),
            n_poses=poses,
            outliers=tuple(outliers),
            notices=notices,
        )
        report = {**told.to_dict(), "options": asdict(self.options)}
        return _with_certainty(told, updated(kept, found, judged, report, notices))

    def _slipped(self, found: Estimate) -> list[Slip]:
        """What stood otherwise from some row on; not what was kept, or nearly, and did so from the first."""
        if self.options.keep_frame or self.options.keep_tool or self.options.are_narrow:
            return slipped_meanwhile(self.calibration, self.rows.scene.data, self.options.use)
        return meanwhile(self.rows.scene, found)


def _with_certainty(told: Update, new: Calibration) -> Update:
    """What the measurements say, of the updated calibration, and which of the two is the more certain."""
    if told.verdict != "holds":
        return replace(told, calibration=new)
    expected = expected_mm(told.calibration, new)
    told = replace(told, expected_mm=expected, notices=(*told.notices, *less_certain(expected)))
    return replace(told, calibration=noted(new, told.to_dict(), told.notices))


def _threshold(level: float) -> float:
    """The level of each of the two tests, which share it."""
    return level / 2.0


def _verdict(changed: SquaresTest, rest: SquaresTest, level: float) -> Verdict:
    """What two tests, which share the level, say together."""
    if rest.p < _threshold(level):
        return "field"
    return "moved" if changed.p < _threshold(level) else "holds"


def _task(
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


def _check_kept(calibration: Calibration, task: Task, unknowns: Unknowns, options: UpdateOptions) -> None:
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


def _check_enough(data: Measurements, task: Task, unknowns: Unknowns) -> None:
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


def _check_groups(data: Measurements, task: Task) -> None:
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


def _without_outliers(calibration: Calibration, all_rows: _Rows) -> tuple[_Rows, list[int]]:
    """Rows without those that no other row supports, the worst one taken out first; and these.

    Where they would be too many, it is not the rows that are wrong: all are kept.
    """
    whole, rows = all_rows.scene, all_rows
    std, free = whole.unknowns.std, whole.unknowns.free
    kept, out = np.arange(len(whole.data)), list[int]()
    most = int(MOST_OUTLIERS * len(whole.data))
    while True:
        judged = rows.visit_by_visit
        found = estimate(judged.scene, judged.scatter, judged.start, free)
        alone = unsupported(found, std, free, most + 1 - len(out))
        if not alone:
            return rows, out
        out += kept[alone].tolist()
        if len(out) > most:
            return all_rows, []
        kept = np.delete(kept, alone)
        rows = _Rows.of(Scene(whole.task, whole.data.select(kept), calibration, whole.unknowns))


def _outlier_notices(data: Measurements, outliers: Rows) -> list[Notice]:
    if not len(outliers):
        return []
    which = np.isin(np.arange(len(data)), outliers)
    text = f"No other pose supports what was measured in {data.row_names(which)}: left out."
    return [Notice("outliers", text, tuple(data.rows[which].tolist()))]


def _check_plausible(scene: Scene, found: Estimate, notices: Sequence[Notice]) -> None:
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
