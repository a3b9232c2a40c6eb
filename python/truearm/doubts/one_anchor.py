"""Whether all distances go to one fixed point: held-out ones tell nothing of errors across the way to it."""

from typing import Final

import numpy as np

from truearm.errors import Notice
from truearm.fits.core_set import Selection, anchor_names
from truearm.measurements import Measurements

ONE_ANCHOR: Final = "one_anchor"


def one_anchor(data: Measurements, selection: Selection) -> list[Notice]:
    """A notice where the distances that are fitted go to one fixed point of one set-up."""
    if not selection.distances or data.anchor is None or data.distance_m is None:
        return []
    held = np.isfinite(data.distance_m)
    ways = set(zip(data.group[held].tolist(), data.anchor[held].tolist(), strict=True))
    if len(ways) != 1 or anchor_names(data) != [anchor := ways.pop()[1]]:
        return []
    text = (
        f"All distances go to one fixed point ({anchor}). They tell how far the arm is off on the way to it: "
        "errors across it are not judged, and may be several times larger than those reported, and larger "
        "than standard deviations say. Measure to two more points as well, in other directions from where "
        "the arm works, or judge the calibration on measured points (truearm evaluate)."
    )
    return [Notice(ONE_ANCHOR, text)]
