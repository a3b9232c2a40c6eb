"""Which rows find frame and tool of a set-up, and which are judged: shots of a pose are on one side."""

from bisect import bisect_left
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import InputError, list_names, rows_in_words
from truearm.fits.enough_values import frame_unknowns, group_unknowns, measured_values
from truearm.fits.fitting import Task
from truearm.measurements import Measurements
from truearm.rows.visits import pose_numbers
from truearm.types import Rows

if TYPE_CHECKING:
    from truearm.evaluation import EvaluationOptions


MOST_FRAME_POSES: Final = 400
FEWEST_FRAME_POSES: Final = 3
FEWEST_JUDGED_POSES: Final = 3
PLENTY: Final = 2
"""Times as many values as unknowns from which on what is found misleads no more than what it is judged on."""


def divide(task: Task, data: Measurements, options: "EvaluationOptions") -> tuple[Rows, Rows]:
    """Rows that find the frames, and rows that are judged; each set-up for itself.

    Raises:
        InputError: If the rows of a set-up do not find its frame and leave some to judge.
    """
    if options.keep_frames:
        return np.empty(0, dtype=np.int64), np.arange(len(data))
    frame, judged = [], []
    for group in data.groups:
        rows = np.flatnonzero(data.group == group)
        order = rows[np.random.default_rng(options.seed).permutation(len(rows))]
        found = _SetUp.of(task, data.select(order), keep_tool=options.keep_tool).finding(options.frame_rows)
        frame.append(order[found])
        judged.append(order[~found])
    return np.concatenate(frame), np.concatenate(judged)


@dataclass(frozen=True, eq=False)
class _SetUp:
    """Rows (n,) of one set-up in the order they are drawn in, and the place of each one's pose."""

    task: Task
    data: Measurements
    place: Rows
    keep_tool: bool

    @classmethod
    def of(cls, task: Task, data: Measurements, *, keep_tool: bool) -> "_SetUp":
        first = pose_numbers(data.readings, data.group)
        _, place = np.unique(first, return_inverse=True)
        return cls(task, data, place.reshape(-1), keep_tool)

    @property
    def poses(self) -> int:
        return int(self.place.max()) + 1

    def finding(self, rows: int | None) -> NDArray[np.bool_]:
        """Which rows (n,) find frame and tool: the first so many with all shots of their poses."""
        enough = self._holding(1)
        count = self._default(enough) if rows is None else self._with_rows(rows)
        if self.poses < enough + FEWEST_JUDGED_POSES or count > self.poses - FEWEST_JUDGED_POSES:
            raise self._none_left(count, enough)
        if count < enough:
            raise self._too_few(count, enough)
        return self.place < count

    def _default(self, enough: int) -> int:
        """A third of the poses, or as many as hold plenty of values if that leaves a third to judge."""
        share = min(self.poses // 3, MOST_FRAME_POSES)
        left = self.poses - max(share, FEWEST_JUDGED_POSES)
        return max(share, enough, min(self._holding(PLENTY), left))

    def _with_rows(self, rows: int) -> int:
        """How many poses, taken whole, the first so many rows are of."""
        return int(np.searchsorted(np.cumsum(np.bincount(self.place)), rows)) + 1

    def _holding(self, times: int) -> int:
        """How many of the poses, the first ones, hold more values than so many times the unknowns they find.

        Where they all do not, as many as would.
        """

        def are_enough(count: int) -> bool:
            values, unknowns = self._counts(count)
            return values > times * unknowns if times == 1 else values >= times * unknowns

        counts = range(FEWEST_FRAME_POSES, self.poses + 1)
        place = bisect_left(counts, True, key=are_enough)
        if place < len(counts):
            return counts[place]
        values, unknowns = self._counts(self.poses)
        return max(FEWEST_FRAME_POSES, times * unknowns * self.poses // max(values, 1) + 1)

    def _counts(self, poses: int) -> tuple[int, int]:
        """Measured values of the first poses, and the unknowns of the set-up that they find."""
        first = self.data.select(np.flatnonzero(self.place < poses))
        unknowns = frame_unknowns(self.task) if self.keep_tool else group_unknowns(self.task, first)
        return measured_values(self.task, first), unknowns

    def _rows(self, poses: int) -> int:
        """How many rows the first poses have."""
        return int((self.place < poses).sum())

    def _none_left(self, count: int, enough: int) -> InputError:
        """That the rows do not find the frame and leave enough poses to judge."""
        needed, left = enough + FEWEST_JUDGED_POSES, self.poses - FEWEST_JUDGED_POSES
        measured = rows_in_words(len(self.data), self.poses)
        words = f"{measured} of set-up {list_names(self.data.groups)}"
        way_out = f"Measure at least {needed} poses"
        if self.poses >= needed:
            found = min(count, self.poses)
            words += f", of which {rows_in_words(self._rows(found), found)} would find its frame"
            way_out = f"Give --frame-rows {self._rows(left)} or less"
        rule = f"At least {enough} poses find its frame, and {FEWEST_JUDGED_POSES} must be left to judge"
        return InputError(words, where=", ".join(self.data.files), rule=rule, way_out=way_out)

    def _too_few(self, count: int, enough: int) -> InputError:
        """That frame rows were stated that hold too few values."""
        values, unknowns = self._counts(count)
        frame = rows_in_words(self._rows(count), count, "frame ")
        return InputError(
            f"{values} measured values in {frame} cannot determine the {unknowns} unknowns of the frame and "
            f"tool of set-up {list_names(self.data.groups)}",
            where=", ".join(self.data.files),
            rule=f"There must be more measured values than unknowns, and {FEWEST_FRAME_POSES} poses",
            way_out=f"Give --frame-rows {self._rows(enough)} or more",
        )
