"""`truearm plan`: choose measurement poses."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from truearm.cli.arguments import AsJson, RobotName
from truearm.cli.console import print_json, print_table, say, say_wrapped, suggest
from truearm.cli.interrupt import ends_promptly
from truearm.cli.progress import told_stages
from truearm.errors import UsageError

if TYPE_CHECKING:
    from truearm.cell.plan import Plan

NUMBERS: Final = (20, 40, 60, 100, 200)
ORDERS: Final = ("short", "paper")


def command(
    robot: RobotName,
    count: Annotated[int, typer.Option("-n", "--count", metavar="N", help="Poses to fit to.")] = 60,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="CSV", help="Where the poses go.")] = Path(
        "poses.csv"
    ),
    cell: Annotated[
        Path | None, typer.Option(metavar="CELL", help="A cell file whose sensor has to reach the poses.")
    ] = None,
    criterion: Annotated[
        str, typer.Option(metavar="d|kappa|o1..o5", help="What is best: determinant, condition, an index.")
    ] = "d",
    order: Annotated[
        str, typer.Option(metavar="short|paper", help="In which order they are measured.")
    ] = "short",
    sigma_mm: Annotated[float, typer.Option(metavar="MM", help="Noise of a measured coordinate.")] = 0.1,
    seed: Annotated[int, typer.Option(help="Seed of the candidates.")] = 0,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the poses, as PNG or SVG.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Choose the poses that determine an arm's parameters best, from candidates that can be measured.

    A quarter as many are added to judge by, spread over the space, and a tenth are measured twice. They come
    from lower and higher joint readings in turn, in an order from low to high. The expected accuracy for
    several numbers of poses helps to choose N.

    Examples:
      truearm plan ur10 -n 100 -o poses.csv
      truearm plan rv-m2 -n 60 --cell cell.toml -o poses.csv
    """
    from truearm.cell.cell_file import Cell
    from truearm.cell.plan import PlanOptions, plan_poses
    from truearm.cell.plan_files import draw, write
    from truearm.planning.choosing import CRITERIA
    from truearm.robot import Robot

    if criterion not in CRITERIA or order not in ORDERS:
        wrong, known = (criterion, CRITERIA) if criterion not in CRITERIA else (order, ORDERS)
        raise UsageError(f'"{wrong}" is not known', rule=f"One of {', '.join(known)}")
    if count < 1:
        raise UsageError(f"{count} poses", where="--count", rule="At least one")
    known_cell = None if cell is None else Cell.load(cell)
    arm = Robot.load(robot) if known_cell is None else known_cell.arm
    options = PlanOptions(count, criterion, seed, order, sigma_mm)  # type: ignore[arg-type]
    with ends_promptly(), told_stages()("choosing poses"):
        plan = plan_poses(arm, options, cell=known_cell, numbers=NUMBERS)
    write(plan, output)
    if picture is not None:
        draw(plan, picture)
    _print(plan, output, order, as_json=as_json)
    if not as_json and cell is not None:
        suggest(f"truearm measure {cell} {output} --dry-run")
    elif not as_json:
        suggest(f"truearm calibrate {robot} MEASUREMENTS.csv -o result", when="Measure them; then:")


def _print(plan: "Plan", output: Path, order: str, *, as_json: bool) -> None:
    purposes = {name: plan.poses.purpose.count(name) for name in ("train", "validate", "repeat")}
    if as_json:
        print_json(
            {
                "poses": str(output),
                "purposes": purposes,
                "before": plan.choice.before,
                "after": plan.choice.after,
                "motion_s": plan.seconds,
                "order": order,
                "expected_mm": {str(n): value for n, value in plan.expected.items()},
            }
        )
        return
    say_wrapped(
        f"{purposes['train']} poses to fit to, {purposes['validate']} to judge by, "
        f"{purposes['repeat']} once more: {output}"
    )
    before, after = plan.choice.before, plan.choice.after
    kappa = f"{before['kappa']:.1f} at random, {after['kappa']:.1f} chosen"
    say_wrapped(f"Condition number {kappa} (columns at 300 mm).")
    paper, short = plan.seconds["paper"], plan.seconds["short"]
    say(f"Motion: {paper:.0f} s in the paper's order, {short:.0f} s in the shorter one.")
    rows = [[str(n), f"{value:.3f}"] for n, value in plan.expected.items()]
    say("Expected standard deviation of the calibrated position:")
    print_table(("poses", "mm"), rows)
