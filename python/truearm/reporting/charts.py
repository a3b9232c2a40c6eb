"""Traces that several figures use."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from truearm.reporting.numbers import lean
from truearm.reporting.style import PLAIN, SEQUENTIAL, colour_of, dash_of, marker_of
from truearm.types import Floats, Rows

Trace = dict[str, Any]

EVERY_NAME: Final[Mapping[str, Any]] = {"tickmode": "linear", "dtick": 1, "tickfont": {"size": 9}}
"""Of an axis of names: each of them is shown, on a phone too."""


def axis(title: str, **more: object) -> dict[str, Any]:
    """An axis with a title, which names the unit."""
    return {"title": {"text": title}, **more}


def log_axis(title: str, low: float, high: float) -> dict[str, Any]:
    """A logarithmic axis with the round numbers 1, 2, 5 as its ticks."""
    first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
    ticks = [round(m * 10.0**e, 9) for e in range(first, last + 1) for m in (1, 2, 5)]
    text = [f"{tick:g}" for tick in ticks]
    ends = [float(np.log10(low)), float(np.log10(high))]
    return axis(title, type="log", tickvals=ticks, ticktext=text, range=lean(ends))


def line(x: ArrayLike, y: ArrayLike, model: str, **more: Any) -> Trace:
    """A line in the manner of a model."""
    shape = {"color": colour_of(model), "dash": dash_of(model), "width": 2}
    return {
        "type": "scatter",
        "mode": "lines",
        "name": model,
        "x": lean(x),
        "y": lean(y),
        "line": shape,
    } | more


def points(x: ArrayLike, y: ArrayLike, model: str, *, faint: bool = True, **more: Any) -> Trace:
    """Points in the manner of a model: `faint` beside a line that tells of them, or where they are many."""
    look = {"size": 4, "opacity": 0.45} if faint else {"size": 8, "opacity": 1.0}
    marker = {"color": colour_of(model), "symbol": marker_of(model), **look}
    return {
        "type": "scatter",
        "mode": "markers",
        "name": model,
        "x": lean(x),
        "y": lean(y),
        "marker": marker,
    } | more


def band(x: ArrayLike, low: ArrayLike, high: ArrayLike, **more: Any) -> Trace:
    """The area between two curves."""
    around = [*lean(x), *reversed(lean(x))]
    values = [*lean(high), *reversed(lean(low))]
    return {
        "type": "scatter",
        "mode": "lines",
        "x": around,
        "y": values,
        "fill": "toself",
        "fillcolor": "@band",
        "line": {"width": 0},
        "hoverinfo": "skip",
        "showlegend": False,
    } | more


def heatmap(x: ArrayLike, y: ArrayLike, z: ArrayLike, bar: str, **more: Any) -> Trace:
    """A map of values (len(y), len(x)); `bar` names them with their unit."""
    return {
        "type": "heatmap",
        "x": lean(x),
        "y": lean(y),
        "z": lean(z),
        "colorscale": SEQUENTIAL,
        "colorbar": colour_bar(bar),
        "hoverongaps": False,
    } | more


def colour_bar(title: str) -> dict[str, Any]:
    """A colour bar with a title beside it."""
    return {
        "title": {"text": title, "side": "right", "font": {"color": "@ink", "size": 11}},
        "thickness": 12,
        "outlinewidth": 0,
        "exponentformat": PLAIN,
        "tickfont": {"color": "@muted"},
    }


def stretches(x: Floats, bins: int, fewest: int) -> tuple[Floats, Rows]:
    """Edges (b + 1,) of equal shares of x (n,), and the share that each is in (n,).

    None is empty; they are fewer where x are few.
    """
    count = max(1, min(bins, len(x) // fewest))
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, count + 1)))
    if len(edges) < 2:
        return edges.repeat(2), np.zeros(len(x), dtype=np.int64)
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    filled, place = np.unique(place, return_inverse=True)
    return np.append(edges[filled], edges[-1]), place


def running_median(x: Floats, y: Floats, bins: int, fewest: int) -> tuple[Floats, Floats, Floats]:
    """Edges (b + 1,) of equal shares of x (n,), and medians (b,) of x and y (n,) in each."""
    edges, place = stretches(x, bins, fewest)
    middles, medians = (
        np.array([np.median(values[place == k]) for k in range(len(edges) - 1)]) for values in (x, y)
    )
    return edges, middles, medians


def data_points(x: ArrayLike, y: ArrayLike, **more: Any) -> Trace:
    """Where measurements were taken."""
    return {
        "type": "scatter",
        "mode": "markers",
        "name": "measured",
        "x": lean(x),
        "y": lean(y),
        "marker": {"color": "@paper", "size": 4, "line": {"color": "@ink", "width": 0.7}},
        "hoverinfo": "skip",
    } | more


def legend(**more: object) -> Mapping[str, Any]:
    """Layout that shows the legend above the figure."""
    return {"showlegend": True, "margin": {"t": 34}, **more}
