"""Joints that move with what was noted beside the poses, or while they are measured, and no pose explains.

Motors warm up and gears creep, so that each joint stands a little further on than its reading says, by an
amount that goes with a temperature or with the time. Where no feature tells the model, it takes that for
noise. What each joint is off is asked for in what the model leaves of the rows.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.calibration import Calibration
from truearm.defaults import NO_DRIFT
from truearm.doubts.row_order import FEWEST_VISITS, FOLLOWED, ORDER_OF_POSES, poses_of, share_explained
from truearm.doubts.whitened import AXES, Whitened
from truearm.errors import Notice
from truearm.fits.fitted_rows import FittedRows
from truearm.inputs import is_payload
from truearm.lengths import length_mm
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]

UNUSED_COLUMN: Final = "unused_column"
JOINTS_MOVED: Final = "joints_moved"
OVERWHELMING: Final = 1e-6
"""Chance explains as much in less than so many calibrations, however many columns are asked."""
ORDER: Final = ""
"""Name of the order of the rows among the columns."""


@dataclass(frozen=True, eq=False)
class Asked:
    """A column that joints may move with.

    Attributes:
        name: Its name.
        values: Of each visit (v,), from zero in the mean of each set-up.
    """

    name: str
    values: Floats

    @property
    def reach(self) -> float:
        """How far it reaches within the set-ups."""
        return float(np.ptp(self.values))


@dataclass(frozen=True)
class Moved:
    """A column that joints move with.

    Attributes:
        name: Its name.
        chance: How likely chance explains as much.
        mean_mm: How far the target moves on average, from the lowest value to the highest.
    """

    name: str
    chance: float
    mean_mm: float

    @property
    def words(self) -> str:
        """Its name, and how far."""
        return f"{self.name} (by {length_mm(self.mean_mm, 2)} from its lowest value to its highest)"


def moved_joints(found: Calibration, seen: Whitened, progress: Floats) -> list[Notice]:
    """A warning where joints move with a column that is not used, or with the order of the rows.

    Args:
        found: A calibration of what varies: constants leave too much that poses explain.
        seen: What it leaves of its rows.
        progress: When each of them was measured, from 0 for the first of its set-up to 1 for the last (n,).
    """
    if found.rows is None or found.variable is None or len(seen.rows) < FEWEST_VISITS:
        return []
    asked = list(_asked(found, found.rows, seen, progress))
    told = [
        moved for column in asked if (moved := _moved(found, seen, column)).chance * len(asked) < OVERWHELMING
    ]
    columns = sorted((moved for moved in told if moved.name != ORDER), key=lambda moved: moved.chance)
    if columns:
        return [_with_columns(columns)]
    return [_while_measured(moved) for moved in told]


def _asked(found: Calibration, rows: FittedRows, seen: Whitened, progress: Floats) -> Iterator[Asked]:
    """Columns that vary and no pose tells, and the order of the rows where they have one."""
    data = rows.data.select(seen.rows)
    named = {
        str(name): data.features[name].to_numpy(np.float64)
        for name in data.features.columns
        if name not in found.options.features
    }
    if found.options.drift != NO_DRIFT and all(notice.kind != ORDER_OF_POSES for notice in found.notices):
        # What warms up moves most at first.
        named[ORDER] = np.sqrt(progress[seen.rows])
    poses = poses_of(found.robot, data.readings)
    for name, values in named.items():
        if not np.isfinite(values).all():
            continue
        centred = values.copy()
        for group in data.groups:
            own = data.group == group
            centred[own] -= values[own].mean()
        column = Asked(name, centred)
        if column.reach > 0.0 and share_explained(poses, centred) <= FOLLOWED:
            yield column


def _moved(found: Calibration, seen: Whitened, column: Asked) -> Moved:
    """How joints move with a column; with a weight by its torque, that is by its lever about each of them."""
    by_joints = seen.joints
    if is_payload(column.name) and found.variable is not None:
        by_joints = (
            by_joints * np.einsum("vaj,a->vj", by_joints[:, :AXES], found.variable.hyper["up"])[:, None]
        )
    chance, turned = seen.explained(by_joints * column.values[:, None, None])
    way = np.linalg.norm((by_joints @ turned)[:, :AXES], axis=1)
    return Moved(column.name, chance, float(MM_PER_METRE * column.reach * way.mean()))


def _with_columns(columns: list[Moved]) -> Notice:
    several = len(columns) > 1
    names = " and ".join(moved.words for moved in columns)
    which = "NAME, of one that is known where programs run" if several else columns[0].name
    text = (
        f"Errors go with {names}, as of joints that move with {'them' if several else 'it'}, and no pose "
        "explains it: it is taken for noise, and intervals may be too narrow. Calibrate with --features "
        f"{which}."
    )
    return Notice(UNUSED_COLUMN, text)


def _while_measured(moved: Moved) -> Notice:
    text = (
        "The joints moved while they were measured, whatever the pose, as those of an arm that warms up: "
        f"from the first row to the last the target by {length_mm(moved.mean_mm, 2)} on average. It is taken "
        "for noise, and intervals may be too narrow. Warm the arm up before measuring, or note its "
        "temperature in a column and calibrate with --features. Rows are taken to be in the order of "
        "measuring: if they are not, give --drift none."
    )
    return Notice(JOINTS_MOVED, text)
