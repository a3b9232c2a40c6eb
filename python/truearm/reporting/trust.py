"""Chapter: where to trust it: bounds of the standard deviation and the data, over joints and workspace."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.reporting.charts import axis, data_points, heatmap
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import count_of, percent, short
from truearm.reporting.parts import Figure, Section, Text
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]

CONFIGURATIONS: Final = 6000
GRID: Final = 24
OTHERS: Final = 6
"""Poses that give the joints which a map does not show; the map is their mean."""
STRETCHES: Final = 12
FEWEST_IN_CELL: Final = 2
DRAWN: Final = 1500
MAPPED_JOINTS: Final = 3
STANDS_OUT: Final = 1.5


@dataclass(frozen=True)
class Stretch:
    """A stretch of a joint where the calibration knows least.

    Attributes:
        joint: From 0.
        low: Where it begins, rad or m.
        high: Where it ends.
        std_mm: Mean bound of the standard deviation there.
        median_mm: Median bound of all configurations.
        rows: Measured poses there.
    """

    joint: int
    low: float
    high: float
    std_mm: float
    median_mm: float
    rows: int


def std_mm(facts: Facts, readings: Floats) -> Floats:
    """Bound of the standard deviation of the judged point (n,), mm."""
    features = {name: np.full(len(readings), value) for name, value in facts.features.items()}
    found = facts.calibration.conservative_std(readings, tool=facts.point, features=features or None)
    return np.asarray(MM_PER_METRE * found[:, 0])


def configurations(facts: Facts, count: int = CONFIGURATIONS) -> Floats:
    """Configurations (n, N) drawn evenly from the joints' ranges; the same every time."""
    low, high = facts.reachable.T
    return np.random.default_rng(0).uniform(low, high, (count, len(low)))


def weakest(facts: Facts) -> Stretch | None:
    """The stretch of a joint with the largest bounds, if it stands out; None where bounds are not known."""
    if not facts.calibration.has_conservative:
        return None
    q = configurations(facts)
    values = std_mm(facts, q)
    median, found = float(np.median(values)), None
    for joint, (low, high) in enumerate(facts.reachable):
        edges = np.linspace(low, high, STRETCHES + 1)
        means = _means(q[:, joint], values, edges)
        k = int(np.nanargmax(means))
        if means[k] > STANDS_OUT * median and (found is None or means[k] > found.std_mm):
            rows = 0 if facts.readings is None else _between(facts.readings[:, joint], edges[k], edges[k + 1])
            found = Stretch(joint, edges[k], edges[k + 1], float(means[k]), median, rows)
    return found


def _means(x: Floats, values: Floats, edges: Floats) -> Floats:
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    sums = np.bincount(place, values, len(edges) - 1)
    counts = np.bincount(place, minlength=len(edges) - 1)
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def _between(x: Floats, low: float, high: float) -> int:
    return int(((x >= low) & (x < high)).sum())


def trust(facts: Facts) -> Section:
    """Maps over pairs of joints and over the workspace."""
    title = "Where to trust it"
    if not facts.calibration.has_conservative:
        words = f"The model {facts.best} does not tell how uncertain it is; one with --model variable does."
        return Section(title, [Text(words)])
    values = std_mm(facts, configurations(facts))
    joints = _most_telling(facts, values)
    pairs = [(joints[i], joints[j]) for i in range(len(joints)) for j in range(i + 1, len(joints))]
    top = float(np.quantile(values, 0.98))
    figures = [workspace(facts, top), *(pair_map(facts, pair, top) for pair in pairs)]
    return Section(title, [Text(_overall(facts, values)), *figures])


def _overall(facts: Facts, values: Floats) -> str:
    median, tenth = short(float(np.median(values)), float(np.quantile(values, 0.9)))
    text = (
        f"Over the joints' whole ranges the standard deviation of the measured point is at most {median} "
        "mm in "
        f"half of all configurations and {tenth} mm in nine of ten: the arm's part, without noise."
    )
    if facts.readings is not None:
        here = std_mm(facts, facts.drawn(CONFIGURATIONS))
        near = short(float(np.median(here)))[0]
        text += f" At the measured poses it is {near} mm in the median."
    return f"{text} Values are the bounds that compensation judges by, never below the exact ones."


def _most_telling(facts: Facts, values: Floats) -> list[int]:
    """Joints over which the bound changes most, ascending."""
    q = configurations(facts)
    spread = [
        float(np.nanstd(_means(q[:, joint], values, np.linspace(low, high, STRETCHES + 1))))
        for joint, (low, high) in enumerate(facts.reachable)
    ]
    return sorted(np.argsort(spread)[::-1][:MAPPED_JOINTS].tolist())


