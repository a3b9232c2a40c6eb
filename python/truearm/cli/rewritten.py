"""A compensated program as `truearm compensate` shows it."""

from truearm.cli.console import print_table, say, say_wrapped
from truearm.errors import count_of
from truearm.programs.report import counts, table_rows, unified_diff
from truearm.programs.rewriting import Rewritten, describe

ROWS_SHOWN = 100
LISTED_SHOWN = 30


def print_rewritten(done: Rewritten, *, dry_run: bool) -> None:
    """Say what was changed and what was not."""
    found = counts(done)
    if dry_run:
        _print_dry(done)
    verb = "would be changed" if dry_run else "changed"
    beside = count_of(found["beside"], "place")
    more = f"; listed besides: {beside} without numbers of its own" if found["beside"] else ""
    say_wrapped(
        f"{done.program.language.name}: {found['changed']} of {found['targets']} targets {verb}, "
        f"{found['kept']} kept as they were after a refusal, {found['left']} left as they are{more}."
    )
    if done.changed.any():
        moved = done.correction_mm[done.changed]
        say_wrapped(f"Corrections: {moved.mean():.3f} mm mean, {moved.max():.3f} mm at most.")
    if done.inserted:
        say_wrapped(f"Waypoints inserted on straight lines: {done.inserted}.")
    for title, lines in (("Kept after a refusal:", done.kept), ("Left as they are:", done.listed)):
        if lines:
            say(title)
            say(describe(done.program, list(lines), LISTED_SHOWN))


def _print_dry(done: Rewritten) -> None:
    columns = ("where", "target", "shift mm", "turn mrad", "std mm")
    print_table(columns, table_rows(done, ROWS_SHOWN), left=(0, 1))
    hidden = int(done.changed.sum()) - ROWS_SHOWN
    if hidden > 0:
        say(f"... and {hidden} more; --report has all")
    for line in unified_diff(done):
        say(line)
