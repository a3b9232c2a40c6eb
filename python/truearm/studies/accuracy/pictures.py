"""Learning curves of the methods, one panel a set and split."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from truearm.studies.accuracy.methods import FAMILIES, OURS, TITLES
from truearm.studies.accuracy.splits import TITLES as SPLITS
from truearm.studies.panels import STYLE, save_figure

COLOURS: Final = {
    OURS: "#0072B2",
    "constant": "#000000",
    "curves": "#D55E00",
    "gravity": "#009E73",
    "gp-joint": "#CC79A7",
    "gp-additive": "#E69F00",
    "trees": "#56B4E9",
}
PALE: Final = "#bbbbbb"
PANEL_IN: Final = (2.6, 2.1)
TICKS_MM: Final = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
FEWEST_TICKS: Final = 2
MOST_COLUMNS: Final = 4
LEGEND_ROW_IN: Final = 0.2
STEM: Final = "learning_curves"
CROWDED: Final = 1.5
"""Ratio of two numbers of poses below which their labels would touch."""


def save_curves(summary: Mapping[str, Any], directory: Path) -> list[Path]:
    """Draw median mean errors over training poses into a directory as PNG and SVG; the files."""
    names = [name for name in summary["sets"] if any(g["set"] == name for g in summary["groups"])]
    kinds = [kind for kind in summary["splits"] if any(g["split"] == kind for g in summary["groups"])]
    if not names:
        return []
    with mpl.rc_context(STYLE):
        figure = Figure(layout="constrained")
        panels = figure.subplots(len(names), len(kinds), squeeze=False)
        lines: dict[str, Any] = {}
        for row, name in enumerate(names):
            for column, kind in enumerate(kinds):
                _draw(panels[row][column], summary, name, kind, lines)
        columns = min(MOST_COLUMNS, len(kinds))
        legend_in = LEGEND_ROW_IN * math.ceil(len(lines) / columns)
        figure.set_size_inches(PANEL_IN[0] * len(kinds), PANEL_IN[1] * len(names) + legend_in)
        figure.legend(
            list(lines.values()), list(lines), loc="outside lower center", ncols=columns, frameon=False
        )
        return save_figure(figure, directory / STEM)


def _labels(sizes: Sequence[int]) -> list[str]:
    """Labels of ascending numbers of poses; one that the next would touch stays empty."""
    neighbours = zip(sizes, [*sizes[1:], math.inf], strict=True)
    return [str(size) if following >= CROWDED * size else "" for size, following in neighbours]


def _draw(axes: Axes, summary: Mapping[str, Any], name: str, kind: str, lines: dict[str, Any]) -> None:
    groups = [g for g in summary["groups"] if (g["set"], g["split"]) == (name, kind)]
    groups.sort(key=lambda group: group["n_train"])
    if not groups:
        axes.set_axis_off()
        return
    for method in TITLES:
        points = [(g["n_train"], g["methods"].get(method, {}).get("mean_mm")) for g in groups]
        known = [(x, y) for x, y in points if y is not None]
        if FAMILIES[method] == "block" or not known:
            continue
        (line,) = axes.plot(
            *zip(*known, strict=True),
            color=COLOURS.get(method, PALE),
            linewidth=2.0 if method == OURS else 1.0,
            marker=".",
            markersize=4,
            zorder=3 if method in COLOURS else 1,
        )
        lines.setdefault(TITLES[method] if method in COLOURS else "other methods", line)
    axes.set_xscale("log")
    axes.set_yscale("log")
    sizes = [group["n_train"] for group in groups]
    axes.set_xticks(sizes, _labels(sizes))
    axes.minorticks_off()
    low, high = axes.get_ylim()
    ticks = [tick for tick in TICKS_MM if low <= tick <= high]
    if len(ticks) < FEWEST_TICKS:
        below = max((tick for tick in TICKS_MM if tick <= low), default=low)
        above = min((tick for tick in TICKS_MM if tick >= high), default=high)
        ticks = [below, *ticks, above]
        axes.set_ylim(below, above)
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_title(f"{name}, {SPLITS[kind]}", fontsize=6)
    axes.set_xlabel("training poses")
    axes.set_ylabel("mean error, mm")
    axes.grid(visible=True, linewidth=0.3, alpha=0.6)
