"""`truearm compensate`: rewrite a program so that the calibrated arm goes where its author meant."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import typer

import truearm as ta
from truearm.cli import compensate_options as option
from truearm.cli.arguments import (
    AsJson,
    CalibFile,
    Feature,
    LargestDeg,
    LargestMm,
    LargestStdMm,
    Moving,
    Task,
    features_of,
    joints_of,
    one_of,
)
from truearm.cli.console import print_json, say, suggest, warn
from truearm.cli.given import given_options
from truearm.cli.interrupt import ends_promptly
from truearm.cli.progress import told_progress, told_stages
from truearm.defaults import LARGEST_DEG, LARGEST_JOINT_DEG, LARGEST_MM, LARGEST_STD_MM, LEAST_SPACING_MM
from truearm.errors import UsageError, typed
from truearm.files import check_place, make_directory, refuse_own_input, refuse_same, write_whole

OnRefusal = Literal["stop", "keep-nominal"]


def command(
    context: typer.Context,
    calibration: CalibFile,
    program: option.Program,
    output: option.Output = None,
    report: option.Report = None,
    controller: option.Controller = None,
    frames: option.Frames = None,
    programming: option.Programming = None,
    language: option.Language = None,
    task: Task = "pose",
    moving: Moving = None,
    feature: Feature = None,
    on_refusal: option.OnRefusal = "stop",
    largest_mm: LargestMm = LARGEST_MM,
    largest_deg: LargestDeg = LARGEST_DEG,
    largest_joint_deg: option.LargestJointDeg = LARGEST_JOINT_DEG,
    largest_std_mm: LargestStdMm = LARGEST_STD_MM,
    offsets_mm: option.OffsetsMm = None,
    densify_mm: option.DensifyMm = None,
    least_spacing_mm: option.LeastSpacingMm = None,
    dry_run: option.DryRun = False,
    force: option.Force = False,
    as_json: AsJson = False,
) -> None:
    """Rewrite a robot program so that the calibrated arm's tool goes where the author meant it to go.

    Only numbers of targets change, and a comment at the top says so; what cannot be changed with certainty
    is left as it is and listed.

    Examples:
      truearm compensate arm.calib weld.src --controller nominal --dry-run
      truearm compensate arm.calib up.script --controller calibration.conf -o out/
      truearm compensate arm.calib pick.mod -o out/ --controller nominal
      truearm compensate arm.calib pick.prg -o out/ --frames frames.toml
    """
    from truearm.cli.rewritten import print_rewritten
    from truearm.limits import Task as WhatIsMet
    from truearm.programs.densify import Spacing
    from truearm.programs.languages import language_of
    from truearm.programs.report import report_of

    files = (program, *language_of(program, language).companions(program))
    _check_outputs(output, report, files, (calibration, frames, programming, controller), dry_run=dry_run)
    limits = ta.Limits(
        largest_mm=largest_mm,
        largest_deg=largest_deg,
        largest_joint_deg=largest_joint_deg,
        largest_std_mm=largest_std_mm,
    )
    if densify_mm is None and least_spacing_mm is not None:
        raise UsageError("--least-spacing-mm says nothing alone", way_out="Give --densify-mm as well")
    least_mm = LEAST_SPACING_MM if least_spacing_mm is None else least_spacing_mm
    spacing = None if densify_mm is None else Spacing.of(densify_mm, least_mm)
    choices = ta.Choices(one_of("--on-refusal", on_refusal, OnRefusal), force, spacing, language, offsets_mm)
    compensator = ta.Compensator(
        ta.Calibration.load(calibration),
        programming=None if programming is None else ta.Robot.load(programming),
        task=one_of("--task", task, WhatIsMet),
        moving=joints_of(moving),
        limits=limits,
        features=features_of(feature),
    )
    with ends_promptly(), told_stages()("compensation"):
        done = ta.compensate_program(
            program,
            compensator,
            controller=controller,
            frames=frames,
            choices=choices,
            tell=told_progress(),
        )
    warn(done.notices)
    paths = _written(done, None if dry_run else output, report)
    if as_json:
        print_json(report_of(done, paths))
    else:
        print_rewritten(done, dry_run=dry_run)
        for path in paths:
            say(f"Written: {path}")
        if done.changed.any():
            options = given_options(context, "dry_run", "output", "report", "as_json")
            _suggest(f"{typed(calibration)} {typed(program)}{options}", calibration, dry_run=dry_run)
    if not dry_run:
        done.refuse_unchanged()


def _written(done: "ta.Rewritten", output: str | None, report: Path | None) -> list[Path]:
    """The program's files, where there is something to write, and the report."""
    from truearm.programs.report import report_of, report_text

    paths = [] if output is None or not done.changed.any() else done.save(output)
    if report is not None:
        if output is not None and report.parent == Path(output):
            make_directory(report.parent)  # which only what is written makes otherwise
        write_whole(report, report_text(report_of(done, paths)))
    return paths


def _check_outputs(
    output: str | None,
    report: Path | None,
    program: Sequence[Path],
    others: Sequence[Path | str | None],
    *,
    dry_run: bool,
) -> None:
    """Raise UsageError where nothing is to be written, or what is read or written would be written over."""
    from truearm.programs.outputs import output_paths

    if output is None and not dry_run:
        raise UsageError("no output is named", way_out="Give -o OUT, or --dry-run to see what would change")
    planned = None if dry_run else output
    made = Path(planned) if planned is not None and planned.endswith("/") else None
    if report is not None:
        if report.parent != made:
            check_place(report)
        refuse_own_input(report, *program, *others)
    if planned is not None:
        if made is None and not Path(planned).is_dir():
            check_place(Path(planned))
        refuse_own_input(Path(planned), *others)
        for path in output_paths(program, planned):
            refuse_same(path, report, option="--report")


def _suggest(asked: str, calibration: Path, *, dry_run: bool) -> None:
    if dry_run:
        suggest(f"truearm compensate {asked} -o OUT")
    else:
        when = "Run it slowly at first. This tells whether the arm is still as it was calibrated:"
        suggest(f"truearm evaluate {typed(calibration)} MEASURED.csv", when=when)
