"""How many poses an update uses: its time grows with the third power of their number."""

from typing import Final

import numpy as np

from truearm.errors import Notice
from truearm.measurements import Measurements
from truearm.nominal_misfit import some_rows

MOST_POSES: Final = 500
"""They tell offsets, frame and tool far better than the calibration's field is known."""
FEWEST_OF_A_GROUP: Final = 20


def some_poses(data: Measurements) -> tuple[Measurements, list[Notice]]:
    """At most 500 poses, spread evenly over each set-up in the order of measuring; and that so few are used.

    Each set-up has the same share at the most, and never less than twenty of its poses.
    """
    if len(data) <= MOST_POSES:
        return data, []
    share = max(MOST_POSES // len(data.groups), FEWEST_OF_A_GROUP)
    chosen = [some_rows(np.flatnonzero(data.group == group), share) for group in data.groups]
    rows = np.sort(np.concatenate(chosen))
    if len(rows) == len(data):
        return data, []
    text = (
        f"{len(rows)} of {len(data)} poses are used, spread evenly: more of them tell offsets, frame and "
        "tool hardly better. So many poses are enough to calibrate anew, which finds another field as well: "
        "truearm calibrate."
    )
    return data.select(rows), [Notice("some_poses", text)]
