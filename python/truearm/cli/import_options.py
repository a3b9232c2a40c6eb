"""Arguments and options of `truearm import`."""

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

Raw: TypeAlias = Annotated[Path, typer.Argument(metavar="RAW", help="The table to bring in.")]
Output: TypeAlias = Annotated[Path, typer.Option("-o", "--output", help="The measurement file to write.")]
Columns: TypeAlias = Annotated[
    list[str] | None,
    typer.Option("--map", metavar="OURS=THEIRS[:UNIT]", help="q1=J1, x=px:mm, sigma=..., group=...; repeat."),
]
Keep: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(metavar="[NEW=]THEIRS[:UNIT]", help="A further column to keep, in SI if a unit is given."),
]
Rotation: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="KIND=COLUMNS",
        help="euler:XYZ:deg=RX,RY,RZ (capitals moving, small letters fixed axes), "
        "vector:rad=RX,RY,RZ, quaternion:xyzw=A,B,C,D or matrix=R11,R12,...,R33 row by row.",
    ),
]
JointUnit: TypeAlias = Annotated[str | None, typer.Option(metavar="deg|rad", help="Unit of the joints.")]
LengthUnit: TypeAlias = Annotated[str | None, typer.Option(metavar="mm|m|in", help="Unit of positions.")]
Second: TypeAlias = Annotated[
    list[Path] | None,
    typer.Option("--with", metavar="FILE", help="A second table, with further columns."),
]
On: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="COLUMN[=ITS]",
        help="The column that says which rows of the two belong together; row by row without.",
    ),
]
Names: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--columns",
        metavar="NAME,NAME",
        help="Names of the columns of a table without a header; - for those to leave out.",
    ),
]
Delimiter: TypeAlias = Annotated[str | None, typer.Option(help='Mark between fields: ";", tab, space, ...')]
Decimal: TypeAlias = Annotated[str | None, typer.Option(help='Decimal mark: "." or ",".')]
SkipLines: TypeAlias = Annotated[int, typer.Option(min=0, help="Lines above the header.")]
Sheet: TypeAlias = Annotated[
    str | None, typer.Option(metavar="NAME", help="Sheet of an Excel workbook; the only one without.")
]
WithNames: TypeAlias = Annotated[
    str | None,
    typer.Option("--with-columns", metavar="NAME,NAME", help="--columns of the second table."),
]
WithDelimiter: TypeAlias = Annotated[str | None, typer.Option(help="--delimiter of the second table.")]
WithDecimal: TypeAlias = Annotated[str | None, typer.Option(help="--decimal of the second table.")]
WithSkipLines: TypeAlias = Annotated[
    int | None, typer.Option(min=0, help="--skip-lines of the second table.")
]
WithSheet: TypeAlias = Annotated[
    str | None, typer.Option(metavar="NAME", help="--sheet of the second table.")
]
WithEncoding: TypeAlias = Annotated[str | None, typer.Option(help="--encoding of the second table.")]
Comments: TypeAlias = Annotated[
    list[str] | None, typer.Option(metavar="MARK", help="What lines of remarks begin with; repeat.")
]
Missing: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        metavar="TEXT", help="What cells say where nothing was measured, a number however written; repeat."
    ),
]
Encoding: TypeAlias = Annotated[str, typer.Option(help="Encoding of the text.")]
