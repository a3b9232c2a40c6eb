"""How set-ups moved while they were measured."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from truearm.fits.details import DriftDetails
from truearm.fits.fitted_rows import FittedRows
from truearm.judgement.validation import at_first_measured
from truearm.reporting.charts import axis, legend, line, points, running_median
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import listed, short
from truearm.reporting.parts import Figure
from truearm.reporting.style import colour_of, marker_of
from truearm.types import Floats
from truearm.units import MM_PER_METRE

COORDINATES: Final = (("x", "nominal"), ("y", "constant"), ("z", "variable"))
"""Each in the manner of a model, which differ in colour, dash and symbol."""
BINS: Final = 40
FEWEST: Final = 5
"""Medians along a session at the most, and rows of each at the least: enough to see a curve by eye."""
MOST_SHOWN: Final = 4
"""Set-ups with a figure of their own, those that moved most."""


def drifts(facts: Facts) -> Iterator[Figure]:
    """A figure of each set-up that moved; of none where the rows were left out of the file."""
    rows, drift = facts.calibration.rows, facts.calibration.validation.drift
    if rows is None or rows.moved is None or rows.progress is None or drift is None:
        return
    groups = sorted(drift.moved_mm, key=lambda group: -drift.moved_mm[group])
    for group in groups[:MOST_SHOWN]:
        yield _drift(facts, rows, (rows.moved, rows.progress), group, drift)


def _drift(
    facts: Facts, rows: FittedRows, found: tuple[Floats, Floats], group: str, drift: DriftDetails
) -> Figure:
    """The figure of a set-up; `found` are displacement (n, 3) and progress (n,) of all rows."""
    moved_m, progress = found
    own = np.flatnonzero(rows.data.group == group)
    own = own[np.argsort(progress[own])]
    place = np.arange(1.0, len(own) + 1.0)
    moved = MM_PER_METRE * moved_m[own]
    frame = facts.calibration.model.setup.frames[facts.calibration.groups.index(group), :3, :3]
    residual = at_first_measured(rows.residual[own], rows.data.select(own), facts.calibration.selection)
    left = moved + MM_PER_METRE * residual @ frame.T
    traces = []
    for k, (name, manner) in enumerate(COORDINATES):
        _, middles, medians = running_median(place, left[:, k], BINS, FEWEST)
        marker = {"color": colour_of(manner), "symbol": marker_of(manner), "size": 6}
        traces.append(points(middles, medians, manner, name=f"{name}, medians of rows", marker=marker))
        traces.append(line(place, moved[:, k], manner, name=name))
    half = _rows_to_half(moved)
    span = short(drift.moved_mm[group])[0]
    at_once = "".join(f", {jump.words}" for jump in drift.jumps.get(group, ()))
    return Figure(
        f"How the set-up moved: {group}",
        f"Positions measured at the same pose moved by up to {span} mm in the frame of the measuring device"
        f"{at_once}, "
        f"half of the way from where it began within the first {half} of {len(own)} rows. Points are medians "
        f"of what the {facts.best} model leaves of some rows with nothing taken out; the lines were taken "
        "out of all rows, the held-out ones too.",
        traces,
        {
            "xaxis": axis("rows in the order of measuring"),
            "yaxis": axis(f"displacement along {listed([name for name, _ in COORDINATES])}, mm"),
            **legend(),
        },
        height=320,
    )


def _rows_to_half(moved: Floats) -> int:
    """After how many rows half of the way from the first place to the farthest is done."""
    way = np.linalg.norm(moved - moved[0], axis=1)
    return int(np.argmax(way >= 0.5 * way.max())) + 1
