"""`truearm report`: a calibration's report, as a page or a PDF."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from truearm.cli.arguments import AngleUnit, AsJson, CalibFile, LengthUnit
from truearm.cli.console import print_json, say, say_wrapped, suggest, warn
from truearm.cli.interrupt import ends_promptly
from truearm.cli.progress import told_stages
from truearm.defaults import SEED
from truearm.errors import InputError, UsageError, typed
from truearm.files import check_output, write_whole
from truearm.result_names import CALIBRATION_NAME, REPORT_NAME

if TYPE_CHECKING:
    from truearm.calibration import Calibration
    from truearm.evaluation import Evaluation
    from truearm.reporting.report import Report

PAGE: Final = ".html"
PRINT: Final = ".pdf"

OTHER: Final = "other"
"""Name of the report on other measurements that is proposed."""


def command(
    calibration: CalibFile,
    measurements: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[MEASUREMENTS...]", help="Other measurements to judge it on, CSV files."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="A page or a PDF.  [default: report.html; NAME.html beside another NAME.calib]",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the draw of frame rows.")] = SEED,
    frame_rows: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Rows of MEASUREMENTS that find frame and tool, all shots of a pose with them.  [default: "
            "a third or more, of 400 poses at most]",
        ),
    ] = None,
    length_unit: LengthUnit = None,
    angle_unit: AngleUnit = None,
    as_json: AsJson = False,
) -> None:
    """Write the report of a calibration: one HTML file that opens without a network, or a PDF.

    It says how good the calibration is on poses it has never seen, where to trust it, and what would help
    most next. A PDF needs Chromium on PATH.

    Examples:
      truearm report result/calibration.calib
      truearm report result/calibration.calib another_day.csv -o report.pdf
    """
    from truearm.calibration import Calibration
    from truearm.cli.error_tables import print_errors
    from truearm.reporting.pdf import browser

    target = _beside(calibration) if output is None else output
    if target.suffix.lower() not in (PAGE, PRINT):
        raise UsageError(f"{target}", where="-o", rule=f"A report is a page ({PAGE}) or a PDF ({PRINT})")
    check_output(target, calibration, *(measurements or []))
    if target.suffix.lower() == PRINT:
        browser()
    known, files = Calibration.load(calibration), measurements or []
    with ends_promptly():
        other = _judged(known, files, (length_unit, angle_unit), (seed, frame_rows)) if files else None
        made = make_report(known, target, other, tuple(file.name for file in files))
    if as_json:
        print_json({"report": str(target), **made.to_dict()})
        return
    say_wrapped(made.verdict)
    if other is not None:
        say(f"On {', '.join(file.name for file in files)}:")
        print_errors(other.errors, other.judged_in_words)
    if made.advice:
        say("What would help most next:")
        for entry in made.advice:
            say_wrapped(f"- {entry.name} {entry.words}")
    say(f"Report: {target}")
    if other is None and not known.selection.distances:
        suggest(f"truearm report {typed(calibration)} OTHER.csv -o {typed(target.with_stem(OTHER))}")


def _beside(calibration: Path) -> Path:
    """Where the report of a file goes: several calibrations may lie in one directory."""
    if calibration.is_dir():
        raise InputError("this is a directory", where=str(calibration), rule="A calibration is a file")
    if calibration.name == CALIBRATION_NAME:
        return calibration.with_name(REPORT_NAME)
    return calibration.with_suffix(PAGE)


def _judged(
    known: "Calibration",
    files: list[Path],
    units: tuple[str | None, str | None],
    frames: tuple[int, int | None],
) -> "Evaluation":
    """Errors on other measurements; lengths' and angles' unit, seed and number of frame rows."""
    from truearm.evaluation import EvaluationOptions, evaluate
    from truearm.measurements import Measurements

    length_unit, angle_unit = units
    seed, frame_rows = frames
    data = Measurements.read_files(
        files, length_unit=length_unit, angle_unit=angle_unit, joints=known.robot.joints
    )
    found = evaluate(known, data, EvaluationOptions(seed=seed, frame_rows=frame_rows), stages=told_stages())
    warn(found.notices)
    return found


def make_report(
    calibration: "Calibration",
    target: Path,
    other: "Evaluation | None" = None,
    names: tuple[str, ...] = (),
) -> "Report":
    """Write the report of a calibration to a page or a PDF, whole or not at all."""
    from truearm.reporting.pdf import write_pdf
    from truearm.reporting.report import report

    stages = told_stages()
    made = report(calibration, other, other_names=names, stages=stages)
    if target.suffix.lower() == PRINT:
        with stages("printing the report"):
            write_pdf(made.html, target)
    else:
        write_whole(target, made.html)
    return made
