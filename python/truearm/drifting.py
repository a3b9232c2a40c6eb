"""Set-ups that move while they are measured: found in what no pose explains, and taken out of the rows.

Arms, instruments and tripods warm up or settle. A set-up's frame is one for the whole session, so that its
movement stays in the residuals, where it is a function of time and not of the pose. What varies with the pose
is fitted first; a drift is what the rest of the rows, in the order of measuring, then shows.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import pdist

from truearm._core import Setup, find_drift
from truearm.details import DriftDetails
from truearm.errors import Notice
from truearm.fitting import Fits, Task, core_errors, fit_rows
from truearm.measurements import Measurements
from truearm.units import MM_PER_METRE
from truearm.validation import RowErrors

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

FEWEST_ROWS: Final = 30
"""Rows of a set-up, at the least, that are asked for a drift."""
OVERWHELMING: Final = 10.0
"""Gain in the logarithm of the evidence from which there is one."""
NOTICEABLE: Final = 0.3
"""A drift whose root mean square is less than this, in standard deviations of what is left, is let be."""
SETTLED: Final = 0.2
"""The same of a change of the drift that was taken out."""
MOST_FITS: Final = 3
"""A fit takes some of a drift for what varies with the pose: the next one, without it, shows the rest."""
TRUSTED: Final = 0.5
"""Outliers have less weight."""
SAMPLED: Final = 200
NO_DRIFT: Final = "none"


@dataclass(frozen=True, eq=False)
class Drift:
    """How the set-ups of n rows moved.

    Attributes:
        moved: Displacement in world of each row from where its set-up was on average (n, 3), m.
    """

    moved: Floats

    @classmethod
    def none(cls, count: int) -> "Drift":
        """No drift, of so many rows."""
        return cls(np.zeros((count, 3)))

    def __bool__(self) -> bool:
        return bool(self.moved.any())

    def taken_out(self, data: Measurements) -> Measurements:
        """The rows as if nothing had moved."""
        return replace(data, targets=data.targets - self.moved[:, None]) if self else data

    def spans(self, data: Measurements) -> dict[str, float]:
        """How far apart each set-up that moved has been, at the most, m."""
        spans = {}
        for group in data.groups:
            own = self.moved[data.group == group]
            if own.any():
                some = own[np.unique(np.linspace(0, len(own) - 1, SAMPLED).astype(np.int64))]
                spans[group] = float(pdist(some).max(initial=0.0))
        return spans


def fit_settled(task: Task, data: Measurements, train: Rows) -> tuple[Fits, Drift]:
    """Fit to the rows `train`, with the drift that they show taken out of all of `data`.

    Args:
        task: What to fit. Its option `drift` may forbid to look for one.
        data: All rows, those of each set-up in the order of measuring.
        train: The rows to fit to.

    Returns:
        The fits, and the drift at every row of `data`.
    """
    drift = Drift.none(len(data))
    fits = fit_rows(task, data.select(train))
    if task.options.drift == NO_DRIFT or task.selection.distances:
        return fits, drift
    for _ in range(MOST_FITS - 1):
        found = _drift_of(task, fits, data, (train, drift.moved[train]))
        if found is None:
            break
        drift = found
        with task.stages("taking out what drifted"):
            fits = fit_rows(task, drift.taken_out(data).select(train))
    return fits, drift


def _drift_of(task: Task, fits: Fits, data: Measurements, trained: tuple[Rows, Floats]) -> Drift | None:
    """The drift that fits show; None where it is that which they were made without, or next to it.

    `trained` are the rows that were fitted and what was taken out of each (n, 3).
    """
    train, before = trained
    left, trusted = _residuals_in_world(task, fits)
    progress, changed = _progress(data), False
    moved = np.zeros((len(data), 3))
    for group in task.groups:
        rows = np.flatnonzero(data.group == group)
        own = np.flatnonzero((data.group[train] == group) & trusted)
        if len(own) < FEWEST_ROWS:
            continue
        known = progress[train[own]]
        wanted = np.concatenate([progress[rows], known])
        with core_errors(data):
            found, noise, _, gain = find_drift(known, (left + before)[own], wanted)
        if gain < OVERWHELMING:
            continue
        moved[rows] = found[: len(rows)]
        change = found[len(rows) :] - before[own]
        least = SETTLED if before[own].any() else NOTICEABLE
        changed |= bool(np.sqrt(np.square(change).mean()) > least * noise)
    return Drift(moved) if changed else None


def _residuals_in_world(task: Task, fits: Fits) -> tuple[Floats, NDArray[np.bool_]]:
    """Mean over the targets of what the best model leaves (n, 3), m, and which of the n rows to trust."""
    data, count = fits.data, len(task.selection.targets)
    best = fits.constant if fits.variable is None else fits.variable
    seen = np.asarray(np.isfinite(data.targets[:, list(task.selection.targets)]).all(axis=2))
    left = best.residuals.reshape(len(data), -1)[:, : 3 * count].reshape(-1, count, 3)
    mean = (left * seen[:, :, None]).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)[:, None]
    in_world = _turned(mean, data, task.groups, best.setup)
    return in_world, seen.any(axis=1) & (best.weights > TRUSTED)


def _turned(
    vectors: Floats, data: Measurements, groups: Sequence[str], setup: Setup, *, back: bool = False
) -> Floats:
    """Vectors (n, 3) of base frames in the worlds of their set-ups, or `back`."""
    turned = np.empty_like(vectors)
    for number, group in enumerate(groups):
        rows, turn = data.group == group, setup.frames[number, :3, :3]
        turned[rows] = vectors[rows] @ (turn if back else turn.T)
    return turned


def _progress(data: Measurements) -> Floats:
    """When each row was measured, from 0 for the first of its set-up to 1 for the last, (n,)."""
    places = {file: place for place, file in enumerate(data.files)}
    files = np.array([places[file] for file in data.sources.tolist()], dtype=np.int64)
    order = np.lexsort((data.rows, files))
    progress = np.zeros(len(data))
    for group in data.groups:
        own = order[data.group[order] == group]
        progress[own] = np.linspace(0.0, 1.0, len(own))
    return progress


def drift_details(
    task: Task, fits: Fits, drift: Drift, judged: tuple[Measurements, Rows, Mapping[str, RowErrors]]
) -> DriftDetails | None:
    """How far set-ups moved, and what errors would be with that left in; None where nothing moved.

    `judged` are all rows, those that were held out, and the errors of each model there without the drift.
    """
    if not drift:
        return None
    data, holdout, errors = judged
    held, moved = data.select(holdout), drift.moved[holdout]
    left_in = {}
    for name, model in fits.models(task.arm).items():
        in_base = _turned(moved, held, task.groups, model.setup, back=True)
        distance = np.linalg.norm(errors[name].position + in_base, axis=1)
        left_in[name] = float(MM_PER_METRE * np.nanmean(distance))
    spans = {group: MM_PER_METRE * span for group, span in drift.spans(data).items()}
    return DriftDetails(spans, left_in)


def drift_notices(details: DriftDetails | None) -> list[Notice]:
    """A notice where set-ups moved."""
    if details is None:
        return []
    spans = [f"{group} by {span:.2g} mm" for group, span in details.moved_mm.items()]
    name, left_in = list(details.left_in_mean_mm.items())[-1]
    text = (
        f"The set-up moved while it was measured, whatever the pose: {', '.join(spans)}. Arms and "
        "instruments that warm up do so. It is taken out of all measurements, the held-out ones too; with it "
        f"left in, the {name} model's mean error there is {left_in:.4g} mm. Rows are taken to be in the "
        "order of measuring: if they are not, give --drift none."
    )
    return [Notice("drift", text)]
