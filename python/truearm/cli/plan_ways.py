"""What `truearm plan` says of the ways between poses: how low the arm gets, and to what there is none."""

from typing import TYPE_CHECKING, Final

from truearm.cli.console import say_wrapped, warn
from truearm.errors import Notice, count_of, list_rows
from truearm.units import MM_PER_METRE

if TYPE_CHECKING:
    from truearm.cell.motion import Passage

TABLE: Final = (
    "link or tool would meet the table on every way there from the other poses, or go below the floor or "
    "into the arm itself; truearm measure --dry-run tells what would be skipped."
)
RULES: Final = (
    "on every straight way there from the other poses arm or tool would go below the floor or into the arm "
    "itself. Leave them out, or go there by a place that you add."
)
BESIDES: Final = (
    "to or from contacts for the frame and checks on which arm or tool would go below the floor or into the "
    "arm itself. Plan with another --seed."
)


def tell_ways(passage: "Passage") -> None:
    """Say how low the arm gets, and to what there is no way."""
    told = []
    if passage.unreached:
        what = list_rows([pose + 1 for pose in passage.unreached], "pose")
        told.append(Notice("unreached", f"{what}: {TABLE if passage.passes_table else RULES}"))
    if passage.blocked:
        told.append(Notice("blocked", f"{count_of(passage.blocked, 'straight way')} {BESIDES}"))
    warn(told)
    poses, ways = (f"{MM_PER_METRE * height:.0f} mm" for height in (passage.lowest_m, passage.lowest_way_m))
    say_wrapped(
        f"The lowest place of arm and tool in the base frame is at z = {poses} at the poses, and at {ways} "
        "on the straight ways of the joints from each to the next (--floor-mm is a bound for both)."
    )
