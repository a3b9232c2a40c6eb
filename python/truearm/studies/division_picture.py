"""The division that stops by itself as a tree, and the forced one as boxes."""

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from truearm.planning.drawing import draw_regions, draw_tree
from truearm.studies.experiment import Experiment
from truearm.studies.panels import STYLE, WIDTH_IN, save_figure


def save_division(stopped: Experiment, forced: Experiment, stem: Path) -> list[Path]:
    """Draw as PNG and SVG; the files."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 6.5), layout="constrained")
        top = figure.add_subplot(2, 2, (1, 2))
        draw_tree(stopped.regions, top)
        count = len(stopped.regions.leaves)
        top.set_title(f"(a) division that stops at 0.1 mm: {count} regions, shares of the volume", loc="left")
        for place, (letter, made) in enumerate((("b", stopped), ("c", forced))):
            axes = draw_regions(made.regions, made.space, figure, (2, 2, 3 + place))
            axes.set_title(f"({letter}) {len(made.regions.leaves)} regions", loc="left")
        return save_figure(figure, stem)