def pair_map(facts: Facts, pair: tuple[int, int], top: float) -> Figure:
    """The bound over two joints; the others as in some of the poses."""
    axes = [facts.places(joint, GRID, reachable=True) for joint in pair]
    first, second = (grid.ravel() for grid in np.meshgrid(*axes))
    total = np.zeros(len(first))
    others = facts.drawn(OTHERS)
    for pose in others:
        q = np.repeat(pose[None], len(first), axis=0)
        q[:, pair[0]], q[:, pair[1]] = first, second
        total += std_mm(facts, q)
    values = total / len(others)
    shown = [_shown_axis(facts, joint, ends) for joint, ends in zip(pair, axes, strict=True)]
    names = [f"joint {joint + 1}, {facts.unit(joint)}" for joint in pair]
    k = int(np.argmax(values))
    places = [
        _shown_axis(facts, joint, ends[k : k + 1])[0]
        for joint, ends in zip(pair, (first, second), strict=True)
    ]
    large, small = short(float(values[k]), float(values.min()))
    where = " and ".join(
        f"joint {joint + 1} at {place:.0f} {facts.unit(joint)}"
        for joint, place in zip(pair, places, strict=True)
    )
    traces = [heatmap(shown[0], shown[1], values.reshape(GRID, GRID), "mm", zmin=0, zmax=round(top, 5))]
    traces += _measured_over(facts, pair)
    return Figure(
        f"Standard deviation over joints {pair[0] + 1} and {pair[1] + 1}",
        f"From {small} mm where it is best known to {large} mm with {where}. Dots are measured poses.",
        traces,
        {"xaxis": axis(names[0]), "yaxis": axis(names[1])},
        height=340,
    )


def _shown_axis(facts: Facts, joint: int, values: Floats) -> Floats:
    readings = np.zeros((len(values), len(facts.joints)))
    readings[:, joint] = values
    return facts.shown(readings)[:, joint]


def _measured_over(facts: Facts, pair: tuple[int, int]) -> list[dict[str, object]]:
    if facts.readings is None:
        return []
    q = facts.shown(facts.readings[:DRAWN])
    return [data_points(q[:, pair[0]], q[:, pair[1]])]


def workspace(facts: Facts, top: float) -> Figure:
    """The bound over distance from the base's axis and height, as the mean of configurations there."""
    q = configurations(facts)
    places, values = _radius_height(facts, q), std_mm(facts, q)
    edges = [np.linspace(places[:, k].min(), places[:, k].max(), GRID + 1) for k in range(2)]
    sums, _, _ = np.histogram2d(places[:, 0], places[:, 1], edges, weights=values)
    counts, _, _ = np.histogram2d(places[:, 0], places[:, 1], edges)
    means = np.where(counts >= FEWEST_IN_CELL, sums / np.maximum(counts, 1), np.nan)
    middles = [0.5 * (ends[1:] + ends[:-1]) for ends in edges]
    traces = [heatmap(middles[0], middles[1], means.T, "mm", zmin=0, zmax=round(top, 5))]
    says = "Colours are means over the configurations that reach a place."
    if facts.readings is not None:
        seen = _radius_height(facts, facts.readings)
        traces.append(data_points(seen[:DRAWN, 0], seen[:DRAWN, 1]))
        measured, _, _ = np.histogram2d(seen[:, 0], seen[:, 1], edges)
        reached = counts >= FEWEST_IN_CELL
        share = float((measured[reached] > 0).mean())
        says = (
            f"{count_of(len(seen), 'measured pose')} lie in {percent(share)} of the cells that the arm "
            "reaches. " + says
        )
    k = np.unravel_index(int(np.nanargmax(means)), means.shape)
    where = f"{middles[0][k[0]]:.0f} mm from the axis of the base at height {middles[1][k[1]]:.0f} mm"
    return Figure(
        "Standard deviation over the workspace",
        f"Largest {where}: {short(float(means[k]))[0]} mm. {says}",
        traces,
        {"xaxis": axis("distance from the base's z axis, mm"), "yaxis": axis("height in the base frame, mm")},
        height=340,
    )


def _radius_height(facts: Facts, q: Floats) -> Floats:
    """Distance from the base's z axis and height of the judged point (n, 2), mm."""
    robot = facts.calibration.robot
    flange = robot.flange_chain.pose(robot.joints_from_readings(q))
    point = MM_PER_METRE * (flange[:, :3, :3] @ facts.point + flange[:, :3, 3])
    return np.stack([np.linalg.norm(point[:, :2], axis=1), point[:, 2]], axis=1)
