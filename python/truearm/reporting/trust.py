"""Chapter: where to trust it: the standard deviation and the data, over joints and workspace."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.fits.models import CONSTANT
from truearm.reporting.charts import axis, data_points, heatmap
from truearm.reporting.facts import Facts
from truearm.reporting.known import STRETCHES, Known, configurations, means_along, std_mm
from truearm.reporting.numbers import fixed, percent, short
from truearm.reporting.parts import Figure, Part, Section, Text
from truearm.types import Floats
from truearm.units import MM_PER_METRE

Index = NDArray[np.int64]

CELLS: Final = (6, 12)
"""Fewest and most cells of a map along an axis."""
IN_CELL: Final = 5
"""Configurations that a cell should have on average."""
FEWEST_IN_CELL: Final = 2
POOL: Final = 8192
"""Configurations among which those are looked for that a cell lacks."""
SCALE: Final = 2.0
"""Colours go at least to so many times the mean error, or the median: what is known that well is dark."""
DRAWN: Final = 1500
MAPPED_JOINTS: Final = 3


@dataclass(frozen=True, eq=False)
class Cells:
    """A map: means of the standard deviation in cells over two coordinates.

    Attributes:
        means: Of each cell (c, c), mm, NaN where no configuration reaches.
        edges: Of the cells along both coordinates (c + 1,).
        measured: Coordinates of measured poses (n, 2); none where they are not known.
    """

    means: Floats
    edges: tuple[Floats, Floats]
    measured: Floats

    @property
    def middles(self) -> list[Floats]:
        """Of the cells, along both coordinates (c,)."""
        return [0.5 * (ends[1:] + ends[:-1]) for ends in self.edges]

    def extreme(self, which: Callable[[Floats], Any]) -> tuple[float, list[float]]:
        """The mean of the cell that np.nanargmax or np.nanargmin picks, and its middle."""
        place = np.unravel_index(int(which(self.means)), self.means.shape)
        return float(self.means[place]), [float(x[k]) for x, k in zip(self.middles, place, strict=True)]


def trust(facts: Facts, found: Known | None) -> Section:
    """Maps over the workspace and over pairs of joints."""
    title = "Where to trust it"
    if found is None:
        words = f"The model {facts.best} gives no standard deviations; --model variable does."
        return Section(title, [Text(words)])
    joints = _most_telling(facts, found)
    pairs = [(joints[i], joints[j]) for i in range(len(joints)) for j in range(i + 1, len(joints))]
    parts: list[Part] = [Text(_overall(facts, found)), Text(_colours(facts, found)), workspace(facts, found)]
    return Section(title, [*parts, *(pair_map(facts, found, pair) for pair in pairs)])


def _overall(facts: Facts, found: Known) -> str:
    values = [float(np.quantile(found.std_mm, share)) for share in (0.5, 0.9)]
    median, tenth, near = short(*values, float(np.median(found.at_rows_mm)))
    kind = "exact" if found.is_exact else "upper bounds, which compensation judges by"
    where = "the measured poses" if facts.readings is not None else "poses in the usual ranges of the joints"
    noise = "with what the constants leave" if facts.best == CONSTANT else "without noise of the measurement"
    return (
        f"Standard deviation of the {facts.point_name} as the arm's model gives it, {noise} "
        f"(root of the summed variances of x, y and z): the median over {where} is {near} mm, "
        f"over all configurations within one turn of each joint, or what was measured, {median} mm, and 90 % "
        f"of these are below {tenth} mm. The values are {kind}, at {len(found.std_mm)} configurations."
        f"{facts.at_features}"
    )


def _is_like_errors(facts: Facts, found: Known) -> bool:
    """Whether the values compare with the mean error.

    Those of constants, which all calibrations from distances have, hold all that these leave; bounds are
    larger than the values that they are of.
    """
    return found.is_exact and facts.best != CONSTANT


def _top_mm(facts: Facts, found: Known) -> float:
    """Where the colours of all maps end."""
    usual = facts.mean_mm() if _is_like_errors(facts, found) else float(np.median(found.std_mm))
    return max(float(np.quantile(found.std_mm, 0.98)), SCALE * usual)


def _colours(facts: Facts, found: Known) -> str:
    """What the colours of the maps mean."""
    mean, top = short(facts.mean_mm(), _top_mm(facts, found))
    compared = (
        f" The {facts.mean_error} on {facts.judged} poses is {mean} mm: where the standard deviation is "
        "below it, predictions are known as well as they were found to be; in brighter cells they are known "
        "worse."
        if _is_like_errors(facts, found)
        else ""
    )
    return (
        f"Colours go from 0 to {top} mm in all maps.{compared} Cells without a colour are out of the arm's "
        "reach."
    )


def _most_telling(facts: Facts, found: Known) -> list[int]:
    """Joints over which the standard deviation changes most, ascending."""
    spread = []
    for joint in range(len(facts.joints)):
        edges = facts.places(joint, STRETCHES + 1)
        spread.append(float(np.nanstd(means_along(found.readings[:, joint], found.std_mm, edges))))
    return sorted(np.argsort(spread)[::-1][:MAPPED_JOINTS].tolist())


def pair_map(facts: Facts, found: Known, pair: tuple[int, int]) -> Figure:
    """Means over two joints, all others anywhere."""
    cells = _cells(facts, found, lambda q: facts.shown(q)[:, list(pair)])
    names = [f"joint {joint + 1}, {facts.unit(joint)}" for joint in pair]
    most, place = cells.extreme(np.nanargmax)
    large, small = short(most, cells.extreme(np.nanargmin)[0])
    where = " and ".join(
        f"joint {joint + 1} near {fixed(middle, 0)} {facts.unit(joint)}"
        for joint, middle in zip(pair, place, strict=True)
    )
    says = f"Means over the other joints: from {small} mm to {large} mm, the largest with {where}."
    if len(cells.measured):
        says += " Dots are measured poses."
    return Figure(
        f"Standard deviation over joints {pair[0] + 1} and {pair[1] + 1}",
        says,
        _traces(cells, _top_mm(facts, found)),
        {"xaxis": axis(names[0]), "yaxis": axis(names[1])},
        height=340,
    )


def _cells(facts: Facts, found: Known, coordinates: Callable[[Floats], Floats]) -> Cells:
    """Means in cells over two coordinates (n, 2) of readings (n, N); every cell that is reached has one.

    Configurations that cells lack are drawn besides; a cell that only measured poses reach takes those.
    """
    measured = np.empty((0, len(facts.joints))) if facts.readings is None else facts.readings
    pool = np.concatenate([configurations(facts, POOL), measured])
    places, there = coordinates(found.readings), coordinates(pool)
    both = np.concatenate([places, there])
    count = int(np.clip(np.sqrt(len(places) / IN_CELL), *CELLS))
    first, second = (np.linspace(float(x.min()), float(x.max()), count + 1) for x in both.T)
    edges = (first, second)
    own, others = _numbers(places, edges), _numbers(there, edges)
    lacking = np.maximum(FEWEST_IN_CELL - np.bincount(own, minlength=count * count), 0)
    more = np.concatenate([np.flatnonzero(others == cell)[:few] for cell, few in enumerate(lacking)])
    values = np.concatenate([found.std_mm, std_mm(facts, pool[more], found.is_exact)])
    numbers = np.concatenate([own, others[more]])
    sums = np.bincount(numbers, values, count * count)
    counts = np.bincount(numbers, minlength=count * count)
    means = np.where(counts > 0, sums / np.maximum(counts, 1), np.nan).reshape(count, count)
    return Cells(means, edges, coordinates(measured))


def _numbers(places: Floats, edges: tuple[Floats, Floats]) -> Index:
    """Number of the cell of each place (n, 2), first coordinate first."""
    count = len(edges[0]) - 1
    first, second = (
        np.clip(np.searchsorted(ends, x, side="right") - 1, 0, count - 1)
        for ends, x in zip(edges, places.T, strict=True)
    )
    return np.asarray(first * count + second)


def _traces(cells: Cells, top_mm: float) -> list[dict[str, Any]]:
    """The map, and dots where poses were measured."""
    first, second = cells.middles
    top = float(f"{top_mm:.4g}")
    traces = [heatmap(first, second, cells.means.T, "mm", zmin=0, zmax=top, xgap=1, ygap=1)]
    if len(cells.measured):
        traces.append(data_points(cells.measured[:DRAWN, 0], cells.measured[:DRAWN, 1]))
    return traces


def workspace(facts: Facts, found: Known) -> Figure:
    """Means over distance from the base's axis and height."""
    cells = _cells(facts, found, lambda q: _radius_height(facts, q))
    largest, place = cells.extreme(np.nanargmax)
    small, large = short(cells.extreme(np.nanargmin)[0], largest)
    says = (
        f"From {small} mm to {large} mm, the largest {fixed(place[0], 0)} mm from the axis of the base at "
        f"height {fixed(place[1], 0)} mm."
    )
    if len(cells.measured):
        count = np.bincount(_numbers(cells.measured, cells.edges), minlength=cells.means.size)
        share = float((count[np.isfinite(cells.means).ravel()] > 0).mean())
        says += f" Dots are measured poses; they lie in {percent(share)} of the cells that the arm reaches."
    return Figure(
        "Standard deviation over the workspace",
        says,
        _traces(cells, _top_mm(facts, found)),
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
