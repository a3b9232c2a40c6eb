"""Chapter: where to trust it: the standard deviation and the data, over joints and workspace."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.reporting.charts import axis, data_points, heatmap
from truearm.reporting.facts import Facts
from truearm.reporting.known import STRETCHES, Known, means_along
from truearm.reporting.numbers import percent, short
from truearm.reporting.parts import Figure, Part, Section, Text
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]

CELLS: Final = (6, 12)
"""Fewest and most cells of a map along an axis."""
IN_CELL: Final = 5
"""Configurations that a cell should have on average."""
FEWEST_IN_CELL: Final = 2
DRAWN: Final = 1500
MAPPED_JOINTS: Final = 3


def trust(facts: Facts, found: Known | None) -> Section:
    """Maps over the workspace and over pairs of joints."""
    title = "Where to trust it"
    if found is None:
        words = f"The model {facts.best} gives no standard deviations; --model variable does."
        return Section(title, [Text(words)])
    joints = _most_telling(facts, found)
    pairs = [(joints[i], joints[j]) for i in range(len(joints)) for j in range(i + 1, len(joints))]
    parts: list[Part] = [Text(_overall(facts, found)), workspace(facts, found)]
    return Section(title, [*parts, *(pair_map(facts, found, pair) for pair in pairs)])


def _overall(facts: Facts, found: Known) -> str:
    values = [float(np.quantile(found.std_mm, share)) for share in (0.5, 0.9)]
    median, tenth, near = short(*values, float(np.median(found.at_rows_mm)))
    kind = "exact" if found.is_exact else "upper bounds, which compensation judges by"
    where = "the measured poses" if facts.readings is not None else "poses in the usual ranges of the joints"
    return (
        f"Standard deviation of the {facts.point_name} as the arm's model gives it, without noise of the "
        f"measurement (root of the summed variances of x, y and z): the median over {where} is {near} mm, "
        f"over all configurations in the joints' whole ranges {median} mm, and 90 % of these are below "
        f"{tenth} mm. The values are {kind}, at {len(found.std_mm)} configurations."
    )


def _most_telling(facts: Facts, found: Known) -> list[int]:
    """Joints over which the standard deviation changes most, ascending."""
    spread = []
    for joint in range(len(facts.joints)):
        edges = facts.places(joint, STRETCHES + 1, reachable=True)
        spread.append(float(np.nanstd(means_along(found.readings[:, joint], found.std_mm, edges))))
    return sorted(np.argsort(spread)[::-1][:MAPPED_JOINTS].tolist())


def pair_map(facts: Facts, found: Known, pair: tuple[int, int]) -> Figure:
    """Means over two joints, all others anywhere."""
    places = facts.shown(found.readings)[:, list(pair)]
    names = [f"joint {joint + 1}, {facts.unit(joint)}" for joint in pair]
    means, middles, _ = _means(places, found.std_mm)
    most, least = np.nanargmax(means), np.nanargmin(means)
    large, small = short(float(means.flat[most]), float(means.flat[least]))
    where = " and ".join(
        f"joint {joint + 1} near {middles[k][np.unravel_index(most, means.shape)[k]]:.0f} {facts.unit(joint)}"
        for k, joint in enumerate(pair)
    )
    traces = [_map(means, middles, found)]
    says = f"Means over the other joints: from {small} mm to {large} mm, the largest with {where}."
    if facts.readings is not None:
        q = facts.shown(facts.readings[:DRAWN])
        traces.append(data_points(q[:, pair[0]], q[:, pair[1]]))
        says += " Dots are measured poses."
    return Figure(
        f"Standard deviation over joints {pair[0] + 1} and {pair[1] + 1}",
        says,
        traces,
        {"xaxis": axis(names[0]), "yaxis": axis(names[1])},
        height=340,
    )


def _means(places: Floats, values: Floats) -> tuple[Floats, list[Floats], list[Floats]]:
    """Means (c, c) of values in cells of places (n, 2), with the cells' middles and edges."""
    cells = int(np.clip(np.sqrt(len(values) / IN_CELL), *CELLS))
    edges = [np.linspace(float(x.min()), float(x.max()), cells + 1) for x in places.T]
    sums, _, _ = np.histogram2d(places[:, 0], places[:, 1], edges, weights=values)
    counts, _, _ = np.histogram2d(places[:, 0], places[:, 1], edges)
    means = np.where(counts >= FEWEST_IN_CELL, sums / np.maximum(counts, 1), np.nan)
    return np.asarray(means), [0.5 * (ends[1:] + ends[:-1]) for ends in edges], edges


def _map(means: Floats, middles: list[Floats], found: Known) -> dict[str, Any]:
    top = float(f"{np.quantile(found.std_mm, 0.98):.4g}")
    return heatmap(middles[0], middles[1], means.T, "mm", zmin=0, zmax=top)


def workspace(facts: Facts, found: Known) -> Figure:
    """Means over distance from the base's axis and height."""
    means, middles, edges = _means(_radius_height(facts, found.readings), found.std_mm)
    traces = [_map(means, middles, found)]
    k = np.unravel_index(int(np.nanargmax(means)), means.shape)
    where = f"{middles[0][k[0]]:.0f} mm from the axis of the base at height {middles[1][k[1]]:.0f} mm"
    says = f"Largest: {short(float(means[k]))[0]} mm, {where}."
    if facts.readings is not None:
        seen = _radius_height(facts, facts.readings)
        traces.append(data_points(seen[:DRAWN, 0], seen[:DRAWN, 1]))
        measured, _, _ = np.histogram2d(seen[:, 0], seen[:, 1], edges)
        share = float((measured[np.isfinite(means)] > 0).mean())
        says += f" Dots are measured poses; they lie in {percent(share)} of the cells that are filled."
    return Figure(
        "Standard deviation over the workspace",
        says,
        traces,
        {
            "xaxis": axis("distance from the base's z axis, mm"),
            "yaxis": axis("height in the base frame, mm"),
        },
        height=340,
    )


def _radius_height(facts: Facts, q: Floats) -> Floats:
    """Distance from the base's z axis and height of the judged point (n, 2), mm."""
    robot = facts.calibration.robot
    flange = robot.flange_chain.pose(robot.joints_from_readings(q))
    point = MM_PER_METRE * (flange[:, :3, :3] @ facts.point + flange[:, :3, 3])
    return np.stack([np.linalg.norm(point[:, :2], axis=1), point[:, 2]], axis=1)
