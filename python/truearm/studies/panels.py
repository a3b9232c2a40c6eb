"""The panels of the paper's figures: errors and CEPs along a path, for print."""

from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from string import ascii_lowercase
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from truearm.files import write_whole
from truearm.fits.parameters import ALPHA, THETA, A, D
from truearm.studies.paper import Drawn
from truearm.types import Floats
from truearm.units import MM_PER_METRE

TITLES: Final[Mapping[str, str]] = {
    "uncalibrated": "without calibration",
    "conventional": "conventional",
    "regional": "regional, no FCMAC",
    "fcmac": "regional, FCMAC",
    "cmac": "regional, CMAC",
    "fcmac_shrunk": "shrunk, FCMAC",
    "variable": "variable model (ours)",
}
ROWS: Final[Mapping[str, Sequence[str]]] = {
    "figure6": ("uncalibrated", "conventional", "regional", "fcmac", "variable"),
    "figure7": ("uncalibrated", "conventional", "regional", "fcmac", "variable"),
    "figure8": ("conventional", "regional", "fcmac", "variable"),
    "figure10": ("uncalibrated", "conventional", "regional", "fcmac", "variable"),
    "noise": ("conventional", "regional", "fcmac", "fcmac_shrunk", "variable"),
    "cmac": ("cmac", "fcmac"),
}
FIRST_LINK: Final = 1
LENGTHS: Final = ((D, r"$\Delta d_1$", "#0072B2", "-"), (A, r"$\Delta a_1$", "#D55E00", "--"))
ANGLES: Final = ((THETA, r"$\Delta\theta_1$", "#009E73", "-."), (ALPHA, r"$\Delta\alpha_1$", "#CC79A7", ":"))

LEAST_SPAN: Final = {"mm": 0.1, "deg": 0.02}
WIDTH_IN, ROW_IN = 7.0, 1.75
DPI: Final = 200
STYLE: Final[Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "legend.fontsize": 7,
    "svg.hashsalt": "truearm",
    "svg.fonttype": "none",
}
DATELESS: Final = {"png": {"Software": None}, "svg": {"Date": None}}


def save_panels(drawn: Mapping[str, Drawn], directory: Path) -> list[Path]:
    """Draw each figure into a directory as PNG and SVG; the files."""
    files = []
    for name, content in drawn.items():
        with mpl.rc_context(STYLE):
            files += save_figure(panels(content, ROWS[name]), directory / name)
    return files


def save_figure(figure: Figure, stem: Path) -> list[Path]:
    """Write a figure as PNG and SVG, each completely or not at all, the same bytes every time; the files."""
    files = []
    for ending, metadata in DATELESS.items():
        content = BytesIO()
        figure.savefig(content, format=ending, dpi=DPI, metadata=metadata)
        path = stem.with_suffix(f".{ending}")
        write_whole(path, content.getvalue())
        files.append(path)
    return files


def panels(drawn: Drawn, names: Sequence[str]) -> Figure:
    """The traces of these names, one below the other: errors on the left, (a) and on; CEPs on the right."""
    figure = Figure(figsize=(WIDTH_IN, ROW_IN * len(names) + 0.3), layout="constrained")
    axes = figure.subplots(len(names), 2, sharex=True, squeeze=False)
    letters = iter(ascii_lowercase[len(names) :])
    for row, name in enumerate(names):
        found = drawn.traces[name]
        left, right = axes[row]
        left.plot(found.size_mm, color="black")
        # Points that were not reached leave gaps.
        left.set_ylim(0.0, 1.15 * max(float(np.nanmax(found.size_mm, initial=0.0)), LEAST_SPAN["mm"]))
        left.set_ylabel("position error, mm")
        left.set_title(f"({ascii_lowercase[row]}) {TITLES[name]}", loc="left")
        if name == "uncalibrated":
            right.set_axis_off()
        else:
            _draw_ceps(right, found.parameters - drawn.made.identified.table)
            right.set_title(f"({next(letters)}) CEPs, {TITLES[name]}", loc="left")
        for panel in (left, right):
            panel.grid(visible=True, linewidth=0.3, alpha=0.6)
            panel.margins(x=0.0)
            if drawn.gap is not None:
                for edge in drawn.gap:
                    panel.axvline(edge, color="black", linestyle=":", linewidth=0.8)
    for panel in axes[-1]:
        panel.set_xlabel("point of the path")
    return figure


def _draw_ceps(axes: Axes, ceps: Floats) -> None:
    """Four CEPs of link 1: lengths in mm on the left axis, angles in degrees on the right one."""
    angle_axes = axes.twinx()
    lines = []
    for column, label, colour, style in LENGTHS:
        lines += axes.plot(ceps[:, FIRST_LINK, column] * MM_PER_METRE, style, color=colour, label=label)
    for column, label, colour, style in ANGLES:
        values = np.rad2deg(ceps[:, FIRST_LINK, column])
        lines += angle_axes.plot(values, style, color=colour, label=label)
    for side, unit in ((axes, "mm"), (angle_axes, "deg")):
        low, high = side.get_ylim()
        middle, half = (low + high) / 2.0, max((high - low) / 2.0, LEAST_SPAN[unit] / 2.0)
        side.set_ylim(middle - 1.1 * half, middle + 1.7 * half)
        side.set_ylabel(unit)
        side.ticklabel_format(useOffset=False)
    axes.legend(
        handles=lines, ncols=4, loc="upper center", frameon=False, handlelength=1.8, columnspacing=1.2
    )
