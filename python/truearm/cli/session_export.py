"""`truearm session export`: the accepted measurements of a session as a measurement file."""

from pathlib import Path
from typing import Annotated, Final

import typer

from truearm.cli.arguments import AsJson, SessionFile
from truearm.cli.console import print_json, say, suggest
from truearm.errors import UsageError, count_of, typed

DEFAULT: Final = Path("measurements.csv")


def command(
    session: SessionFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="CSV", help="Where the measurements go.  [default: measurements.csv]"
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write the accepted measurements of a session, one row a pose; it may be under way.

    Examples:
      truearm session export session.db -o measurements.csv
    """
    from truearm.cell.accepted import accepted_table
    from truearm.cell.session import Session
    from truearm.cli.naming import name_of
    from truearm.errors import WorkError
    from truearm.files import refuse_own_input, write_whole
    from truearm.robot import Robot

    target = output or DEFAULT
    if output is None and target.exists():
        raise UsageError(f"{target} is there already", way_out=f"To write over it name it: -o {target}")
    refuse_own_input(target, session)
    with Session(session, writing=False) as known:
        table, arm = accepted_table(known), Robot.from_dict(known.meta("arm"))
    if table.empty:
        raise WorkError("no pose is measured yet", where=str(session))
    write_whole(target, table.drop(columns="step").to_csv(index=False, lineterminator="\n"))
    if as_json:
        print_json({"measurements": str(target), "rows": len(table)})
        return
    say(f"{count_of(len(table), 'measurement')}: {target}")
    suggest(f"truearm calibrate {name_of(arm)} {typed(target)} -o result")
