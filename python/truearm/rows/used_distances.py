"""Whether distances are what is used of measurements."""

import numpy as np

from truearm.errors import InputError
from truearm.measurements import Measurements


def holds_distances(data: Measurements) -> bool:
    """Whether distances are what is used of `data`: beside points they are left out.

    Raises:
        InputError: If only some rows hold distances.
    """
    if data.distance_m is None:
        return False
    has_point = np.asarray(data.seen().any(axis=1))
    if has_point.any() and not has_point.all():
        raise InputError(
            f"only distances were measured in {data.row_names(~has_point)}, points in others",
            where=", ".join(data.files),
            rule="Either all rows hold points, or all hold distances",
            way_out="Keep them in two files and calibrate from one",
        )
    return not bool(has_point.any())
