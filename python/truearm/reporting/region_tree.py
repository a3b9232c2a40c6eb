"""Figure: the tree of regions, coloured by what their parameters do."""

from typing import Final

import numpy as np

from truearm.errors import count_of
from truearm.fits.schemes import RegionalCeps
from truearm.reporting.axes import input_axis
from truearm.reporting.charts import colour_bar
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import fixed, lean, short
from truearm.reporting.parameters import chain_to_point
from truearm.reporting.parts import Figure
from truearm.reporting.style import SEQUENTIAL
from truearm.types import Floats
from truearm.units import MM_PER_METRE

MOST: Final = 600
"""Regions that are drawn; deeper ones are left out."""
POSES: Final = 50
"""Within a region, that tell how far its CEPs move the point."""
SEED: Final = 0
LEAST_MM: Final = 1e-3
"""That colours go to."""


def region_tree(facts: Facts) -> Figure | None:
    """Which region is half of which, how large and how different it is; None where there is no tree."""
    scheme = facts.calibration.model.scheme
    if not isinstance(scheme, RegionalCeps):
        return None
    tree = scheme.regions
    moved = moved_mm(facts, scheme)
    volume = np.prod(tree.high - tree.low, axis=1)
    drawn = [k for k in range(tree.count) if k < MOST]
    held = _rows_in(facts, scheme)
    trace = {
        "type": "icicle",
        "ids": [str(k) for k in drawn],
        "parents": ["" if tree.parents[k] < 0 else str(tree.parents[k]) for k in drawn],
        "labels": ["all" if k == 0 else _label(facts, scheme, k) for k in drawn],
        "values": lean(volume[drawn] / volume[0], 6),
        "branchvalues": "total",
        "text": [f"{short(float(moved[k]))[0]} mm, {count_of(int(held[k]), 'row')}" for k in drawn],
        "hoverinfo": "label+text",
        "marker": {
            "colors": lean(moved[drawn]),
            "cmin": 0.0,
            "cmax": max(float(moved[drawn].max()), LEAST_MM),
            "colorscale": SEQUENTIAL,
            "colorbar": colour_bar("mm"),
        },
        "tiling": {"orientation": "v"},
    }
    leaves = tree.leaves
    worst = int(leaves[int(np.nanargmax(moved[leaves]))])
    depth = int(tree.depths[leaves].max())
    place = _label(facts, scheme, worst)
    return Figure(
        "The regions",
        f"{count_of(len(leaves), 'region')} in up to {count_of(depth, 'halving')}. Their parameters move "
        f"the measured point by {short(float(np.nanmedian(moved[leaves])))[0]} mm in the median and most, "
        f"{short(float(moved[worst]))[0]} mm, with {place}.",
        [trace],
        {"margin": {"l": 4, "r": 4, "t": 4, "b": 4}},
        height=420,
        is_wide=True,
    )


def moved_mm(facts: Facts, scheme: RegionalCeps) -> Floats:
    """How far each region's CEPs together move the judged point (nodes,), mm, RMS over poses within it.

    Single CEPs may move it far and cancel, as theta of one link and a of another do.
    """
    tree, values = scheme.regions, facts.inputs(facts.drawn(POSES))
    joints, columns = facts.calibration.robot.joint_count, list(scheme.columns)
    within = np.random.default_rng(SEED).uniform(size=(len(values), len(scheme.inputs)))
    chain = chain_to_point(facts)
    moved = np.zeros(tree.count)
    for k, ceps in enumerate(scheme.ceps):
        values[:, list(scheme.inputs)] = tree.low[k] + within * (tree.high[k] - tree.low[k])
        jacobian = chain.parameter_jacobian(np.ascontiguousarray(values[:, :joints]))
        moved[k] = np.sqrt(np.square(jacobian[:, :, columns] @ ceps).sum(axis=1).mean())
    return MM_PER_METRE * moved


def _label(facts: Facts, scheme: RegionalCeps, k: int) -> str:
    """Ranges of the region in the joints that its whole was halved along."""
    tree, parts = scheme.regions, []
    for axis, joint in enumerate(scheme.inputs):
        if tree.low[k, axis] > tree.low[0, axis] or tree.high[k, axis] < tree.high[0, axis]:
            low, high = facts.shown_of(joint, np.array([tree.low[k, axis], tree.high[k, axis]]))
            parts.append(
                f"{input_axis(facts, joint).name} {fixed(low, 0)} to {fixed(high, 0)} {facts.unit(joint)}"
            )
    return ", ".join(parts) or "all"


def _rows_in(facts: Facts, scheme: RegionalCeps) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    """Measured rows in each region of any size (nodes,)."""
    tree = scheme.regions
    counts = np.zeros(tree.count, dtype=np.int64)
    if facts.readings is None:
        return counts
    inputs = facts.inputs(facts.readings)[:, list(scheme.inputs)]
    leaf = tree.find(np.ascontiguousarray(inputs))
    np.add.at(counts, leaf, 1)
    for k in range(tree.count - 1, 0, -1):
        counts[tree.parents[k]] += counts[k]
    return counts
