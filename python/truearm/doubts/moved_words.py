"""What moves with a column, or while it is measured, in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from truearm.doubts.asked_columns import ORDER, Asked
from truearm.doubts.at_once import SCALE_DIFFERS, STEP_KINDS
from truearm.doubts.outliers import STATED_TOO_LARGE
from truearm.doubts.slips import mrad
from truearm.errors import Notice, count_of
from truearm.lengths import length_mm
from truearm.types import Floats

UNUSED_COLUMN: Final = "unused_column"
JOINTS_MOVED: Final = "joints_moved"
LINKS_GREW: Final = "links_grew"
SETUP_TURNING: Final = "setup_turning"
TAKEN_FOR_NOISE: Final = (
    UNUSED_COLUMN,
    JOINTS_MOVED,
    LINKS_GREW,
    SETUP_TURNING,
    STATED_TOO_LARGE,
    *STEP_KINDS,
)
"""Kinds of notices of what a model takes for noise, so that what it leaves is more than noise."""
JOINTS: Final = "joints"
LINKS: Final = "links"
BOTH: Final = "joints and links"
LOAD: Final = "load"
DEVICE: Final = "device"
KNOWN: Final = "known where programs run, as a temperature is and a time is not"
AS_OF: Final = {
    JOINTS: "joints that move with it",
    LINKS: "links that grow with it, or an instrument whose scale changes with it",
    BOTH: "joints that move and links that grow with it",
    LOAD: "joints that give way under it",
}
MOVES: Final = {
    JOINTS: "moves the joints",
    LINKS: "lengthens the links",
    BOTH: "moves the joints and lengthens the links",
    LOAD: "moves the joints",
}
ORDERED: Final = "Rows are taken to be in the order of measuring: if they are not, give --drift none."
MEANWHILE: Final = {
    JOINTS: (
        JOINTS_MOVED,
        "The joints moved while they were measured, whatever the pose, as those of an arm that warms up",
    ),
    BOTH: (
        JOINTS_MOVED,
        "The joints moved and all lengths changed while they were measured, whatever the pose, as those of "
        "an arm that warms up",
    ),
    LINKS: (
        LINKS_GREW,
        "All lengths changed while they were measured, whatever the pose, as those of an arm that warms up, "
        "or of an instrument whose scale changes",
    ),
}
"""The kind of a notice of what moves with the time, and its words."""
DIGITS: Final = 2


@dataclass(frozen=True, eq=False)
class Moved:
    """What goes with a column.

    Attributes:
        column: The column.
        what: What moves: JOINTS, LINKS, BOTH, joints under a LOAD, or the DEVICE.
        chance: How likely chance explains as much.
        gain: Logarithm of its evidence over that of none.
        mean_mm: How far the target moves on average, from the lowest value to the highest.
        sizes: By how much (k,), rad and m for joints, in parts of one for lengths, behind these of both, rad
            for a device.
        group: The set-up whose device it is.
    """

    column: Asked
    what: str
    chance: float
    gain: float
    mean_mm: float
    sizes: Floats
    group: str = ""

    @property
    def words(self) -> str:
        """Its name, how far, where it is not known, and what moves."""
        lacking = self.column.lacking
        empty = f"; {count_of(lacking, 'row')} {'has' if lacking == 1 else 'have'} none" if lacking else ""
        far = length_mm(self.mean_mm, DIGITS)
        return (
            f"{self.column.name} (by {far} from its lowest value to its highest{empty}), as of "
            f"{AS_OF[self.what]}"
        )


def of_slip(notice: Notice, there: Sequence[Asked]) -> Notice:
    """A step, with the columns that change there, which may be what moves it."""
    names = " and ".join(column.name for column in there)
    change, it, which = ("change", "one of them", "NAME") if len(there) > 1 else ("changes", "it", names)
    moves = MOVES[LINKS if notice.kind == SCALE_DIFFERS else JOINTS]
    text = (
        f"{notice} But {names} {change} there as well: if {it} is what {moves}, and {KNOWN}, calibrate with "
        f"--features {which}{_to_fill(there)}."
    )
    return Notice(notice.kind, text)


def with_columns(told: Sequence[Moved]) -> Notice:
    """Columns that no feature is."""
    names = ", and with ".join(moved.words for moved in told)
    name = told[0].column.name
    which = f"NAME, of one that is {KNOWN}" if len(told) > 1 else f"{name}, if it is {KNOWN}"
    text = (
        f"Errors go with {names}, and no pose explains it: it is taken for noise, and intervals may be too "
        f"narrow. Calibrate with --features {which}{_to_fill([moved.column for moved in told])}."
    )
    return Notice(UNUSED_COLUMN, text)


def of_time(told: Sequence[Moved]) -> Notice:
    """What cannot be told from the time, the likeliest first."""
    kind, what = MEANWHILE[told[0].what]
    named = [moved.column for moved in told if moved.column.name != ORDER]
    also = ", or note its temperature in a column and calibrate with --features."
    if named:
        names = " and ".join(column.name for column in named)
        several = len(named) > 1
        go, it, which = ("go", "one of them", "NAME") if several else ("goes", "it", names)
        also = (
            f". {names} {go} one way meanwhile, as the time does, and these rows do not tell them apart: if "
            f"{it} is what {MOVES[told[0].what]}, and {KNOWN}, calibrate with --features {which}"
            f"{_to_fill(named)}."
        )
    text = (
        f"{what}: from the first row to the last the target by {length_mm(told[0].mean_mm, DIGITS)} on "
        "average. It is taken for noise, and intervals may be too narrow. Warm the arm up before "
        f"measuring{also} {ORDERED}"
    )
    return Notice(kind, text)


def of_device(moved: Moved) -> Notice:
    """A device that turns evenly all the while."""
    far = length_mm(moved.mean_mm, DIGITS)
    text = (
        f"In {moved.group} the measuring device, or the arm's base, turned evenly while it was measured: "
        f"by {mrad(moved.sizes)} from the first row to the last (points by {far} on average about their "
        "middle). It is taken for noise and for errors of the arm. Let the device settle on a firm stand and "
        "warm up, and measure again; or give thirds of the rows names of their own in a column `group`: each "
        f"part then has a frame of its own, and less of a turn in it. {ORDERED}"
    )
    return Notice(SETUP_TURNING, text)


def _to_fill(columns: Sequence[Asked]) -> str:
    """What a feature needs that rows lack."""
    lack = any(column.lacking for column in columns)
    return ", and its empty cells filled in or their rows left out" if lack else ""
