"""Arms and set-ups that move with what was noted beside the poses, or while they are measured, and no pose
explains.

Motors warm up and gears creep, so that each joint stands a little further on than its reading says, by an
amount that goes with a temperature or with the time; links grow, loads turn joints by their torque, and a
device turns on its stand. Where no feature tells the model, it takes that for noise. What each of them is is
asked for in what the model leaves of the rows.
"""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.doubts.asked_columns import Asked, asked_columns, each_set_up, is_in_order
from truearm.doubts.at_once import JOINT_MOVED, SCALE_DIFFERS
from truearm.doubts.moved_words import (
    BOTH,
    DEVICE,
    JOINTS,
    LINKS,
    LOAD,
    Moved,
    of_device,
    of_slip,
    of_time,
    with_columns,
)
from truearm.doubts.row_order import FEWEST_VISITS, FOLLOWED, poses_of, share_explained
from truearm.doubts.slips import Slip
from truearm.doubts.whitened import Whitened, about_middle
from truearm.errors import Notice
from truearm.fits.fitted_rows import ODDS_OF_CHANCE, FittedRows
from truearm.fits.identified import FRAME_UNKNOWNS
from truearm.inputs import is_payload
from truearm.types import AXES, Floats
from truearm.units import MM_PER_METRE

MAY_BE_A_COLUMN: Final = (JOINT_MOVED, SCALE_DIFFERS)
"""Steps that something that was noted may be the reason of."""
CLEARLY: Final = 3.0
"""Logarithm of evidence by which joints and links together are told before either alone: 20 to one."""
SOME_LEVELS: Final = 3
"""Set-ups that a column tells apart from which more may go with it than that one differs from the others."""


def moved_joints(
    found: Calibration, rows: FittedRows, seen: Whitened, progress: Floats, slips: Sequence[Slip]
) -> list[Notice]:
    """A warning where joints or links move with a column that is not used, or with the order of the rows, or
    the device turns evenly; where a step explains more, what stands otherwise from some row on, with the
    columns that change there.

    Args:
        found: A calibration of what varies: constants leave too much that poses explain.
        rows: The rows that it was fitted to.
        seen: What it leaves of them.
        progress: When each of them was measured, from 0 for the first of its set-up to 1 for the last (n,).
        slips: Steps that explain what is left.
    """
    if found.variable is None or len(seen.rows) < FEWEST_VISITS:
        return []
    columns = list(asked_columns(found, rows, seen, progress))
    asked = [*_of_columns(found, seen, columns), *_of_devices(found, rows, seen, progress)]
    told = [moved for moved in asked if moved.chance * len(asked) < ODDS_OF_CHANCE]
    told.sort(key=lambda moved: -moved.gain)
    if slips and (not told or max(slip.gain for slip in slips) >= told[0].gain - np.log(len(asked))):
        return [_of_slip(slip, columns, rows, seen) for slip in slips]
    return _told(told)


def _told(told: Sequence[Moved]) -> list[Notice]:
    """The most evident of what moved in words; a column that the time does not tell before the time."""
    if not told:
        return []
    if told[0].what == DEVICE:
        return [of_device(moved) for moved in told if moved.what == DEVICE]
    best = {moved.column.name: moved for moved in reversed(told) if moved.what != DEVICE}
    likeliest = [moved for moved in told if best.get(moved.column.name) is moved]
    columns = [moved for moved in likeliest if not moved.column.as_time]
    return [with_columns(columns) if columns else of_time(likeliest)]


def _of_columns(found: Calibration, seen: Whitened, columns: Sequence[Asked]) -> Iterator[Moved]:
    """How the arm moves with columns: joints or links; with a weight joints by its torque, that is by its
    lever about each of them. Of two set-ups that differ in much a torque alone tells more than a step does.
    """
    for column in columns:
        if is_payload(column.name) and found.variable is not None:
            up = found.variable.hyper["up"]
            lever = np.einsum("vaj,a->vj", seen.joints[:, :AXES], up)[:, None]
            yield _moved(seen, column, LOAD, seen.joints * lever)
        elif not column.levels or column.levels >= SOME_LEVELS:
            yield from _of_arm(seen, column)


def _of_arm(seen: Whitened, column: Asked) -> Iterator[Moved]:
    """How joints and links move with a column: each alone, and both where that is clearly more evident."""
    scaled = seen.scaled[:, :, None]
    alone = _moved(seen, column, JOINTS, seen.joints), _moved(seen, column, LINKS, scaled)
    both = _moved(seen, column, BOTH, np.concatenate([seen.joints, scaled], axis=2))
    yield from alone
    if both.gain > max(each.gain for each in alone) + CLEARLY:
        yield both


def _of_devices(found: Calibration, rows: FittedRows, seen: Whitened, progress: Floats) -> Iterator[Moved]:
    """How the frame of each set-up turns evenly about the middle of its points, where a frame is found and
    the order of the rows is none of their poses.
    """
    if found.arm.frame_unknowns != FRAME_UNKNOWNS or not is_in_order(found):
        return
    group, poses = rows.data.group[seen.rows], poses_of(found.robot, rows.data.readings[seen.rows])
    turns = about_middle(seen.setup[:, :, AXES:FRAME_UNKNOWNS], seen.held, group)
    for name, column in each_set_up(group, progress[seen.rows]):
        own = group == name
        if share_explained(poses[own], column.values[own]) <= FOLLOWED:
            yield _moved(seen, column, DEVICE, np.where(own[:, None, None], turns, 0.0), name)


def _moved(seen: Whitened, column: Asked, what: str, by: Floats, group: str = "") -> Moved:
    """What moves with a column, by derivatives (v, m, k)."""
    explained = seen.explained(by * column.values[:, None, None])
    way = np.linalg.norm((by @ explained.sizes)[:, :AXES], axis=1)
    mean_mm = float(MM_PER_METRE * column.reach * way[way > 0.0].mean()) if way.any() else 0.0
    sizes = column.reach * explained.sizes
    return Moved(column, what, explained.chance, explained.gain, mean_mm, sizes, group)


def _of_slip(slip: Slip, columns: Sequence[Asked], rows: FittedRows, seen: Whitened) -> Notice:
    """A step; of what a column may be the reason of, with those that change there."""
    if slip.notice.kind not in MAY_BE_A_COLUMN:
        return slip.notice
    if slip.behind is None:
        own = rows.data.group[seen.rows] == slip.group
        there = [column for column in columns if column.differs_in(own)]
    else:
        visits = np.flatnonzero(seen.rows == slip.behind)
        there = [column for column in columns if len(visits) and column.changes_at(int(visits[0]))]
    return of_slip(slip.notice, there) if there else slip.notice
