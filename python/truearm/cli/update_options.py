"""Arguments and options of `truearm update`."""

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

FilesOrNone: TypeAlias = Annotated[
    list[Path] | None,
    typer.Argument(metavar="MEASUREMENTS...", help="CSV files of 10 to 20 poses, each a set-up."),
]
Output: TypeAlias = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="NEW.calib|DIR", help="Where the updated calibration goes."),
]
KeepFrame: TypeAlias = Annotated[
    bool, typer.Option("--keep-frame", help="Device and base stand where they stood: determines joint 1.")
]
KeepTool: TypeAlias = Annotated[
    bool, typer.Option("--keep-tool", help="The target sits where it sat: determines the last joint too.")
]
NewTool: TypeAlias = Annotated[
    bool, typer.Option("--new-tool", help="It is another target: found anew, not compared.")
]
TakeScale: TypeAlias = Annotated[
    bool, typer.Option("--take-scale", help="Take a common scale of all lengths along, where one is found.")
]
OffsetDeg: TypeAlias = Annotated[
    float, typer.Option(metavar="DEG", help="How far an offset may have changed (standard deviation).")
]
ToolMm: TypeAlias = Annotated[float, typer.Option(metavar="MM", help="The same of the target on the tool.")]
Level: TypeAlias = Annotated[
    float, typer.Option(metavar="SHARE", help="Share of unchanged arms that are wrongly reported as changed.")
]
RollBack: TypeAlias = Annotated[
    bool, typer.Option("--roll-back", help="Write the calibration as it was before, bit for bit.")
]
