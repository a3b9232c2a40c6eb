"""`truearm session show`: what a session file holds."""

from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from truearm.cli.arguments import AsJson, SessionFile
from truearm.cli.console import print_json, print_table, say, say_wrapped, suggest, warn
from truearm.errors import UsageError, count_of, typed
from truearm.units import MM_PER_METRE

if TYPE_CHECKING:
    from truearm.cell.session import Session

MOST_SHOWN: Final = 20
SKIPPED: Final = {
    "skipped_contacts": "Contact for the frame at pose",
    "skipped": "Pose",
    "skipped_checks": "Check at contact",
}
"""What a summary lists that was skipped, and what one of it is called."""


def command(
    session: SessionFile,
    pose: Annotated[
        int | None, typer.Option(metavar="K", help="Show all readings of pose K, with their history.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show what a session holds; it may be under way.

    Examples:
      truearm session show session.db
      truearm session show session.db --pose 17
    """
    from truearm.cell.session import Session

    with Session(session, writing=False) as known:
        warn(known.notices)
        if pose is not None:
            _show_pose(known, pose, as_json=as_json)
        else:
            _show(known, as_json=as_json)


def _show(session: "Session", *, as_json: bool) -> None:
    from truearm.cell.checks import told_unchecked
    from truearm.cell.summary import summary_of

    found = summary_of(session)
    if as_json:
        print_json(found)
        return
    say(f"{found['cell']}, {found['arm']}")
    say(
        f"{found['measured']} of {found['poses']} poses measured, {len(found['skipped'])} skipped, "
        f"{found['open']} open; {found['readings']} readings, {found['invalid_readings']} not valid."
    )
    frame = found["registration"]
    if frame is not None:
        say(f"Frame from {frame['contacts']} contacts, {frame['residual_mm']:.2f} mm RMS.")
    checks = found["checks"]
    if any(checks.values()):
        say(f"{count_of(checks['measured'], 'check')} of the first contacts, {checks['skipped']} skipped.")
    for notice in told_unchecked(found["unchecked"]):
        say_wrapped(str(notice))
    if found["stretches"]:
        print_table(
            ("poses", "model", "held out mm", "95 % mm", "expected mm"),
            [_stretch(row) for row in found["stretches"]],
            left=(1,),
        )
    for key, what in SKIPPED.items():
        for skipped in found[key][:MOST_SHOWN]:
            say_wrapped(f"{what} {skipped['pose']} skipped: {skipped['reason']}")
        if len(found[key]) > MOST_SHOWN:
            say_wrapped(f"{len(found[key]) - MOST_SHOWN} more like these: --json lists them all.")
    _show_end(found)
    if found["measured"]:
        suggest(f"truearm session export {typed(session.path)} -o measurements.csv")


def _show_end(found: dict[str, Any]) -> None:
    """What happened on the way, and whether something is left to measure."""
    on_the_way, of_them = (" on the way", " of them") if found["complete"] else ("", "")
    if found["events"]:
        counts = ", ".join(f"{count} {kind}" for kind, count in found["events"].items())
        say_wrapped(f"Events{on_the_way}: {counts}. The last{of_them}: {found['last_event']}")
    if found["complete"]:
        say("The session is complete: nothing is left to measure.")


def _stretch(row: dict[str, Any]) -> list[str]:
    figures = [f"{row[key]:.3f}" for key in ("mean_mm", "p95_mm", "expected_mm")]
    return [str(row["measured"]), row["model"], *figures]


def _show_pose(session: "Session", pose: int, *, as_json: bool) -> None:
    count = int(session.rows("SELECT coalesce(max(pose), -1) + 1 FROM steps")[0][0])
    if not 1 <= pose <= count:
        raise UsageError(
            f"there is no pose {pose}", where=str(session.path), rule=f"Its poses are 1 to {count}"
        )
    rows = session.rows(
        "SELECT s.kind, r.attempt, r.x_m, r.y_m, r.z_m, r.valid, r.reason, o.attempts, o.outcome, r.raw "
        "FROM readings r JOIN steps s USING (step) LEFT JOIN outcomes o USING (step) "
        "WHERE s.pose = ? ORDER BY s.step, r.attempt",
        (pose - 1,),
    )
    if not rows:
        raise UsageError(f"there are no readings of pose {pose} yet", where=str(session.path))
    names = ("kind", "attempt", "x_m", "y_m", "z_m", "valid", "reason", "attempts", "outcome", "raw")
    readings = [dict(zip(names, row, strict=True)) for row in rows]
    if as_json:
        print_json(readings)
        return
    print_table(
        ("kind", "attempt", "x mm", "y mm", "z mm", "state"),
        [_reading(each) for each in readings],
        left=(0, 5),
    )


def _reading(row: dict[str, Any]) -> list[str]:
    import json

    point = ["" if row[key] is None else f"{MM_PER_METRE * row[key]:.3f}" for key in ("x_m", "y_m", "z_m")]
    if not row["valid"]:
        state = row["reason"]
    elif row["outcome"] is None:
        state = "open"
    else:
        state = "accepted" if row["attempt"] in json.loads(row["attempts"]) else "contradicted"
    return [row["kind"], str(row["attempt"]), *point, state]
