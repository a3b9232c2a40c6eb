"""`truearm evaluate`: errors of a calibration on other measurements."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from truearm.cli.arguments import AngleUnit, AsJson, CalibFile, LengthUnit, MeasurementFiles, Use
from truearm.cli.console import print_json, say, suggest, warn
from truearm.cli.given import given_options
from truearm.cli.interrupt import ends_promptly
from truearm.cli.next_commands import compensate_commands
from truearm.cli.progress import told_stages
from truearm.defaults import FIRST_TARGET, SEED
from truearm.errors import typed

if TYPE_CHECKING:
    from truearm.calibration import Calibration
    from truearm.evaluation import Evaluation

NOT_OF_UPDATE: Final = ("seed", "judge_target", "frame_rows", "keep_tool", "keep_frames", "as_json")
"""Options of an evaluation that an update has not, or not in this sense."""


def command(
    context: typer.Context,
    calibration: CalibFile,
    measurements: MeasurementFiles,
    seed: Annotated[int, typer.Option(help="Seed of the draw of frame rows.")] = SEED,
    use: Use = None,
    judge_target: Annotated[int, typer.Option(metavar="K", help="Judge at this target.")] = FIRST_TARGET,
    frame_rows: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Rows used to find frame and tool (shots of a pose stay together).  [default: a third, or "
            "more for enough values; 400 poses at most]",
        ),
    ] = None,
    keep_tool: Annotated[
        bool, typer.Option("--keep-tool", help="Keep the tool; only the frame is found.")
    ] = False,
    keep_frames: Annotated[
        bool, typer.Option("--keep-frames", help="Keep frame and tool, and judge all rows.")
    ] = False,
    length_unit: LengthUnit = None,
    angle_unit: AngleUnit = None,
    as_json: AsJson = False,
) -> None:
    """Judge a calibration on measurements of another day or another set-up.

    Some rows find where the device and the tool are now, for each model alone; the others are judged.

    Examples:
      truearm evaluate result/calibration.calib another_day.csv
      truearm evaluate result/calibration.calib other.csv --keep-tool --json
    """
    from truearm.calibration import Calibration
    from truearm.cli.error_tables import print_errors
    from truearm.evaluation import EvaluationOptions, evaluate
    from truearm.measurements import Measurements

    options = EvaluationOptions(
        seed=seed,
        use=use,  # type: ignore[arg-type]
        frame_rows=frame_rows,
        keep_tool=keep_tool,
        keep_frames=keep_frames,
        judge_target=judge_target,
    )
    known = Calibration.load(calibration)
    data = Measurements.read_files(
        measurements, length_unit=length_unit, angle_unit=angle_unit, joints=known.robot.joints
    )
    with ends_promptly():
        found = evaluate(known, data, options, stages=told_stages())
    warn(found.notices)
    if as_json:
        print_json(found.to_dict())
        return
    say(f"{known.robot.name}: {_found_words(found)}, {found.judged_in_words} judged.")
    print_errors(found.errors, found.judged_in_words)
    others = " ".join(map(typed, measurements))
    update = f"truearm update {typed(calibration)} {others}{given_options(context, *NOT_OF_UPDATE)}"
    suggest(
        f"truearm report {typed(calibration)} {others} -o other.html",
        *_next_commands(found, known, calibration, update),
    )


def _found_words(found: "Evaluation") -> str:
    """What the rows of the frame found, if anything."""
    if not found.finds:
        return "frame and tool kept"
    the = "the " if len(found.finds) == 1 else ""
    return f"{found.frame_in_words} found {the}{' and '.join(found.finds)}"


def _next_commands(found: "Evaluation", known: "Calibration", file: Path, update: str) -> list[str]:
    """What to do with a calibration that was judged: `update` it where the arm is not as it was."""
    from truearm.doubts.as_calibrated import NOT_AS_CALIBRATED, can_be_updated
    from truearm.doubts.at_once import STEP_KINDS
    from truearm.doubts.few_judged import UNDECIDED
    from truearm.doubts.gross_rows import FAR_ROWS
    from truearm.doubts.of_results import OF_NO_USE

    kinds = {notice.kind for notice in found.notices}
    if kinds & set(STEP_KINDS):
        return []
    if NOT_AS_CALIBRATED in kinds:
        return [update] if can_be_updated(known) else []
    return [] if kinds & {*OF_NO_USE, UNDECIDED, FAR_ROWS} else compensate_commands(known, file)
