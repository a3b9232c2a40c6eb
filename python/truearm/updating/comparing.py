"""Update a calibration with 10 to 20 new poses: what moved, and whether the old one still holds."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from truearm import kinds
from truearm.calibration import Calibration
from truearm.doubts.admitted import admitted
from truearm.doubts.at_once import STEP_KINDS
from truearm.doubts.slips import Slip
from truearm.doubts.turning_sense import check_turns
from truearm.errors import (
    Notice,
    TruearmError,
    count_of,
    in_json,
)
from truearm.fits.core_set import Use
from truearm.fits.fitted_rows import known_rows
from truearm.judgement.validation import Errors
from truearm.measurements import Measurements
from truearm.rows.visits import one_row_a_visit, pose_count
from truearm.solving import rows_beyond_learnt
from truearm.stages import Stages, no_stages
from truearm.types import Rows
from truearm.updating.certainty import expected_mm, less_certain
from truearm.updating.checks import (
    check_enough,
    check_groups,
    check_kept,
    check_plausible,
    check_scale,
    task_of_update,
)
from truearm.updating.estimating import estimate
from truearm.updating.explaining import Explaining, Explanation
from truearm.updating.kept_parts import KeptParts
from truearm.updating.meanwhile import meanwhile
from truearm.updating.moved import Judge, Motion, Offset, motions, offsets
from truearm.updating.options import UpdateOptions, threshold_of
from truearm.updating.other_cause import OtherCause, instead_notices
from truearm.updating.revisits import shots_of
from truearm.updating.scale import known_scale, silent_rows
from truearm.updating.scene import Scene
from truearm.updating.some_poses import some_poses
from truearm.updating.squares import SquaresTest
from truearm.updating.supported import JudgedRows, without_outliers
from truearm.updating.unknowns import Unknowns
from truearm.updating.updated import noted, updated
from truearm.updating.validating import errors_at_left_out, left_out_errors

Verdict = Literal["holds", "moved", "scale", "load", "field"]


@dataclass(frozen=True, eq=False)
class Update:
    """What new measurements say about an old calibration.

    `update` makes one.

    Attributes:
        calibration: With offsets, frames and tools estimated again; the old one is kept in it.
        verdict: "holds": the old calibration still does. "moved": offsets, tool or the base of a known
            world changed, and the field still fits. "scale", "load": a common scale of all lengths, or joints
            that give way as under another weight, explain with these what was measured. "field": what is left
            is more than field and noise may leave.
        level: Share of unchanged arms that are not said to hold. `changed` and `rest` share it.
        offsets: Of the joints.
        frames: Motions of the set-ups' frames, where the calibration knows them; in a known world that of
            the base.
        tools: Motions of the targets, where the calibration knows them.
        cause: What else was at work, where the verdict is "scale" or "load"; else None.
        changed: The test of offsets and tool, and of the base of a known world.
        rest: The test of what is left.
        before: Errors of the old calibration in each row, its frame found from the other poses.
        after: The same with offsets, tool and what else was at work found from the other poses too.
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
    cause: OtherCause | None = None

    def __repr__(self) -> str:
        poses, outliers = count_of(self.n_poses, "pose"), count_of(len(self.outliers), "outlier")
        return f"<Update of {self.calibration.robot.name}: {self.verdict}, {poses}, {outliers}>"

    @property
    def threshold(self) -> float:
        """Below which the p of each of the two tests counts: half the level."""
        return threshold_of(self.level)

    @property
    def estimated(self) -> tuple[str, ...]:
        """What was estimated: "offsets", unless kept "frame" (in a known world "base") and "tool", and
        "scale" or "load" where that was found.
        """
        parts = (name for name in (self._frame, "tool") if name not in self.kept)
        return ("offsets", *parts, *([] if self.cause is None else [self.cause.name]))

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
            "cause": None if self.cause is None else self.cause.to_dict(),
            "changed": self.changed.to_dict(),
            "rest": self.rest.to_dict(),
            "before": self.before.to_dict(),
            "after": self.after.to_dict(),
            **self._expected(),
            "notices": in_json(self.notices),
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
    task, left_out = task_of_update(calibration, merged, chosen, stages)
    data, unused = some_poses(merged, task.selection)
    if unused:
        task, left_out = task_of_update(calibration, data, chosen, stages)
    notices += [*unused, *silent_rows(calibration, data), *left_out]
    if task.selection.orientation:
        check_turns(data, calibration.robot)
    unknowns = Unknowns.of(calibration, task, chosen, data)
    check_kept(calibration, task, unknowns, chosen)
    check_scale(calibration, chosen)
    check_enough(data, task, unknowns)
    check_groups(data, task)
    with stages("asking what the calibration expects"):
        _ = calibration.spread
    with stages("finding what moved"):
        asked = Explaining(calibration, task, data, chosen, unknowns)
        said = asked.likeliest
        shots = shots_of(data.select(said.outliers), merged, given)
        told = (*notices, *_outlier_notices(given, shots), *instead_notices(asked.instead))
        return _told(said, chosen, pose_count(data), given.rows[shots].tolist(), told)


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
        asked = _asked(calibration, data, UpdateOptions(use=use))
        scene = Scene(asked.task, asked.data, calibration, asked.unknowns)
        rows, _ = without_outliers(calibration, JudgedRows.of(scene))
        return meanwhile(rows.scene, estimate(rows.scene, rows.scatter, rows.start, asked.unknowns.free))
    except TruearmError:
        return []


