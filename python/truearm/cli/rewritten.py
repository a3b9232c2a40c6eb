"""A compensated program as `truearm compensate` shows it."""

import numpy as np

from truearm.cli.console import print_table, say, say_wrapped
from truearm.errors import count_of
from truearm.programs.listing import describe, listed_target, shortened
from truearm.programs.report import counts, table_rows, unified_diff
from truearm.programs.rewriting import Rewritten
from truearm.types import Floats

ROWS_SHOWN = 100
LISTED_SHOWN = 30
ROUNDING_MM = 1e-3
ROUNDING_MRAD = 1e-2


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
        say_wrapped(
            f"Corrections: {moved.mean():.3f} mm mean, {moved.max():.3f} mm at most.{_positions(done)}"
        )
        _print_left(done)
    if done.inserted:
        say_wrapped(f"Waypoints inserted on straight lines: {done.inserted}.")
    for title, lines in (("Kept after a refusal:", done.kept), ("Left as they are:", done.listed)):
        if lines:
            say(title)
            say(describe(done.program, list(lines), LISTED_SHOWN))


def _positions(done: Rewritten) -> str:
    """How far positions moved that the program says; nothing where it has joint targets alone."""
    moved = done.moved_mm[done.changed & np.isfinite(done.moved_mm)]
    return f" Written positions moved by {moved.max():.3f} mm at most." if len(moved) else ""


def _print_left(done: Rewritten) -> None:
    """Say how far the arm stays from its targets, where that is more than rounding."""
    left = [
        *_most_left(done, done.residual_mm, "mm", ROUNDING_MM),
        *_most_left(done, done.residual_mrad, "mrad", ROUNDING_MRAD),
    ]
    if left:
        say_wrapped(f"Not all targets are met in full: left are {' and '.join(left)}.")


def _most_left(done: Rewritten, residual: Floats, unit: str, rounding: float) -> list[str]:
    """The largest residual (t,) of the changed targets and which target has it; none within rounding."""
    changed = np.where(done.changed, residual, 0.0)
    most = int(np.argmax(changed))
    if changed[most] <= rounding:
        return []
    place = listed_target(done.program, most, "")
    file = done.program.sources[place.file].path.name
    return [f"up to {changed[most]:.3f} {unit} ({file}, line {place.line}, {shortened(place.name)})"]


def _print_dry(done: Rewritten) -> None:
    columns = ("where", "target", "shift mm", "turn mrad", "std mm", "moved mm")
    print_table(columns, table_rows(done, ROWS_SHOWN), left=(0, 1))
    hidden = int(done.changed.sum()) - ROWS_SHOWN
    if hidden > 0:
        say(f"... and {hidden} more; --report has all")
    for line in unified_diff(done):
        say(line)
