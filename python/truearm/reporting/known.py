"""How well the calibration knows the judged point, at configurations drawn from all that the joints reach."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.reporting.facts import Facts
from truearm.types import Floats
from truearm.units import MM_PER_METRE

MOST: Final = 1500
FEWEST: Final = 300
WORK: Final = 1e10
"""Measured values squared, times configurations, that exact standard deviations may cost: a few seconds."""
LARGEST: Final = 6000
"""More values than these are summed up in fewer weights, and cost no more."""
STRETCHES: Final = 12
STANDS_OUT: Final = 1.5


@dataclass(frozen=True, eq=False)
class Known:
    """Standard deviations of the judged point.

    Attributes:
        readings: Configurations (n, N), drawn evenly from a turn of each joint, or what was measured.
        std_mm: Root of the sum of the variances of x, y and z (n,), the arm's part alone, mm.
        at_rows_mm: The same at some of the measured poses (k,).
        is_exact: Whether these are exact; bounds of them otherwise.
    """

    readings: Floats
    std_mm: Floats
    at_rows_mm: Floats
    is_exact: bool


@dataclass(frozen=True)
class Stretch:
    """A stretch of a joint where the calibration knows least.

    Attributes:
        joint: From 0.
        low: Where it begins, rad or m.
        high: Where it ends.
        std_mm: Mean standard deviation there.
        median_mm: Median of all configurations.
        rows: Measured poses there.
    """

    joint: int
    low: float
    high: float
    std_mm: float
    median_mm: float
    rows: int


def known(facts: Facts) -> Known | None:
    """Exact values where the rows are there, else their bounds; None where neither is told."""
    if not facts.calibration.has_conservative:
        return None
    count, is_exact = _affordable(facts)
    readings = configurations(facts, count)
    rows = facts.drawn(count // 3)
    return Known(readings, std_mm(facts, readings, is_exact), std_mm(facts, rows, is_exact), is_exact)


def configurations(facts: Facts, count: int) -> Floats:
    """Configurations (n, N) drawn evenly from all that the joints reach; the same every time."""
    low, high = facts.within_a_turn.T
    return np.asarray(np.random.default_rng(0).uniform(low, high, (count, len(low))))


def _affordable(facts: Facts) -> tuple[int, bool]:
    """How many configurations, and whether exact values of them can be had."""
    calibration, rows = facts.calibration, facts.calibration.learned_from
    if calibration.variable is None or rows is None:
        return MOST, calibration.variable is None
    count = WORK / min(rows.residual.size, LARGEST) ** 2
    return int(np.clip(count, FEWEST, MOST)), True


def std_mm(facts: Facts, readings: Floats, is_exact: bool) -> Floats:
    """Root of the sum of the variances of x, y and z of the judged point (n,), or a bound of it, mm."""
    calibration, features = facts.calibration, facts.features or None
    if is_exact:
        found = np.linalg.norm(
            calibration.position_std(readings, tool=facts.point, features=features), axis=1
        )
    else:
        found = calibration.conservative_std(readings, tool=facts.point, features=features)[:, 0]
    return np.asarray(MM_PER_METRE * found)


def weakest(facts: Facts, found: Known) -> Stretch | None:
    """The stretch of a joint with the largest standard deviation, if it stands out."""
    median, worst = float(np.median(found.std_mm)), None
    for joint in range(len(facts.joints)):
        edges = facts.places(joint, STRETCHES + 1)
        means = means_along(found.readings[:, joint], found.std_mm, edges)
        k = int(np.nanargmax(means))
        if means[k] > STANDS_OUT * median and (worst is None or means[k] > worst.std_mm):
            rows = 0 if facts.readings is None else _between(facts.readings[:, joint], edges[k], edges[k + 1])
            worst = Stretch(joint, float(edges[k]), float(edges[k + 1]), float(means[k]), median, rows)
    return worst


def means_along(x: Floats, values: Floats, edges: Floats) -> Floats:
    """Means of values (n,) between edges (b + 1,) of x (n,): (b,), NaN where there are none."""
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    sums = np.bincount(place, values, len(edges) - 1)
    counts = np.bincount(place, minlength=len(edges) - 1)
    return np.asarray(np.where(counts > 0, sums / np.maximum(counts, 1), np.nan))


def _between(x: Floats, low: float, high: float) -> int:
    return int(((x >= low) & (x < high)).sum())
