"""Arguments and options of `truearm compensate`."""

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from truearm.defaults import LEAST_SPACING_MM

Program: TypeAlias = Annotated[
    Path, typer.Argument(metavar="PROGRAM", help="The program, or one of its files.")
]
Output: TypeAlias = Annotated[
    str | None, typer.Option("-o", "--output", metavar="OUT", help="A file, or a directory: DIR/.")
]
Report: TypeAlias = Annotated[
    Path | None, typer.Option("--report", metavar="FILE", help="Write a report in JSON.")
]
Controller: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--controller",
        metavar="nominal|FILE",
        help="The model that the controller computes with: a robot file, a URDF, UR's calibration.",
    ),
]
Frames: TypeAlias = Annotated[
    Path | None, typer.Option("--frames", metavar="FILE", help="Tools and work objects (TOML).")
]
Programming: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="ROBOT", help="The model of the author.  [default: the nominal arm]"),
]
Language: TypeAlias = Annotated[
    str | None, typer.Option(metavar="NAME", help="Language.  [default: by the ending]")
]
OnRefusal: TypeAlias = Annotated[
    str,
    typer.Option(metavar="stop|keep-nominal", help="What becomes of targets that cannot be corrected."),
]
LargestJointDeg: TypeAlias = Annotated[
    float, typer.Option("--largest-joint-deg", help="Largest change of a joint.")
]
DensifyMm: TypeAlias = Annotated[
    float | None,
    typer.Option("--densify-mm", metavar="MM", help="Insert waypoints on lines that deviate by more."),
]
LeastSpacingMm: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--least-spacing-mm",
        metavar="MM",
        help=f"Least way between inserted waypoints.  [default: {LEAST_SPACING_MM:g}]",
    ),
]
OffsetsMm: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--offsets-mm",
        metavar="MM",
        help="Change targets that are used with offsets too, where the tool's point stays within this there; "
        "its turn is reported, not bounded.",
    ),
]
DryRun: TypeAlias = Annotated[
    bool, typer.Option("--dry-run", help="Show a table and a unified diff; write nothing.")
]
Force: TypeAlias = Annotated[
    bool, typer.Option("--force", help="Go on with a program that was compensated already.")
]
