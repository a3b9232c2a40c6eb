"""Set-ups that move while they are measured: found in what no pose explains, and taken out of the rows.

Arms, instruments and tripods warm up or settle. A set-up's frame is one for the whole session, so that its
movement stays in the residuals, where it is a function of time and not of the pose. What varies with the pose
is fitted first; a drift is what the rest of the rows, in the order of measuring, then shows.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import FieldFit, Setup, find_drift
from truearm.defaults import NO_DRIFT
from truearm.doubts.row_order import places, poses_change
from truearm.doubts.unexplained import unexplained
from truearm.errors import Notice
from truearm.fits.details import ANOTHER_PLACE, DriftDetails, Jump
from truearm.fits.fitted_rows import without_drift
from truearm.fits.fitting import Fits, KnownHyper, Task, core_errors, fit_rows
from truearm.fits.models import VARIABLE
from truearm.judgement.validation import RowErrors
from truearm.measurements import Measurements
from truearm.rows.visits import means, visit_numbers
from truearm.types import Floats, Rows
from truearm.units import MM_PER_METRE

FEWEST_ROWS: Final = 30
"""Training rows of a set-up, at the least, that are asked for a drift: fewer have shown none."""
LEAST_EVIDENCE: Final = 10.0
"""Gain in the logarithm of the evidence from which there is one."""
NOTICEABLE: Final = 0.1
"""A drift, or a change of one, of a smaller root mean square, in deviations of what is left, is let be."""
MOST_LOOKS: Final = 4
"""A fit takes some of a drift for what varies with the pose: the next one, without it, shows the rest."""
ROUGHLY: Final = 1000
"""Training rows at the most that are looked at: a curve over the session needs no more."""
SAMPLED: Final = 200
"""Rows of a set-up whose places are compared with one another: as many as a curve of its lengths needs."""


def _evenly(length: int, count: int) -> Rows:
    """Indices of so many of `length` rows at the most, from the first to the last."""
    return np.unique(np.linspace(0, length - 1, count).astype(np.int64))


def some_of_each(group: NDArray[np.str_], count: int) -> Rows:
    """Indices of so many rows, ascending, shared out among groups; more where each would have too few."""
    names, sizes = np.unique(group, return_counts=True)
    share = max(_share(sorted(sizes.tolist()), count), 2 * FEWEST_ROWS)
    rows = [np.flatnonzero(group == name) for name in names]
    return np.sort(np.concatenate([own[_evenly(len(own), share)] for own in rows]))


def _share(sizes: Sequence[int], count: int) -> int:
    """What each group may have of so many rows, of ascending sizes: what small ones leave others get."""
    left = count
    for k, size in enumerate(sizes):
        fair = left // (len(sizes) - k)
        if size > fair:
            return fair
        left -= size
    return sizes[-1]


@dataclass(frozen=True, eq=False)
class Drift:
    """How the set-ups of n rows moved.

    Attributes:
        moved: Displacement in world of each row from where its set-up was on average (n, 3), m.
        progress: When each row was measured, from 0 for the first of its set-up to 1 for the last (n,).
        jumps: Of each set-up the pairs of rows, from 0, between which it moved at once.
    """

    moved: Floats
    progress: Floats
    jumps: Mapping[str, Sequence[tuple[int, int]]] = field(default_factory=dict)

    @classmethod
    def none(cls, data: Measurements) -> "Drift":
        """No drift of these rows."""
        return cls(np.zeros((len(data), 3)), progress_of(data))

    def __bool__(self) -> bool:
        return bool(self.moved.any())

    def taken_out(self, data: Measurements) -> Measurements:
        """The rows as if nothing had moved."""
        return without_drift(data, self.moved if self else None)

    def spans(self, data: Measurements) -> dict[str, float]:
        """How far apart each set-up that moved has been, at the most, m."""
        from scipy.spatial.distance import pdist  # noqa: PLC0415 - seldom needed, and slow to import

        spans = {}
        for group in data.groups:
            own = self.moved[data.group == group]
            if own.any():
                spans[group] = float(pdist(own[_evenly(len(own), SAMPLED)]).max(initial=0.0))
        return spans


def fit_settled(task: Task, data: Measurements, train: Rows) -> tuple[Fits, Drift]:
    """Fit to the rows `train`, with the drift that they show taken out of all of `data`.

    Only what the variable model leaves is asked for one: constants leave what depends on the pose, and poses
    may have been measured in an order.

    Args:
        task: What to fit. Its option `drift` may forbid to look for one.
        data: All rows, those of each set-up in the order of measuring.
        train: The rows to fit to.

    Returns:
        The fits, with the time and the evaluations of all that it took, and the drift at every row of `data`.
    """
    if task.options.drift == NO_DRIFT or task.options.model != VARIABLE:
        return fit_rows(task, data.select(train)), Drift.none(data)
    drift, some = Drift.none(data), train[some_of_each(data.group[train], ROUGHLY)]
    known, rough = KnownHyper(rough=True), None
    for look in range(MOST_LOOKS):
        rough = fit_rows(task, drift.taken_out(data).select(some), known).after(rough)
        known = KnownHyper(near=rough.variable, rough=True)
        found = _drift_of(task, rough, drift, data, some, most_steps=look + 1)
        if found is None:
            break
        drift = found
    fits = fit_rows(task, drift.taken_out(data).select(train), replace(known, rough=False)).after(rough)
    # Waves and gross rows, which only the finished fit is without, may have hidden one from the rough ones.
    found = None if drift else _drift_of(task, fits, drift, data, train, most_steps=MOST_LOOKS)
    if found is not None:
        drift = found
        fits = fit_rows(task, drift.taken_out(data).select(train), KnownHyper(near=fits.variable)).after(fits)
    return fits, drift


def _drift_of(
    task: Task, fits: Fits, before: Drift, data: Measurements, train: Rows, *, most_steps: int
) -> Drift | None:
    """The drift that the fit to the rows `train` shows; None where it is that which it was made without, or
    next to it.
    """
    if fits.variable is None:
        return None
    left, weight = _residuals_in_world(task, fits.variable, data.select(train))
    left += before.moved[train]
    moved, jumps = before.moved.copy(), dict(before.jumps)
    with task.stages("looking for what drifted"), core_errors(data):
        for group in task.groups:
            every = np.flatnonzero(data.group == group)
            own = np.flatnonzero((data.group[train] == group) & (weight > 0.0))
            times = before.progress[train[own]]
            visits = _visits(times, data.select(train[own]))
            if len(np.unique(visits)) < FEWEST_ROWS:
                continue
            known, seen = (means(values, visits, weight[own]) for values in (times, left[own]))
            trust = means(weight[own], visits, weight[own])
            wanted = np.concatenate([before.progress[every], times])
            found, noise, steps, gain = find_drift(known, seen, trust, wanted, most_steps)
            if gain <= LEAST_EVIDENCE:
                found, steps = np.zeros_like(found), []
            change = found[len(every) :] - before.moved[train[own]]
            if np.sqrt(np.square(change).mean()) > NOTICEABLE * noise:
                moved[every] = found[: len(every)]
                jumps[group] = [_around(step, times, train[own]) for step in steps]
    return None if np.array_equal(moved, before.moved) else Drift(moved, before.progress, jumps)


def _visits(progress: Floats, data: Measurements) -> Rows:
    """For each row (n,) the number of its visit to a pose: its rows count as one.

    They share what no model explains of the pose, which is no sign that rows after each other are alike.
    """
    order = np.argsort(progress, kind="stable")
    visits = np.empty(len(order), dtype=np.int64)
    visits[order] = visit_numbers(data.readings[order], data.group[order])
    return visits


def _around(step: float, progress: Floats, rows: Rows) -> tuple[int, int]:
    """The last of some rows before a step of the progress, and the first behind it."""
    behind = progress > step
    first = np.where(behind, progress, np.inf).argmin()
    return int(rows[np.where(behind, -np.inf, progress).argmax()]), int(rows[first])


def _residuals_in_world(task: Task, fit: FieldFit, data: Measurements) -> tuple[Floats, Floats]:
    """Mean over the targets of what a fit leaves of its rows (n, 3), m, and the weight of each row (n,).

    Rows without a target have none. The others have what the fit gave them, and less where their own sigma
    adds to the noise that all have.
    """
    count = len(task.selection.targets)
    seen = data.seen(task.selection.targets)
    left = fit.residuals[:, : 3 * count].reshape(-1, count, 3)
    mean = (left * seen[:, :, None]).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)[:, None]
    noise = unexplained(task, fit, data)
    weight = fit.weights * seen.any(axis=1) / (1.0 + np.square(data.stated_sigma_m / noise))
    return _turned(mean, data, task.groups, fit.setup), weight


def _turned(
    vectors: Floats, data: Measurements, groups: Sequence[str], setup: Setup, *, back: bool = False
) -> Floats:
    """Vectors (n, 3) of base frames in the worlds of their set-ups, or `back`."""
    turned = np.empty_like(vectors)
    for number, group in enumerate(groups):
        rows, turn = data.group == group, setup.frames[number, :3, :3]
        turned[rows] = vectors[rows] @ (turn if back else turn.T)
    return turned


def progress_of(data: Measurements) -> Floats:
    """When each row was measured, from 0 for the first of its set-up to 1 for the last, (n,).

    Files come in the order in which they first appear, rows in that of their numbers; where these do not tell
    the rows of a set-up apart, all of its rows come in the order in which they are given.
    """
    places = {file: place for place, file in enumerate(data.files)}
    files = np.array([places[file] for file in data.sources.tolist()], dtype=np.int64)
    progress = np.zeros(len(data))
    for group in data.groups:
        own = np.flatnonzero(data.group == group)
        named = np.column_stack([files[own], data.rows[own]])
        if len(np.unique(named, axis=0)) == len(own):
            own = own[np.lexsort((named[:, 1], named[:, 0]))]
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
    jumps = {
        group: tuple(_jump(task, data, drift, group, rows) for rows in drift.jumps[group])
        for group in spans
        if drift.jumps.get(group)
    }
    return DriftDetails(spans, left_in, jumps)


def _jump(task: Task, data: Measurements, drift: Drift, group: str, rows: tuple[int, int]) -> Jump:
    names = [data.row_names(np.arange(len(data)) == row) for row in rows]
    far_m = np.linalg.norm(drift.moved[rows[1]] - drift.moved[rows[0]])
    times = float(drift.progress[rows[0]]), float(drift.progress[rows[1]])
    changed = poses_change(*places(task, data, drift.progress, group), times)
    return Jump(" and ".join(names), float(MM_PER_METRE * far_m), changed)


def drift_notices(details: DriftDetails | None) -> list[Notice]:
    """A notice where set-ups moved."""
    if details is None:
        return []
    ways = [f"{group} by {details.way(group)}" for group in details.moved_mm]
    kind, why = _reason(details)
    text = (
        f"The set-up moved while it was measured, whatever the pose: {'; '.join(ways)}. "
        f"{why} It is taken out of all measurements, the held-out ones too. "
        "Rows are taken to be in the order of measuring: if they are not, give --drift none."
    )
    return [Notice(kind, text)]


def _reason(details: DriftDetails) -> tuple[str, str]:
    """The kind of a notice, and why a set-up moves so."""
    if details.other_places:
        jumps = [jump for own in details.other_places.values() for jump in own]
        where = "; ".join(jump.between for jump in jumps)
        or_else = (
            " As the poses change there too, an arm that is far from its nominal one may look like that."
            if all(jump.poses_change for jump in jumps)
            else ""
        )
        return ANOTHER_PLACE, (
            f"Nothing that is touched slips so far: instrument or target was put elsewhere ({where}), and "
            f"what it was turned by is left in.{or_else} Give the rows before and after names of their own "
            "in a column `group`, or files of their own, and calibrate again: each then has a frame and a "
            "tool of its own. As it is, the shift alone is known."
        )
    if details.slips:
        return "drift", "Something gave way there: a target or a tripod that was touched, play in a joint."
    if details.jumps:
        return (
            "drift",
            "As the poses change there too, this may be what varies with them, and nothing gave way.",
        )
    return "drift", "Arms and instruments that warm up do so."
