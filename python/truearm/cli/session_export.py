"""`truearm session export`: the accepted measurements of a session as a measurement file."""

from pathlib import Path
from typing import Annotated, Final

import typer

from truearm.cli.arguments import AsJson, SessionFile
from truearm.cli.console import print_json, say, suggest, warn
from truearm.errors import Notice, UsageError, count_of, list_rows, typed

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
    from truearm.cell.accepted import accepted_table, exported, moved_poses
    from truearm.cell.checks import told_unchecked, unchecked_poses
    from truearm.cell.session import Session
    from truearm.cli.naming import name_of
    from truearm.errors import WorkError
    from truearm.files import check_output, write_whole
    from truearm.robot import Robot

    target = output or DEFAULT
    if output is None and target.exists():
        raise UsageError(f"{target} is there already", way_out=f"To write over it name it: -o {target}")
    check_output(target, session)
    with Session(session, writing=False) as known:
        table, arm = accepted_table(known), Robot.from_dict(known.arm)
        moved, unchecked = moved_poses(known, table), unchecked_poses(known)
    if table.empty:
        raise WorkError("no pose is measured yet", where=str(session))
    write_whole(target, exported(table))
    warn([*known.notices, *([_told_of(moved)] if moved else []), *told_unchecked(unchecked)])
    if as_json:
        rows = {"rows": len(table), "moved": moved, "unchecked": unchecked}
        print_json({"measurements": str(target), **rows})
        return
    say(f"{count_of(len(table), 'measurement')}: {target}")
    suggest(f"truearm calibrate {name_of(arm)} {typed(target)} -o result")


def _told_of(moved: list[int]) -> Notice:
    return Notice(
        "moved",
        f"{list_rows(moved, 'pose')}: something moved while they were measured, before or after, as the next "
        "check found the first contact elsewhere (drift_mm). They are set-ups of their own in the column "
        '"group". Measure them again, or see that each has enough poses to stand alone.',
    )
