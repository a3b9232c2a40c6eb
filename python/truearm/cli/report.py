"""`truearm report`: a calibration's report, as a page or a PDF."""

from pathlib import Path
from typing import Annotated

import typer

from truearm.calibration import Calibration
from truearm.cli.console import print_json, say, say_wrapped, warn
from truearm.cli.interrupt import ends_promptly
from truearm.cli.progress import told_stages
from truearm.errors import UsageError
from truearm.evaluation import Evaluation, EvaluationOptions, evaluate
from truearm.files import write_whole
from truearm.measurements import Measurements
from truearm.reporting.pdf import browser, write_pdf
from truearm.reporting.report import Report, report

REPORT_NAME = "report.html"
PAGE, PRINT = ".html", ".pdf"


def command(
    calibration: Annotated[
        Path, typer.Argument(metavar="CALIB", help="A file that truearm calibrate wrote.")
    ],
    measurements: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[MEASUREMENTS...]", help="Other measurements to judge it on, CSV files."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FILE", help="report.html or report.pdf.  [default: beside CALIB]"
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the draw of frame rows.")] = 7,
    frame_rows: Annotated[
        int | None,
        typer.Option(metavar="N", help="Rows of MEASUREMENTS that find frame and tool.  [default: a third]"),
    ] = None,
    length_unit: Annotated[
        str | None, typer.Option(metavar="mm|m", help="Unit of columns that name none.")
    ] = None,
    angle_unit: Annotated[
        str | None, typer.Option(metavar="deg|rad", help="Unit of joint columns that name none.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout and nothing else.")] = False,
) -> None:
    """Write the report of a calibration: one HTML file that opens without a network, or a PDF.

    It says how good the calibration is on poses it has never seen, where to trust it, and what would help
    most next. A PDF needs Chromium on PATH.

    Example: truearm report arm/calibration.calib another_day.csv -o arm/report.pdf
    """
    target = calibration.parent / REPORT_NAME if output is None else output
    if target.suffix.lower() not in (PAGE, PRINT):
        raise UsageError(f"{target}", where="-o", rule=f"A report is a page ({PAGE}) or a PDF ({PRINT})")
    if target.suffix.lower() == PRINT:
        browser()
    known = Calibration.load(calibration)
    files = measurements or []
    with ends_promptly():
        other = None
        if files:
            data = Measurements.read_files(
                files, length_unit=length_unit, angle_unit=angle_unit, joints=known.robot.joints
            )
            options = EvaluationOptions(seed=seed, frame_rows=frame_rows)
            other = evaluate(known, data, options, stages=told_stages())
            warn(other.notices)
        made = make_report(known, target, other, tuple(file.name for file in files))
    if as_json:
        print_json({"report": str(target), **made.to_dict()})
        return
    print_report(made, target)


def make_report(
    calibration: Calibration, target: Path, other: Evaluation | None = None, names: tuple[str, ...] = ()
) -> Report:
    """Write the report of a calibration to a page or a PDF, whole or not at all."""
    stages = told_stages()
    made = report(calibration, other, other_names=names, stages=stages)
    if target.suffix.lower() == PRINT:
        with stages("printing the report"):
            write_pdf(made.html, target)
    else:
        write_whole(target, made.html)
    return made


def print_report(made: Report, target: Path) -> None:
    """Print the verdict, what would help, and where the report is."""
    say_wrapped(made.verdict)
    if made.advice:
        say("What would help most next:")
        for entry in made.advice:
            say_wrapped(f"- {entry.name} {entry.words}")
    say(f"Report: {target}")
