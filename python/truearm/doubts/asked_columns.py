"""Columns beside the poses, and the order of the rows, that errors may go with where no pose tells them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.calibration import Calibration
from truearm.defaults import NO_DRIFT
from truearm.doubts.at_once import BESIDE
from truearm.doubts.row_order import FEWEST_VISITS, FOLLOWED, ORDER_OF_POSES, poses_of, share_explained
from truearm.doubts.whitened import Whitened
from truearm.fits.fitted_rows import FittedRows
from truearm.tables.columns import OF_MEASURING
from truearm.types import Floats, Mask

ORDER: Final = ""
"""Name of the order of the rows among the columns."""
MOSTLY: Final = 0.5
"""Share of the steps from visit to visit at which what goes with the time changes."""
EVEN: Final = 1e-4
"""Part of their range by which values differ at the most from what counts rows."""
ROUNDING: Final = 1e-9
"""Part of a mean by which means of equal values differ at the most."""
NEARLY: Final = 2
"""Visits by which the place of a step may be told wrongly."""
APART: Final = 2.0
"""Standard deviations within set-ups by which the means of set-ups differ that are told apart by a column."""


@dataclass(frozen=True, eq=False)
class Asked:
    """A column that the arm or its set-up may move with.

    Attributes:
        name: Its name.
        values: Of each visit (v,), from zero in the mean of each set-up, or of all set-ups; zero where there
            is none.
        lacking: How many rows have none.
        as_time: Whether it goes one way while a set-up is measured, so that it cannot be told from the time.
        levels: How many means of set-ups the values are, of all their visits; 0 where they are from those.
        scatter: The largest standard deviation within a set-up.
    """

    name: str
    values: Floats
    lacking: int = 0
    as_time: bool = False
    levels: int = 0
    scatter: float = 0.0

    def changes_at(self, visit: int) -> bool:
        """Whether it stands at one value before a visit, or one near it, and at another from there on."""
        seen = self.values[max(visit - BESIDE, 0) : visit + BESIDE]
        places = range(max(BESIDE - NEARLY, 1), min(BESIDE + NEARLY, len(seen) - 1) + 1)
        return not self.levels and any(
            abs(seen[k] - seen[k - 1]) > max(np.ptp(seen[:k]), np.ptp(seen[k:])) for k in places
        )

    def differs_in(self, own: Mask) -> bool:
        """Whether it stands otherwise in a set-up, of these visits (v,), than in the others."""
        if not self.levels or own.all() or not own.any():
            return False
        return bool(abs(self.values[own].mean() - self.values[~own].mean()) > APART * self.scatter)

    @property
    def reach(self) -> float:
        """How far it reaches."""
        return float(np.ptp(self.values))


def asked_columns(found: Calibration, rows: FittedRows, seen: Whitened, progress: Floats) -> Iterator[Asked]:
    """Columns that vary and no pose tells, and the order of the rows where they have one.

    What they are within set-ups and what these differ by in their means is asked each by itself: set-ups
    differ in much.

    Args:
        found: A calibration.
        rows: The rows that it was fitted to.
        seen: What it leaves of them, of v visits.
        progress: When each of them was measured, from 0 for the first of its set-up to 1 for the last (n,).
    """
    group, when = rows.data.group[seen.rows], progress[seen.rows]
    poses, in_order = poses_of(found.robot, rows.data.readings[seen.rows]), is_in_order(found)
    # What warms up moves most at first.
    for name, every in _columns(found, rows, np.sqrt(progress) if in_order else None):
        values = every[seen.rows]
        known = np.isfinite(values)
        own = [known & (group == each) for each in np.unique(group[known])]
        if known.sum() < FEWEST_VISITS:
            continue
        if name != ORDER and _counts_rows([(values[each], when[each]) for each in own]):
            continue
        lacking = int((~np.isfinite(every)).sum())
        centred = np.zeros(len(values))
        for each in own:
            centred[each] = values[each] - values[each].mean()
        varies = np.ptp(centred) > ROUNDING * np.abs(values[known]).max()
        if varies and share_explained(poses[known], centred[known]) <= FOLLOWED:
            as_time = in_order and _goes_one_way([values[each] for each in own])
            yield Asked(name, centred, lacking, as_time)
        if name != ORDER:
            between = _between(name, values, own, lacking)
            if between is not None and share_explained(poses[known], between.values[known]) <= FOLLOWED:
                yield between


def each_set_up(group: NDArray[np.str_], progress: Floats) -> Iterator[tuple[str, Asked]]:
    """Each set-up of v visits with its progress (v,), as what only its rows go with."""
    for name in np.unique(group):
        own = group == name
        values = np.where(own, progress - progress[own].mean(), 0.0)
        if own.sum() >= FEWEST_VISITS:
            yield str(name), Asked(ORDER, values, as_time=True)


def _between(name: str, values: Floats, own: Sequence[Mask], lacking: int) -> Asked | None:
    """The means of a column's values (v,) in set-ups, where these differ by more than they scatter within."""
    means = np.array([values[each].mean() for each in own])
    scatter = float(max(values[each].std() for each in own))
    least = max(APART * scatter, ROUNDING * float(np.abs(means).max()))
    if np.ptp(means) <= least:
        return None
    level = np.zeros(len(values))
    for each, mean in zip(own, means, strict=True):
        level[each] = mean
    known = np.any(own, axis=0)
    level[known] -= level[known].mean()
    apart = 1 + int((np.diff(np.sort(means)) > least).sum())
    return Asked(name, level, lacking, levels=apart, scatter=scatter)


def is_in_order(found: Calibration) -> bool:
    """Whether rows are in the order of measuring, and that is none of their poses."""
    is_told = any(notice.kind == ORDER_OF_POSES for notice in found.notices)
    return found.options.drift != NO_DRIFT and not is_told


def _columns(found: Calibration, rows: FittedRows, order: Floats | None) -> Iterator[tuple[str, Floats]]:
    """Names and values (n,) of columns that are no features, and of the order of rows if they have one."""
    if order is not None:
        yield ORDER, order
    for name in map(str, rows.data.features.columns):
        if name not in (*found.options.features, *OF_MEASURING):
            yield name, rows.data.features[name].to_numpy(np.float64)


def _counts_rows(in_set_ups: Sequence[tuple[Floats, Floats]]) -> bool:
    """Whether values (v,) of each set-up are no more than the progress (v,) of measuring, as numbers of rows
    are; what stays as it is in all of them counts none.
    """
    if not any(np.ptp(values) for values, _ in in_set_ups):
        return False
    for values, progress in in_set_ups:
        reach, span = values[-1] - values[0], progress[-1] - progress[0]
        straight = values[0] + reach * (progress - progress[0]) / (span or 1.0)
        if np.abs(values - straight).max() > EVEN * np.ptp(values):
            return False
    return True


def _goes_one_way(in_set_ups: Sequence[Floats]) -> bool:
    """Whether values (v,) of each set-up, in the order of measuring, rise all the while, or fall."""
    steps = [np.diff(values) for values in in_set_ups]
    changes = np.concatenate(steps) != 0.0
    return bool(changes.mean() > MOSTLY) and all((each >= 0.0).all() or (each <= 0.0).all() for each in steps)
