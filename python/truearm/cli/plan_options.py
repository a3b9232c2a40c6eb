"""Arguments and options of `truearm plan`."""

from pathlib import Path
from typing import Annotated, Final, TypeAlias

import typer

from truearm.cli.arguments import ROBOT_HELP, robots_like
from truearm.defaults import LINK_RADIUS_MM

RobotOrNone: TypeAlias = Annotated[
    str | None,
    typer.Argument(
        metavar="ROBOT",
        help=f"{ROBOT_HELP} With --from it is known.",
        autocompletion=robots_like,
    ),
]
COUNT: Final = 60
Count: TypeAlias = Annotated[
    int | None, typer.Option("-n", "--count", metavar="N", help=f"Poses to fit to.  [default: {COUNT}]")
]
OUTPUT: Final = Path("poses.csv")
Output: TypeAlias = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="CSV", help=f"Where the poses go.  [default: {OUTPUT}]"),
]
CellReaching: TypeAlias = Annotated[
    Path | None, typer.Option(metavar="CELL", help="A cell file whose sensor has to reach the poses.")
]
Criterion: TypeAlias = Annotated[
    str, typer.Option(metavar="d|kappa|o1..o5", help="What is best: determinant, condition, an index.")
]
NextCount: TypeAlias = Annotated[
    int | None,
    typer.Option("--next", metavar="N", help="The N poses that a calibration would learn most from."),
]
Acceptance: TypeAlias = Annotated[
    int | None, typer.Option(metavar="N", help="The N poses that check a calibration best.")
]
Known: TypeAlias = Annotated[
    Path | None, typer.Option("--from", metavar="CALIB", help="--next, --acceptance: the calibration.")
]
Group: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="--next, --acceptance: set-up to measure in.  [default: the last]"),
]
Order: TypeAlias = Annotated[
    str, typer.Option(metavar="there-and-back|short|paper", help="In which order they are measured.")
]
SigmaMm: TypeAlias = Annotated[float, typer.Option(metavar="MM", help="Noise of a measured coordinate.")]
FloorMm: TypeAlias = Annotated[
    float | None,
    typer.Option(
        metavar="MM",
        help="Height in the base frame that arm and tool, with --from the measured targets, stay above, at "
        "the poses and on the joints' straight ways from each to the next.",
    ),
]
LinkRadiusMm: TypeAlias = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        metavar="MM",
        help="Half the thickness of the links, which do not meet one another; 0 where they may.  "
        f"[default: {LINK_RADIUS_MM:g}, or the cell file's]",
    ),
]
BoxMm: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,Z,X,Y,Z", help="Corners of a box in the base frame that keeps the targets at the poses."
    ),
]
Seed: TypeAlias = Annotated[int, typer.Option(min=0, help="Seed of the candidates.")]
Picture: TypeAlias = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Draw the poses, as PNG or SVG.")
]
