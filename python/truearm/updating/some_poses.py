"""How many poses an update uses: its time grows with the third power of the number of their values."""

from typing import Final

import numpy as np

from truearm.errors import Notice
from truearm.fits.core_set import Selection
from truearm.measurements import Measurements
from truearm.rows.evenly import some_rows
from truearm.rows.visits import pose_count

MOST_VALUES: Final = 1500
"""They tell offsets, frame and tool far better than the calibration's field is known: 500 points."""
FEWEST_OF_A_GROUP: Final = 20


def some_poses(data: Measurements, selection: Selection) -> tuple[Measurements, list[Notice]]:
    """At most 1500 values, spread evenly over the visits of each set-up in the order of measuring; and that
    so few are used.

    Each set-up has the same share at the most, and never less than twenty of its visits. A visit has three
    values of each target that is used, and three of an orientation.
    """
    most = MOST_VALUES // (3 * (len(selection.targets) + selection.orientation))
    if len(data) <= most:
        return data, []
    share = max(most // len(data.groups), FEWEST_OF_A_GROUP)
    chosen = [some_rows(np.flatnonzero(data.group == group), share) for group in data.groups]
    rows = np.sort(np.concatenate(chosen))
    if len(rows) == len(data):
        return data, []
    visits = "poses" if pose_count(data) == len(data) else "visits to poses"
    text = (
        f"{len(rows)} of {len(data)} {visits} are used, spread evenly: more of them tell offsets, frame and "
        "tool hardly better. So many poses are enough to calibrate anew, which finds another field as well: "
        "truearm calibrate."
    )
    return data.select(rows), [Notice("some_poses", text)]
