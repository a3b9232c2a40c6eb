"""Pictures of a divided space: the tree as in Figure 3 of the paper, the boxes as in Figures 4(b, c)."""

from fractions import Fraction
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from numpy.typing import NDArray

from truearm.planning.spaces import CartesianSpace, Space, SphericalSpace
from truearm.types import Floats
from truearm.units import MM_PER_METRE

if TYPE_CHECKING:
    from truearm._core import Regions


EDGE_POINTS: Final = 12
NAMED_LEAVES: Final = 40
"""More leaves than this have no room for names and shares."""


def draw_tree(regions: "Regions", axes: Axes) -> None:
    """Nodes below their parents, each with its share of the whole volume; leaves have letters or numbers."""
    first_child, leaves = regions.arrays()["child"], regions.leaves.tolist()
    places = _tree_places(first_child)
    named = len(leaves) <= NAMED_LEAVES
    for node, (x, y) in places.items():
        child = int(first_child[node])
        for below in (child, child + 1) if child >= 0 else ():
            axes.plot([x, places[below][0]], [y, places[below][1]], color="black", linewidth=0.6, zorder=1)
        if named:
            share = Fraction(1, 2 ** int(-y))
            shape = {
                "boxstyle": "circle",
                "facecolor": "white" if child >= 0 else "#DDDDDD",
                "linewidth": 0.6,
            }
            axes.text(x, y, str(share), ha="center", va="center", fontsize=6, bbox=shape, zorder=2)
        else:
            axes.plot(x, y, "o", color="black" if child >= 0 else "#D55E00", markersize=1.6, zorder=2)
    if named:
        for number, leaf in enumerate(leaves):
            x, y = places[leaf]
            axes.text(x, y - 0.45, _letter(number), ha="center", va="top", fontsize=7)
    axes.set_axis_off()
    axes.margins(0.05, 0.15)


def draw_regions(regions: "Regions", space: Space, figure: Figure, position: tuple[int, int, int]) -> Axes:
    """The leaves as boxes: joint angles in degrees, positions in mm, spherical ones bent as they are."""
    axes: Axes = figure.add_subplot(*position, projection="3d")
    lines = np.concatenate(
        [_shown(space, _edges(regions.low[leaf], regions.high[leaf])) for leaf in regions.leaves]
    )
    collection = Line3DCollection(list(lines), colors="#0072B2", linewidths=0.35)
    axes.add_collection3d(collection)  # type: ignore[attr-defined]
    low, high = lines.min(axis=(0, 1)), lines.max(axis=(0, 1))
    for side, name, least, most in zip("xyz", _labels(space), low, high, strict=True):
        getattr(axes, f"set_{side}lim")(least, most)
        getattr(axes, f"set_{side}label")(name, fontsize=7)
        axes.tick_params(axis=side, labelsize=6)  # type: ignore[arg-type]
    return axes


def _tree_places(first_child: NDArray[np.int64]) -> dict[int, tuple[float, float]]:
    """Place of each node: leaves side by side in the order of the tree, parents above their middle."""
    places: dict[int, tuple[float, float]] = {}
    order: list[int] = []

    def walk(node: int, depth: int) -> float:
        child = int(first_child[node])
        if child < 0:
            order.append(node)
            x = float(len(order))
        else:
            x = (walk(child, depth + 1) + walk(child + 1, depth + 1)) / 2.0
        places[node] = (x, -float(depth))
        return x

    walk(0, 0)
    return places


def _letter(number: int) -> str:
    return chr(ord("A") + number) if number < 26 else str(number + 1)


def _edges(low: Floats, high: Floats) -> Floats:
    """The twelve edges of a box as lines (12, points, 3)."""
    part = np.linspace(0.0, 1.0, EDGE_POINTS)
    edges = []
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for corner in ((0, 0), (0, 1), (1, 0), (1, 1)):
            line = np.empty((EDGE_POINTS, 3))
            line[:, axis] = low[axis] + part * (high[axis] - low[axis])
            for other, top in zip(others, corner, strict=True):
                line[:, other] = high[other] if top else low[other]
            edges.append(line)
    return np.array(edges)


def _shown(space: Space, lines: Floats) -> Floats:
    if isinstance(space, CartesianSpace):
        flat = space.points(lines.reshape(-1, 3)) * MM_PER_METRE
        return np.asarray(flat.reshape(lines.shape))
    scale = np.array([180.0 / np.pi if unit == "rad" else MM_PER_METRE for unit in space.units])
    return np.asarray(lines * scale)


def _labels(space: Space) -> list[str]:
    if isinstance(space, SphericalSpace | CartesianSpace):
        return ["x, mm", "y, mm", "z, mm"]
    return [
        f"{name}, {'deg' if unit == 'rad' else 'mm'}"
        for name, unit in zip(space.names, space.units, strict=True)
    ]
