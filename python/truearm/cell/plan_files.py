"""A plan as a list of poses, and as a picture."""

from io import BytesIO
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from truearm.cell.plan import Plan
from truearm.cell.proposed import Proposed
from truearm.errors import UsageError
from truearm.files import read_bytes, write_whole
from truearm.tables.columns import REPEAT
from truearm.units import MM_PER_METRE

COLOURS: Final = {
    "train": "tab:blue",
    "validate": "tab:orange",
    "repeat": "tab:green",
    "acceptance": "tab:red",
}


def write(plan: Plan | Proposed, path: Path, *, over: bool = True) -> None:
    """Write the poses: q1 ... qN in rad and m, approach, purpose, and the set-up that is meant, if one is.

    Raises:
        UsageError: If other poses are there and are not to be written `over`.
    """
    columns = {f"q{j + 1}": column for j, column in enumerate(plan.poses.readings.T)}
    table = pd.DataFrame(columns | {"approach": plan.poses.approach, "purpose": plan.poses.purpose})
    if plan.poses.group is not None:
        table["group"] = plan.poses.group
    text = table.to_csv(index=False, lineterminator="\n")
    if not over and path.exists() and read_bytes(path) != text.encode():
        raise UsageError(
            f"{path} is there already, with other poses", way_out=f"To write over it name it: -o {path}"
        )
    write_whole(path, text)


def draw(plan: Plan | Proposed, path: Path) -> None:
    """Draw the targets from above and from the side, in the base frame, with the way between them."""
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    purposes = np.array(plan.poses.purpose)
    for axes, (a, b) in zip(figure.subplots(1, 2), ((0, 1), (0, 2)), strict=True):
        millimetres = MM_PER_METRE * plan.points
        axes.plot(millimetres[:, a], millimetres[:, b], color="0.8", linewidth=0.6)
        for purpose, colour in COLOURS.items():
            chosen = millimetres[purposes == purpose]
            if not len(chosen):
                continue
            # Repeated poses are rings around the points that they repeat.
            ring = {"markersize": 8, "fillstyle": "none"} if purpose == REPEAT else {"markersize": 4}
            axes.plot(chosen[:, a], chosen[:, b], "o", color=colour, label=purpose, **ring)
        axes.set_xlabel(f"{'xyz'[a]} mm")
        axes.set_ylabel(f"{'xyz'[b]} mm")
        axes.set_aspect("equal")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
    drawn = BytesIO()
    figure.savefig(drawn, format=path.suffix.removeprefix("."))
    write_whole(path, drawn.getvalue())
