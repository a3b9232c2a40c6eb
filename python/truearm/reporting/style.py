"""Colours, dashes and the layout that all figures share. Hues are those of Okabe and Ito, made for all eyes.

M. Okabe, K. Ito, "Color Universal Design", 2008. Models differ by dash and marker as well, so that a page
printed in grey can be read.
"""

from collections.abc import Mapping
from typing import Any, Final

Layout = dict[str, Any]

LIGHT: Final = {
    "ink": "#1c2127",
    "muted": "#5b6670",
    "grid": "#e3e7eb",
    "paper": "#ffffff",
    "nominal": "#868e96",
    "constant": "#d55e00",
    "variable": "#0072b2",
    "good": "#009e73",
    "accent": "#cc79a7",
    "arm": "#495057",
    "joint": "#212529",
    "band": "rgba(0,114,178,0.20)",
    "low": "#2166ac",
    "middle": "#f7f7f7",
    "high": "#b35806",
}
DARK: Final = {
    "ink": "#e6edf3",
    "muted": "#9aa6b2",
    "grid": "#2d343c",
    "paper": "#14181d",
    "nominal": "#8f98a3",
    "constant": "#f0913a",
    "variable": "#56b4e9",
    "good": "#2bc49a",
    "accent": "#dd9dc0",
    "arm": "#b8c1ca",
    "joint": "#f1f3f5",
    "band": "rgba(86,180,233,0.25)",
    "low": "#6baed6",
    "middle": "#22282f",
    "high": "#f0913a",
}

DASHES: Final[Mapping[str, str]] = {"nominal": "dot", "constant": "dash"}
MARKERS: Final[Mapping[str, str]] = {"nominal": "diamond-open", "constant": "square-open"}
SEQUENTIAL: Final = "Cividis"
DIVERGING: Final = [[0.0, "@low"], [0.5, "@middle"], [1.0, "@high"]]

PLAIN: Final = "none"
"""Numbers of ticks without prefixes: a title names the unit."""

_AXIS: Final = {
    "gridcolor": "@grid",
    "linecolor": "@muted",
    "zerolinecolor": "@grid",
    "tickfont": {"color": "@muted"},
    "title": {"font": {"color": "@ink", "size": 12}, "standoff": 8},
    "automargin": True,
    "exponentformat": PLAIN,
    "ticks": "outside",
    "tickcolor": "@grid",
}
_SCENE_AXIS: Final = {
    "gridcolor": "@grid",
    "zerolinecolor": "@grid",
    "linecolor": "@muted",
    "tickfont": {"color": "@muted", "size": 10},
    "title": {"font": {"color": "@ink", "size": 12}},
    "exponentformat": PLAIN,
    "showbackground": False,
    "nticks": 6,
}
LAYOUT: Final[Layout] = {
    "font": {"family": "system-ui, -apple-system, Segoe UI, Roboto, sans-serif", "size": 12, "color": "@ink"},
    "paper_bgcolor": "rgba(0,0,0,0)",
    "plot_bgcolor": "rgba(0,0,0,0)",
    "margin": {"l": 52, "r": 14, "t": 30, "b": 44},
    "xaxis": _AXIS,
    "yaxis": _AXIS,
    "scene": {"xaxis": _SCENE_AXIS, "yaxis": _SCENE_AXIS, "zaxis": _SCENE_AXIS, "aspectmode": "data"},
    "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0, "font": {"color": "@ink"}},
    "hoverlabel": {"bgcolor": "@paper", "font": {"color": "@ink"}},
    "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": "@muted", "activecolor": "@ink"},
    "showlegend": False,
}


def colour_of(model: str) -> str:
    """Name of the colour of a model: what varies is all of one colour."""
    return f"@{model}" if model in ("nominal", "constant") else "@variable"


def dash_of(model: str) -> str:
    """Dash of the lines of a model."""
    return DASHES.get(model, "solid")


def marker_of(model: str) -> str:
    """Symbol of the points of a model."""
    return MARKERS.get(model, "circle")
