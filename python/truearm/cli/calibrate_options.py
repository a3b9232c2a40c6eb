"""Options of `truearm calibrate`."""

from typing import Annotated, TypeAlias

import typer

from truearm.defaults import HOLDOUT

Holdout: TypeAlias = Annotated[
    float | None,
    typer.Option(
        help=f"Share of the rows that is held out.  [default: those planned to validate, else {HOLDOUT}]"
    ),
]
Seed: TypeAlias = Annotated[int, typer.Option(help="Seed of the split.")]
TrainSize: TypeAlias = Annotated[
    int | None, typer.Option(metavar="N", help="Training rows of each file.  [default: all others]")
]
SplitBy: TypeAlias = Annotated[
    str | None, typer.Option(metavar="COL,COL", help="Hold out whole groups equal in these columns.")
]
HoldoutRange: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="qJ:low|high:SHARE", help="Hold out the rows with the lowest or highest readings."),
]
JudgeTarget: TypeAlias = Annotated[
    int,
    typer.Option(
        metavar="K",
        help="Judge at this target; another than 1 takes no part in the fit. Of several that do, rows "
        "without the first are judged at the next that they hold.",
    ),
]
Model: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="variable|constant|regions|cmac|fcmac",
        help="The variable model, the constant one alone, or a scheme of the paper.",
    ),
]
Robust: TypeAlias = Annotated[
    str, typer.Option(metavar="none|huber|cauchy", help="Loss of the constant fit.")
]
Drift: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="auto|none",
        help="Whether to take out how set-ups moved while they were measured, row by row; only the variable "
        "model looks for it.",
    ),
]
Features: TypeAlias = Annotated[
    str | None, typer.Option(metavar="COL,COL", help="Columns that parameters may vary with.")
]
Frame: TypeAlias = Annotated[
    str, typer.Option(metavar="free|world", help="world: the base is corrected, in five of six freedoms.")
]
NoRefit: TypeAlias = Annotated[bool, typer.Option("--no-refit", help="Keep the fit to the training rows.")]
Strip: TypeAlias = Annotated[
    bool, typer.Option("--strip", help="Leave the measurements out of the file, for controllers.")
]
SchemeJoints: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="J,J", help="Schemes: joints that are divided.  [default: 1,2,3]"),
]
DemandedMm: TypeAlias = Annotated[
    float, typer.Option(metavar="MM", help="Schemes: a region this accurate is not divided.")
]
Regions: TypeAlias = Annotated[int, typer.Option(metavar="N", help="Schemes: regions at the most.")]
RegionRows: TypeAlias = Annotated[int, typer.Option(metavar="N", help="Schemes: poses that a region needs.")]
RegionCeps: TypeAlias = Annotated[
    str,
    typer.Option(metavar="shrunk|least_squares", help="Schemes: shrunk to the parent, or as the paper."),
]
TrainOn: TypeAlias = Annotated[
    str, typer.Option(metavar="ceps|measurements", help="Networks: what they learn from.")
]
Membership: TypeAlias = Annotated[
    str, typer.Option(metavar="gaussian|bspline", help="FCMAC: its fuzzy sensors.")
]
Composition: TypeAlias = Annotated[
    str, typer.Option(metavar="min|product", help="Networks: how sensors combine.")
]
RepeatabilityMm: TypeAlias = Annotated[
    float | None, typer.Option(metavar="MM", help="Of the arm; errors are also reported in parts of it.")
]
Degree: TypeAlias = Annotated[int, typer.Option(hidden=True)]
Threads: TypeAlias = Annotated[int | None, typer.Option(hidden=True, min=1)]