def explained_otherwise(
    calibration: Calibration, data: Measurements, use: Use | None = None, *, keep_tool: bool = False
) -> list[Notice]:
    """What else may be at work where an arm is not as it was calibrated: another scale, or another load.

    Args:
        calibration: The calibration.
        data: The new measurements.
        use: What of them to use.
        keep_tool: Whether the tool is taken to be as it was calibrated; else it is found anew.

    Returns:
        Nothing where less explains the measurements, or more is needed, or no update can be made of them.
    """
    try:
        options = UpdateOptions(use=use, keep_tool=keep_tool, new_tool=not keep_tool)
        said = _asked(calibration, data, options).likeliest
        return _cause_notices(said, OtherCause.of(said))
    except TruearmError:
        return []


def _asked(calibration: Calibration, data: Measurements, options: UpdateOptions) -> Explaining:
    """Rows, as an update uses them, and what may have moved."""
    data = one_row_a_visit(data)
    data, _ = some_poses(data, task_of_update(calibration, data, options, no_stages)[0].selection)
    task, _ = task_of_update(calibration, data, options, no_stages)
    return Explaining(calibration, task, data, options, Unknowns.of(calibration, task, options, data))


def _cause_notices(said: Explanation, cause: OtherCause | None) -> list[Notice]:
    """What else was at work, and what to do."""
    has_rails = "prismatic" in said.calibration.robot.joints
    return [] if cause is None else [cause.notice(has_rails=has_rails)]


def _told(
    said: Explanation, options: UpdateOptions, poses: int, outliers: list[int], notices: tuple[Notice, ...]
) -> Update:
    """What measurements say, of so many poses; `outliers` are the rows that do not count."""
    calibration, scene, found = said.calibration, said.rows.scene, said.found
    check_plausible(scene, found, notices)
    changed, rest, cause = said.changed, said.rest, OtherCause.of(said)
    known = known_scale(calibration).freedom
    judge = Judge.of(changed, options.threshold, scene.unknowns, known)
    verdict = _verdict(said, cause)
    if verdict == "field":
        # What is left says itself how much it scatters, and the calibration no longer does.
        found = replace(found, covariance=found.covariance * max(rest.squares / rest.freedom, 1.0))
        judge = replace(judge, known=min(judge.known, rest.freedom))
    frames, tools = motions(scene, found, judge)
    kept = KeptParts(calibration, scene, {tool.group for tool in tools if tool.moved})
    slipped = _slipped(said, options)
    notices = (
        *notices,
        *kept.notices,
        *_cause_notices(said, cause),
        *(slip.notice for slip in slipped),
    )
    judged = left_out_errors(calibration, scene, found)
    told = Update(
        calibration=calibration,
        verdict=verdict,
        level=options.level,
        offsets=offsets(scene, found, said.held, judge),
        frames=frames,
        tools=tools,
        changed=changed,
        rest=rest,
        before=errors_at_left_out(scene, said.still, scene.unknowns.free & scene.unknowns.anew).statistics(),
        after=judged[calibration.model_name].statistics(),
        n_poses=poses,
        outliers=tuple(outliers),
        notices=notices,
        cause=cause,
    )
    report = {**told.to_dict(), "options": asdict(options)}
    return _with_certainty(told, updated(kept, found, judged, report, notices))


def _slipped(said: Explanation, options: UpdateOptions) -> list[Slip]:
    """What stood otherwise from some row on; not what was kept, or nearly, and did so from the first."""
    if options.keep_frame or options.keep_tool or options.are_narrow:
        return slipped_meanwhile(said.calibration, said.rows.scene.data, options.use)
    return meanwhile(said.rows.scene, said.found)


def _with_certainty(told: Update, new: Calibration) -> Update:
    """What the measurements say, of the updated calibration, and which of the two is the more certain."""
    if told.verdict != "holds":
        return replace(told, calibration=new)
    expected = expected_mm(told.calibration, new)
    told = replace(told, expected_mm=expected, notices=(*told.notices, *less_certain(expected)))
    return replace(told, calibration=noted(new, told.to_dict(), told.notices))


def _verdict(said: Explanation, cause: OtherCause | None) -> Verdict:
    """What the tests, which share the level, say together."""
    if cause is not None:
        return cause.name
    if said.rest.p < said.threshold:
        return "field"
    return "moved" if said.changed.p < said.threshold else "holds"


def _outlier_notices(data: Measurements, outliers: Rows) -> list[Notice]:
    if not len(outliers):
        return []
    which = np.isin(np.arange(len(data)), outliers)
    text = f"No other pose supports what was measured in {data.row_names(which)}: left out."
    return [Notice("outliers", text, tuple(data.rows[which].tolist()))]
