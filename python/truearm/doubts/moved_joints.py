"""Joints that move with what was noted beside the poses, or while they are measured, and no pose explains.

Motors warm up and gears creep, so that each joint stands a little further on than its reading says, by an
amount that goes with a temperature or with the time. Where no feature tells the model, it takes that for
noise. What each joint is off is asked for in what the model leaves of the rows.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.defaults import NO_DRIFT
from truearm.doubts.at_once import BESIDE, JOINT_MOVED
from truearm.doubts.row_order import FEWEST_VISITS, FOLLOWED, ORDER_OF_POSES, poses_of, share_explained
from truearm.doubts.slips import Slip
from truearm.doubts.whitened import Whitened
from truearm.errors import Notice, count_of
from truearm.fits.fitted_rows import ODDS_OF_CHANCE, FittedRows
from truearm.inputs import is_payload
from truearm.lengths import length_mm
from truearm.tables.columns import OF_MEASURING
from truearm.types import AXES, Floats
from truearm.units import MM_PER_METRE

UNUSED_COLUMN: Final = "unused_column"
JOINTS_MOVED: Final = "joints_moved"
ORDER: Final = ""
"""Name of the order of the rows among the columns."""
MOSTLY: Final = 0.5
"""Share of the steps from visit to visit at which what goes with the time changes."""
EVEN: Final = 1e-4
"""Part of their range by which values differ at the most from what counts rows."""
NEARLY: Final = 2
"""Visits by which the place of a step may be told wrongly."""
KNOWN: Final = "known where programs run, as a temperature is and a time is not"


@dataclass(frozen=True, eq=False)
class Asked:
    """A column that joints may move with.

    Attributes:
        name: Its name.
        values: Of each visit (v,), from zero in the mean of each set-up; zero where there is none.
        lacking: How many rows have none.
        as_time: Whether it goes one way while a set-up is measured, so that it cannot be told from the time.
    """

    name: str
    values: Floats
    lacking: int = 0
    as_time: bool = False

    def changes_at(self, visit: int) -> bool:
        """Whether it stands at one value before a visit, or one near it, and at another from there on."""
        seen = self.values[max(visit - BESIDE, 0) : visit + BESIDE]
        places = range(max(BESIDE - NEARLY, 1), min(BESIDE + NEARLY, len(seen) - 1) + 1)
        return any(abs(seen[k] - seen[k - 1]) > max(np.ptp(seen[:k]), np.ptp(seen[k:])) for k in places)

    @property
    def reach(self) -> float:
        """How far it reaches within the set-ups."""
        return float(np.ptp(self.values))


@dataclass(frozen=True)
class Moved:
    """A column that joints move with.

    Attributes:
        column: The column.
        chance: How likely chance explains as much.
        mean_mm: How far the target moves on average, from the lowest value to the highest.
    """

    column: Asked
    chance: float
    mean_mm: float

    @property
    def words(self) -> str:
        """Its name, how far, and where it is not known."""
        lacking = self.column.lacking
        empty = f"; {count_of(lacking, 'row')} {'has' if lacking == 1 else 'have'} none" if lacking else ""
        far = length_mm(self.mean_mm, 2)
        return f"{self.column.name} (by {far} from its lowest value to its highest{empty})"


def moved_joints(
    found: Calibration, rows: FittedRows, seen: Whitened, progress: Floats, slips: Sequence[Slip]
) -> list[Notice]:
    """A warning where joints move with a column that is not used, or with the order of the rows; where a step
    explains more, what stands otherwise from some row on, with the columns that change there.

    Args:
        found: A calibration of what varies: constants leave too much that poses explain.
        rows: The rows that it was fitted to.
        seen: What it leaves of them.
        progress: When each of them was measured, from 0 for the first of its set-up to 1 for the last (n,).
        slips: Steps that explain what is left.
    """
    if found.variable is None or len(seen.rows) < FEWEST_VISITS:
        return []
    asked = [_moved(found, seen, column) for column in _asked(found, rows, seen, progress)]
    told = [moved for moved in asked if moved.chance * len(asked) < ODDS_OF_CHANCE]
    told.sort(key=lambda moved: moved.chance)
    if slips and (not told or min(slip.chance for slip in slips) <= told[0].chance * len(asked)):
        return [_of_slip(slip, asked, seen) for slip in slips]
    if columns := [moved for moved in told if not moved.column.as_time]:
        return [_with_columns(columns)]
    return [_while_measured(told)] if told else []


def _asked(found: Calibration, rows: FittedRows, seen: Whitened, progress: Floats) -> Iterator[Asked]:
    """Columns that vary and no pose tells, and the order of the rows where they have one."""
    group, when = rows.data.group[seen.rows], progress[seen.rows]
    poses, in_order = poses_of(found.robot, rows.data.readings[seen.rows]), _is_in_order(found)
    # What warms up moves most at first.
    for name, every in _columns(found, rows, np.sqrt(progress) if in_order else None):
        values = every[seen.rows]
        known = np.isfinite(values)
        own = [known & (group == each) for each in np.unique(group[known])]
        if known.sum() < FEWEST_VISITS:
            continue
        if name != ORDER and _counts_rows([(values[each], when[each]) for each in own]):
            continue
        centred = np.zeros(len(values))
        for each in own:
            centred[each] = values[each] - values[each].mean()
        if np.ptp(centred) > 0.0 and share_explained(poses[known], centred[known]) <= FOLLOWED:
            as_time = in_order and _goes_one_way([values[each] for each in own])
            yield Asked(name, centred, int((~np.isfinite(every)).sum()), as_time)


def _is_in_order(found: Calibration) -> bool:
    """Whether rows are in the order of measuring, and that is none of their poses."""
    is_told = any(notice.kind == ORDER_OF_POSES for notice in found.notices)
    return found.options.drift != NO_DRIFT and not is_told


def _columns(found: Calibration, rows: FittedRows, order: Floats | None) -> Iterator[tuple[str, Floats]]:
    """Names and values (n,) of columns that are no features, and of the order of rows if they have one."""
    if order is not None:
        yield ORDER, order
    for name in map(str, rows.data.features.columns):
        if name not in (*found.options.features, *OF_MEASURING):
            yield name, rows.data.features[name].to_numpy(np.float64)


def _counts_rows(in_set_ups: Sequence[tuple[Floats, Floats]]) -> bool:
    """Whether values (v,) of each set-up are no more than the progress (v,) of measuring, as numbers of rows
    are.
    """
    for values, progress in in_set_ups:
        reach, span = values[-1] - values[0], progress[-1] - progress[0]
        straight = values[0] + reach * (progress - progress[0]) / (span or 1.0)
        if np.abs(values - straight).max() > EVEN * np.ptp(values):
            return False
    return True


def _goes_one_way(in_set_ups: Sequence[Floats]) -> bool:
    """Whether values (v,) of each set-up, in the order of measuring, rise all the while, or fall."""
    steps = [np.diff(values) for values in in_set_ups]
    changes = np.concatenate(steps) != 0.0
    return bool(changes.mean() > MOSTLY) and all((each >= 0.0).all() or (each <= 0.0).all() for each in steps)


def _moved(found: Calibration, seen: Whitened, column: Asked) -> Moved:
    """How joints move with a column; with a weight by its torque, that is by its lever about each of them."""
    by_joints = seen.joints
    if is_payload(column.name) and found.variable is not None:
        by_joints = (
            by_joints * np.einsum("vaj,a->vj", by_joints[:, :AXES], found.variable.hyper["up"])[:, None]
        )
    chance, turned = seen.explained(by_joints * column.values[:, None, None])
    way = np.linalg.norm((by_joints @ turned)[:, :AXES], axis=1)
    return Moved(column, chance, float(MM_PER_METRE * column.reach * way.mean()))


def _of_slip(slip: Slip, asked: Sequence[Moved], seen: Whitened) -> Notice:
    """A step; of a joint with the columns that change there, which may be what moves it."""
    visits = np.flatnonzero(seen.rows == slip.behind)
    if slip.notice.kind != JOINT_MOVED or not len(visits):
        return slip.notice
    there = [moved for moved in asked if moved.column.changes_at(int(visits[0]))]
    if not there:
        return slip.notice
    names = " and ".join(moved.column.name for moved in there)
    change, it, which = ("change", "one of them", "NAME") if len(there) > 1 else ("changes", "it", names)
    text = (
        f"{slip.notice} But {names} {change} there as well: if {it} is what moves the joints, and {KNOWN}, "
        f"calibrate with --features {which}{_to_fill(there)}."
    )
    return Notice(slip.notice.kind, text)


def _with_columns(columns: list[Moved]) -> Notice:
    several = len(columns) > 1
    names = " and ".join(moved.words for moved in columns)
    which = f"NAME, of one that is {KNOWN}" if several else f"{columns[0].column.name}, if it is {KNOWN}"
    text = (
        f"Errors go with {names}, as of joints that move with {'them' if several else 'it'}, and no pose "
        "explains it: it is taken for noise, and intervals may be too narrow. Calibrate with --features "
        f"{which}{_to_fill(columns)}."
    )
    return Notice(UNUSED_COLUMN, text)


def _to_fill(columns: list[Moved]) -> str:
    """What a feature needs that rows lack."""
    lack = any(moved.column.lacking for moved in columns)
    return ", and its empty cells filled in or their rows left out" if lack else ""


def _while_measured(told: list[Moved]) -> Notice:
    """Of what cannot be told from the time, the likeliest first."""
    named = [moved for moved in told if moved.column.name != ORDER]
    also = ", or note its temperature in a column and calibrate with --features."
    if named:
        names = " and ".join(moved.column.name for moved in named)
        several = len(named) > 1
        go, it, which = ("go", "one of them", "NAME") if several else ("goes", "it", names)
        also = (
            f". {names} {go} one way meanwhile, as the time does, and these rows do not tell them apart: if "
            f"{it} is what moves the joints, and {KNOWN}, calibrate with --features {which}{_to_fill(named)}."
        )
    text = (
        "The joints moved while they were measured, whatever the pose, as those of an arm that warms up: "
        f"from the first row to the last the target by {length_mm(told[0].mean_mm, 2)} on average. It is "
        f"taken for noise, and intervals may be too narrow. Warm the arm up before measuring{also} Rows are "
        "taken to be in the order of measuring: if they are not, give --drift none."
    )
    return Notice(JOINTS_MOVED, text)
