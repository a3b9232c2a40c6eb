"""From a program and a calibration to the program that hits: the whole way, whatever the language."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from truearm.compensation import Refusal
from truearm.controller import Controller
from truearm.errors import Notice, WorkError, count_of
from truearm.files import make_directory
from truearm.inverse import Inverse
from truearm.kinds import check_number, check_positive, check_values, required
from truearm.programs.corrections import Compensator
from truearm.programs.densify import Densifier, Deviating, Inserted, Spacing, deviation_notices
from truearm.programs.editing import Words, edited
from truearm.programs.encoding import Encoder, encode_targets
from truearm.programs.environment import Frame, author_of
from truearm.programs.frames import Frames
from truearm.programs.helping import (
    FRAMES_UNSURE,
    KEEP_NOMINAL,
    NOT_REACHED,
    TOO_FAR,
    measured_there,
    what_helps,
)
from truearm.programs.left_open import left_open_mm
from truearm.programs.listing import describe, listed_target
from truearm.programs.marks import refuse_marked
from truearm.programs.offsets import ALSO_OFFSET, Offsets, also_with_offsets, offset_notices
from truearm.programs.open_turns import depending_on_turns
from truearm.programs.outputs import output_paths, write_outputs
from truearm.programs.path_steps import step_notices
from truearm.programs.program import Language, Listed, Program, StepTexts
from truearm.programs.solving import Solved, are_singular, solve_targets
from truearm.programs.source import Source
from truearm.programs.tables import placed, run_of
from truearm.programs.uses import SEVERAL, Uses, target_count
from truearm.robot import Robot
from truearm.types import Floats, Integers, Mask, Transform

NO_SMALL_CHANGE: Final = (*NOT_REACHED, TOO_FAR)
STRETCHED: Final = "it lies at a singularity, where no small change of the joints makes the correction"
TARGET_COLUMNS: Final = (
    "nominal", "corrected", "changed", "correction_mm", "correction_mrad", "std_mm", "residual_mm",
    "residual_mrad", "moved_mm", "offset_mm", "offset_mrad",
)  # fmt: skip
"""Columns of what was rewritten, a row for each target."""
ON_REFUSAL: Final = ("stop", KEEP_NOMINAL)
Tell = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Models:
    """The arms that a program is rewritten between.

    Attributes:
        programming: What the program's author used.
        inverse: Its inverse kinematics.
        controller: What the controller computes with.
        compensator: From programming to calibrated.
        task: What it meets; another than "pose" needs to know the tool for joint targets as well.
        whole_poses: Whether enough joints move to meet position and orientation: the correction of a joint
            target does not depend on the tool then.
        positions_only: Whether the calibration was fitted to positions alone.
        beyond: In words, features that lie beyond what it was fitted to.
        largest_std_mm: Standard deviation that is allowed, tool and work object included; None for any.
    """

    programming: Robot
    inverse: Inverse
    controller: Controller
    compensator: Compensator
    task: str = "pose"
    whole_poses: bool = True
    positions_only: bool = False
    beyond: tuple[str, ...] = ()
    largest_std_mm: float | None = None


@dataclass(frozen=True)
class Choices:
    """What the user decides.

    Attributes:
        on_refusal: "stop", or "keep-nominal" to leave refused targets as they are where that makes no step.
        force: Rewrite a program that bears a mark.
        spacing: How waypoints are inserted on long lines; None inserts none.
        language: Name of the program's language; by the ending without.
        offsets_mm: How far off the tool's place may be where a target is used with an offset that is changed
            for its use as it stands; None changes no target that is used with offsets as well.

    Raises:
        UsageError: If `on_refusal` is another word, `spacing` is no Spacing, or the length is not above 0.
    """

    on_refusal: Literal["stop", "keep-nominal"] = "stop"
    force: bool = False
    spacing: Spacing | None = None
    language: str | None = None
    offsets_mm: float | None = None

    def __post_init__(self) -> None:
        check_values(self, choices={"on_refusal": ON_REFUSAL})
        if self.offsets_mm is not None:
            check_number(self.offsets_mm, "--offsets-mm")
            check_positive(self.offsets_mm, "--offsets-mm")
        if self.spacing is not None:
            required(self.spacing, Spacing, "the spacing")


@dataclass(frozen=True, eq=False)
class Rewritten:
    """A program with corrected targets.

    `compensate_program` makes one.

    Attributes:
        program: The program as it was.
        contents: The bytes of its files now.
        nominal: Readings that the author meant, with tools and work objects as the controller has them,
            (t, N); NaN where they are not known.
        corrected: Readings that the program says now, (t, N); the nominal ones where it was left as it was.
            Of via points of which only the position counts: those in which the arc passes them.
        changed: Targets that were changed, (t,).
        correction_mm: How far the tool's target moved from where the program said it, for the controller's
            tool, (t,); NaN where it was not changed. Like the next four, the largest where a joint target has
            several tools.
        correction_mrad: How far it turned, (t,).
        std_mm: Standard deviation of the tool's place there, (t,): of the calibration, of the tool and, for
            Cartesian targets, of the work object, as far as the frames file tells theirs. As in `Compensated`
            the calibration's is exact with constants alone, and a bound with a variable model.
        residual_mm: How far from its place the tool stays, (t,): more than rounding where fewer joints may
            move than the task needs.
        residual_mrad: How far turned from it, (t,).
        moved_mm: How far the position moved that the program says, (t,): that of a Cartesian target in its
            work object, as the controller computes it; NaN for joint targets.
        offset_mm: How far off the tool is at most where a target is used with an offset, (t,), as it was
            changed for its use as it stands; NaN for targets without such uses.
        offset_mrad: How far turned it is at most there, (t,).
        kept: Targets that were refused and kept as they were, with the reason.
        listed: What was left as it was because it cannot be changed with certainty.
        inserted: How many waypoints were inserted.
        deviating: Linear moves that deviate, or may, by more than was allowed, and got no waypoints.
        notices: What the user should know.
        facts: With what it was rewritten, for the report.
    """

    program: Program
    contents: tuple[bytes, ...]
    nominal: Floats
    corrected: Floats
    changed: Mask
    correction_mm: Floats
    correction_mrad: Floats
    std_mm: Floats
    residual_mm: Floats
    residual_mrad: Floats
    moved_mm: Floats
    offset_mm: Floats
    offset_mrad: Floats
    kept: tuple[Listed, ...]
    listed: tuple[Listed, ...]
    inserted: int = 0
    deviating: tuple[Deviating, ...] = ()
    notices: tuple[Notice, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        done = f"{int(self.changed.sum())} of {count_of(target_count(self.program), 'target')} changed"
        name = self.program.sources[0].path.name
        return f"<Rewritten {name}: {done}, {len(self.kept)} kept, {len(self.listed)} listed>"

    def with_facts(self, facts: Mapping[str, Any], notices: Sequence[Notice]) -> "Rewritten":
        """The same with facts for the report, and more notices."""
        return replace(self, facts=facts, notices=(*notices, *self.notices))

    def refuse_unchanged(self) -> None:
        """Raise WorkError where no target was changed: a copy would pass for a compensated program."""
        if self.changed.any():
            return
        count = target_count(self.program)
        raise WorkError(
            f"nothing was changed: {f'none of {count} targets can be' if count else 'it has no targets'}"
            f"{' corrected with certainty' if count else ''}",
            where=str(self.program.sources[0].path),
            rule="A program is written only where something in it is corrected",
            way_out="--dry-run lists each target with the reason" if count else "",
        )

    def save(self, output: str | Path) -> list[Path]:
        """Write the program's files, each beside its place and then moved there; their paths.

        Args:
            output: The file, further ones getting its name with their endings; or a directory for files of
                the same names, which is made where a slash at its end says that it is one.

        Raises:
            UsageError: If it is the program itself.
            InputError: If a directory does not exist or may not be written to.
            WorkError: If no target was changed.
        """
        self.refuse_unchanged()
        if str(output).endswith("/"):
            make_directory(Path(output))
        paths = output_paths([source.path for source in self.program.sources], output)
        write_outputs(paths, self.contents)
        return paths


def read_program(path: Path, language: Language, robot: Robot, frames: Frames) -> Program:
    """The program at `path`, with the files that belong to it."""
    sources = [Source.load(file) for file in (path, *language.companions(path))]
    return language.read(sources, robot, frames)


def rewrite(
    program: Program,
    models: Models,
    choices: Choices,
    *,
    mark: str = "",
    tell: Tell = lambda _what, _done, _all: None,
) -> Rewritten:
    """Correct the targets of a program.

    Args:
        program: The program.
        models: The arms it is rewritten between.
        choices: What the user decides.
        mark: What the mark in the program says; none without.
        tell: Called now and then with what is going on, how much is done, and of how much.

    Raises:
        WorkError: If the program bears a mark, or targets were refused and may not be kept as they are.
    """
    if not choices.force:
        refuse_marked(program)
    alike = models.whole_poses
    offsets = None if choices.offsets_mm is None else Offsets.of(program, whole_poses=alike)
    given = _Given(program, Uses.of(program, whole_poses=alike))
    program, uses = (program, given.uses) if offsets is None else (offsets.program, offsets.uses)
    solved = solve_targets(
        program, uses, models.programming, models.inverse, lambda done, all_: tell("targets", done, all_)
    )
    turning = (models.programming, models.compensator)
    solved.reasons.update(depending_on_turns(program, uses, solved.q, solved.open_turns, turning))
    # A product with ones would leave threads of BLAS that spin for a while in the way of the corrections.
    known: Mask = np.isfinite(np.einsum("ij->i", solved.q))
    known[list(solved.reasons)] = False
    known &= uses.moved
    state = _State(program, uses, models, solved, known, tell, given)
    state.reasons.update(solved.reasons)
    for target in also_with_offsets(program) if offsets is None else ():
        if state.reasons.get(target) == SEVERAL:
            state.reasons[target] = ALSO_OFFSET
    state.compensate()
    if offsets is not None and choices.offsets_mm is not None:
        state.agree(offsets, choices.offsets_mm)
    kept = state.settle(choices)
    return _as_given(state.finish(mark, choices, kept), given.program)


def _as_given(done: Rewritten, program: Program) -> Rewritten:
    """What was rewritten of the program that was given, whose targets are the first of those."""
    columns = {name: getattr(done, name)[: len(program.targets)] for name in TARGET_COLUMNS}
    return replace(done, program=program, **columns)


class _Given(NamedTuple):
    """The program that was given, of which is told, and how its targets are used."""

    program: Program
    uses: Uses


def _with_largest(column: Floats, rows: slice | Integers, values: Floats) -> Floats:
    """A column with `values` in some rows, where they are larger than what is there."""
    return placed(column, rows, np.fmax(column[rows], values))


@dataclass(eq=False)
class _State:
    """What is known of the targets while they are corrected."""

    program: Program
    uses: Uses
    models: Models
    solved: Solved
    known: Mask
    tell: Tell
    given: _Given
    reasons: dict[int, str] = field(default_factory=dict)
    refused: dict[int, str] = field(default_factory=dict)
    codes: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.nominal = self.solved.q
        self.corrected = np.broadcast_to(self.nominal, self.nominal.shape)
        unknown = np.broadcast_to(np.nan, len(self.nominal))
        self.correction_mm = self.correction_mrad = self.std_mm = unknown
        self.residual_mm = self.residual_mrad = unknown
        self.offset_mm = self.offset_mrad = unknown
        self.others = self.stands_for = np.empty(0, dtype=np.int64)

    def compensate(self) -> None:
        """Corrected readings of all known targets, tool by tool, in the order of the moves."""
        moving = self.program.moves.moving
        along = self.program.moves.target[moving]
        with_tool = self.uses.tool_of[self.program.moves.environment[moving]]
        for number, example in enumerate(self.uses.tools):
            which = along[self.known[along] & (with_tool == number)]
            if len(which) == 0:
                continue
            tool = self.program.environments[example].tool
            if tool.unknown and self.models.task != "pose":
                self.reasons.update(dict.fromkeys(which.tolist(), tool.unknown))
                self.known[which] = False
                continue
            displaced = self.uses.displaced[which]
            for place in np.unique(displaced).tolist():
                self._correct(which[displaced == place], tool, self.uses.displacements[place])

    def _correct(self, which: Integers, tool: Frame, displacement: Transform | None) -> None:
        """Corrected readings of targets with one tool, in work objects that are displaced alike.

        Of joint targets with several tools what is largest counts.
        """
        rows = run_of(which)
        found = self.models.compensator.joints(
            np.ascontiguousarray(self.nominal[rows]),
            tool=None if tool.unknown else tool.true,
            author=author_of(self.models.programming, tool, displacement),
        )
        self.corrected = placed(self.corrected, rows, found.q)
        self.correction_mm = _with_largest(self.correction_mm, rows, found.correction_mm)
        self.correction_mrad = _with_largest(self.correction_mrad, rows, found.correction_mrad)
        self.residual_mm = _with_largest(self.residual_mm, rows, found.residual_mm)
        self.residual_mrad = _with_largest(self.residual_mrad, rows, found.residual_mrad)
        self._take_refusals(which, found.refusals)
        refused = found.refused | self._judge_std(which, found.std_mm, found.refused, tool)
        self.corrected[which[refused]] = self.nominal[which[refused]]

    def _take_refusals(self, which: Integers, refusals: Sequence[Refusal]) -> None:
        """Refused targets; those at singularities that no small change meets are listed, as poses are."""
        targets = which[[refusal.number - 1 for refusal in refusals]]
        singular = are_singular(self.models.programming, self.nominal[targets])
        for target, refusal, stretched in zip(targets.tolist(), refusals, singular.tolist(), strict=True):
            if stretched and refusal.code in NO_SMALL_CHANGE:
                self.reasons[target] = STRETCHED
                self.known[target] = False
            else:
                self.refused[target] = refusal.reason
                self.codes.add(refusal.code)

    def _judge_std(self, which: Integers, std_mm: Floats, refused: Mask, tool: Frame) -> Mask:
        """Take over standard deviations of targets, with tool and work object; which are too large."""
        rows, largest = run_of(which), self.models.largest_std_mm
        robot = self.models.programming
        added = left_open_mm(self.program, self.uses, which, self.nominal[rows], robot, tool)
        whole = np.hypot(std_mm, added)
        self.std_mm = _with_largest(self.std_mm, rows, whole)
        if largest is None:
            return np.zeros(len(which), dtype=bool)
        beyond = (whole > largest) & (added > 0.0) & ~refused
        for target, open_mm, std in zip(which[beyond].tolist(), added[beyond], whole[beyond], strict=True):
            self.refused[target] = (
                f"tool and work object leave {open_mm:.3f} mm open, which makes a standard deviation of "
                f"{std:.3f} mm, more than {largest:g}"
            )
        if beyond.any():
            self.codes.add(FRAMES_UNSURE)
        return np.asarray(beyond)

    def agree(self, offsets: Offsets, largest_mm: float) -> None:
        """Targets that are used with offsets too stay as they are where one change does not suit all uses."""
        self.others, self.stands_for = offsets.others, offsets.stands_for
        usable = np.array(self.known)
        usable[list(self.refused)] = False
        corrected = replace(self.solved, q=self.corrected)
        judged = offsets.judged(usable, corrected, self.models.controller.robot, largest_mm)
        for target, why in judged.reasons.items():
            if self.known[target] and target not in self.refused:
                self.reasons[target] = why
                self.known[target] = False
        for other in self.others.tolist():
            self.refused.pop(other, None)
            self.reasons.pop(other, None)
        self.known[self.others] = False
        self.offset_mm, self.offset_mrad = judged.off_mm, judged.off_mrad

    def settle(self, choices: Choices) -> tuple[Listed, ...]:
        """Refused targets that are kept as they are, or an error."""
        if not self.refused:
            return ()
        beyond = self.models.beyond
        listed = [self._listed(target, reason) for target, reason in sorted(self.refused.items())]
        if choices.on_refusal != KEEP_NOMINAL:
            raise WorkError(
                f"{len(listed)} of {target_count(self.given.program)} targets cannot be corrected:\n"
                + describe(self.program, listed),
                way_out=what_helps(self.codes, beyond, positions_only=self.models.positions_only),
            )
        steps = [target for target in sorted(self.refused) if self._makes_a_step(target)]
        if steps:
            raise WorkError(
                f"{count_of(len(steps), 'target')} can neither be corrected nor kept:\n"
                + describe(self.program, [self._listed(target, self.refused[target]) for target in steps]),
                rule="Within linear, circular or blended motion an uncorrected target among corrected ones "
                "makes a step",
                way_out=f"{measured_there(beyond)}Change these targets or the limits",
            )
        return tuple(listed)

    def _makes_a_step(self, target: int) -> bool:
        """Whether a target is, at any of its uses, in motion that shows where it is not corrected."""
        return bool(self.given.uses.straight[target] or self.given.uses.blended[target])

    def finish(self, mark: str, choices: Choices, kept: tuple[Listed, ...]) -> Rewritten:
        """The texts, and what is told of them."""
        changed = np.array(self.known)
        changed[list(self.refused)] = False
        written = encode_targets(
            self.program,
            self.uses,
            replace(self.solved, q=self.corrected),
            np.flatnonzero(changed),
            self.models.controller,
        )
        self.reasons.update(written.reasons)
        changed[list(written.reasons)] = False
        suited = np.array(changed)
        suited[self.others] = changed[self.stands_for]
        steps = self._inserted(suited, choices.spacing)
        words: dict[int, list[Words]] = {}
        for new in steps.texts.insertions:
            words.setdefault(new.file, []).append((new.start, new.end, new.text.encode("latin-1")))
        if mark and changed.any():
            for number, source in enumerate(self.program.sources):
                at, line = self.program.language.mark(source, mark)
                words.setdefault(number, []).append((at, at, line.encode("latin-1", "replace")))
        contents = edited(self.program, written, words)
        self._forget(~changed)
        listed = sorted(
            [*self.program.listed, *(self._listed(target, why) for target, why in self.reasons.items())]
        )
        return Rewritten(
            program=self.program,
            contents=tuple(contents),
            nominal=self.nominal,
            corrected=self.corrected,
            changed=changed,
            correction_mm=self.correction_mm,
            correction_mrad=self.correction_mrad,
            std_mm=self.std_mm,
            residual_mm=self.residual_mm,
            residual_mrad=self.residual_mrad,
            moved_mm=written.moved_mm,
            offset_mm=self.offset_mm,
            offset_mrad=self.offset_mrad,
            kept=kept,
            listed=tuple(listed),
            inserted=steps.texts.waypoints,
            deviating=steps.deviating,
            notices=(
                *step_notices(*self.given, changed[: len(self.given.program.targets)]),
                *offset_notices(self.program, self.offset_mm, self.offset_mrad),
                *deviation_notices(self.program, steps.deviating, choices.spacing),
            ),
        )

    def _inserted(self, suited: Mask, spacing: Spacing | None) -> Inserted:
        if spacing is None:
            return Inserted(StepTexts(), ())
        models, controller = self.models, self.models.controller
        encoder = Encoder(self.program, self.uses, controller.robot, controller.inverse)
        of_models = (models.programming, models.inverse, models.compensator)
        densifier = Densifier(self.program, of_models, encoder, spacing)
        return densifier.insert(self.nominal, suited, lambda done, all_: self.tell("lines", done, all_))

    def _forget(self, unchanged: Mask) -> None:
        if not unchanged.any():
            return
        rows, nothing = np.flatnonzero(unchanged), np.full(int(unchanged.sum()), np.nan)
        self.corrected = placed(self.corrected, rows, self.nominal[rows])
        self.correction_mm = placed(self.correction_mm, rows, nothing)
        self.correction_mrad = placed(self.correction_mrad, rows, nothing)
        self.std_mm = placed(self.std_mm, rows, nothing)
        self.residual_mm = placed(self.residual_mm, rows, nothing)
        self.residual_mrad = placed(self.residual_mrad, rows, nothing)
        self.offset_mm = placed(self.offset_mm, rows, nothing)
        self.offset_mrad = placed(self.offset_mrad, rows, nothing)

    def _listed(self, target: int, reason: str) -> Listed:
        return listed_target(self.program, target, reason)
