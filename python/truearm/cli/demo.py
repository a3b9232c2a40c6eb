"""`truearm demo`: the paper's cell in small: plan, measure, calibrate, compensate a path, report."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from truearm.cli.arguments import AsJson, OutputDirectory
from truearm.cli.calibrate import (
    check_directory,
    print_places,
    print_results,
    write_results,
)
from truearm.cli.console import print_json, say, say_wrapped, suggest, tell, warn
from truearm.cli.interrupt import end_at_once, ends_promptly
from truearm.cli.measure_progress import Teller
from truearm.cli.progress import told_stages
from truearm.errors import typed
from truearm.files import make_directory, write_whole
from truearm.result_names import CALIBRATION_NAME

if TYPE_CHECKING:
    from truearm.calibration import Calibration
    from truearm.cell.plan import Plan
    from truearm.measurements import Measurements
    from truearm.studies.demonstration import Followed

POSES: Final = 48
SPEED: Final = 25.0
CELL, PLANNED, SESSION, MEASURED = "cell.toml", "poses.csv", "session.db", "measurements.csv"
PATH, CORRECTED = "path.csv", "path_compensated.csv"


def command(
    output: OutputDirectory = Path("demo"),
    count: Annotated[
        int, typer.Option("-n", "--count", min=12, metavar="N", help="Poses to fit to.")
    ] = POSES,
    speed: Annotated[
        float, typer.Option(min=1.0, metavar="X", help="How fast the virtual clock runs.")
    ] = SPEED,
    as_json: AsJson = False,
) -> None:
    """Calibrate a virtual RV-M2 in the paper's cell, from planning to a compensated path.

    The arm, the x-y-z table and the touch panel are virtual, processes of their own behind pseudo-terminals;
    all else is as with real ones. The arm's Denavit-Hartenberg parameters are off by 0.4 mm and 0.05 deg, and
    its first joints err by the harmonics of the paper's equation (6). Takes about a minute; interrupted, the
    same command goes on with the measurements that it has.

    Examples:
      truearm demo
      truearm demo -o here --json
    """
    from truearm.studies.demonstration import demonstration_cell

    check_directory(output)
    make_directory(output)
    text = demonstration_cell(speed)
    plan = _planned(text, count, quiet=as_json)
    data = _measured(text, plan, output, quiet=as_json)
    calibration, summary = _calibrated(data, output, quiet=as_json)
    followed = _compensated(text, calibration, data, plan, output)
    errors = {"before": _sizes(followed.before_mm), "after": _sizes(followed.after_mm)}
    if as_json:
        print_json({"measurements": str(output / MEASURED), "path_error_mm": errors, **summary})
        return
    for words, sizes in zip(("as it is", "compensated"), errors.values(), strict=True):
        say(f"Error on a path, {words}: mean {sizes['mean']:.3f} mm, largest {sizes['max']:.3f} mm.")
    _print_places(output)


def _planned(text: str, count: int, *, quiet: bool) -> "Plan":
    from truearm.cell.cell_file import Cell
    from truearm.cell.plan import PlanOptions, plan_poses

    cell = Cell.from_toml(text)
    with ends_promptly():
        plan = plan_poses(cell.arm, PlanOptions(count), cell=cell)
    if not quiet:
        say_wrapped(
            f"Planned: {len(plan.poses)} poses of a virtual {cell.arm.name} that table and touch panel can "
            f"measure, condition number {plan.choice.after['kappa']:.1f}."
        )
    return plan


def _keep(text: str, plan: "Plan", output: Path) -> None:
    """Write cell and poses of a session, which has refused none of them."""
    from truearm.cell.plan_files import write

    write_whole(output / CELL, text)
    write(plan, output / PLANNED)


def _measured(text: str, plan: "Plan", output: Path, *, quiet: bool) -> "Measurements":
    from truearm.cell.accepted import accepted_table, exported
    from truearm.cell.session import Session
    from truearm.cell.summary import summary_of
    from truearm.cell.virtual.measuring import measure_virtually
    from truearm.measurements import Measurements

    try:
        with Teller() as teller:
            measure_virtually(text, plan.poses, output / SESSION, teller.tell)
    except KeyboardInterrupt:
        _keep(text, plan, output)
        tell(f"The session is in {output / SESSION}; the same command goes on with it.")
        end_at_once()
    _keep(text, plan, output)
    with Session(output / SESSION, writing=False) as session:
        table, found = accepted_table(session), summary_of(session)
    write_whole(output / MEASURED, exported(table))
    if not quiet:
        say_wrapped(
            f"Measured: {found['measured']} poses, {found['readings']} readings, after the frame was "
            f"registered to {found['registration']['residual_mm']:.2f} mm."
        )
    return Measurements.read_csv(output / MEASURED)


def _calibrated(data: "Measurements", output: Path, *, quiet: bool) -> "tuple[Calibration, dict[str, Any]]":
    from truearm.calibrating import calibrate
    from truearm.robot import Robot

    with ends_promptly():
        calibration = calibrate(Robot.load("rv-m2"), data, stages=told_stages("demo", len(data)))
    warn(calibration.notices)
    summary = write_results(calibration, output)
    if not quiet:
        print_results(calibration)
    return calibration, summary


def _compensated(
    text: str, calibration: "Calibration", data: "Measurements", plan: "Plan", output: Path
) -> "Followed":
    from truearm.studies.demonstration import follow, path_table, path_through

    path = path_through(plan.poses.readings)
    with ends_promptly():
        followed = follow(text, calibration, data, path)
    for name, readings in ((PATH, path), (CORRECTED, followed.corrected)):
        write_whole(output / name, path_table(readings).to_csv(index=False, lineterminator="\n"))
    return followed


def _sizes(errors_mm: Any) -> dict[str, float]:  # noqa: ANN401 - an array; numpy is not loaded here
    return {"mean": float(errors_mm.mean()), "max": float(errors_mm.max())}


def _print_places(output: Path) -> None:
    places = {"Cell": CELL, "Poses": PLANNED, "Session": SESSION, "Measured": MEASURED}
    for what, name in places.items():
        say(f"{f'{what}:':<13}{output / name}")
    print_places(output)
    say(f"{'Path:':<13}{output / PATH} and {CORRECTED}")
    suggest(
        f"truearm session show {typed(output / SESSION)}",
        f"truearm plan rv-m2 -n 100 --cell {typed(output / CELL)} -o {typed(output / 'more.csv')}",
        f"truearm compensate {typed(output / CALIBRATION_NAME)} {typed(output / PATH)} --dry-run",
    )
