"""What rows of an update say, each with what else may have been at work, and which of it explains them."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from truearm.calibration import Calibration
from truearm.errors import TruearmError
from truearm.fits.fitting import Task
from truearm.measurements import Measurements
from truearm.types import Mask
from truearm.updating.causes import Cause, Nothing, causes
from truearm.updating.checks import check_enough, check_groups
from truearm.updating.estimating import Estimate, estimate
from truearm.updating.moved import untold
from truearm.updating.options import UpdateOptions
from truearm.updating.scale import known_scale
from truearm.updating.scene import Scene, State
from truearm.updating.squares import SquaresTest, cause_test, change_test, rest_test
from truearm.updating.supported import JudgedRows, without_outliers
from truearm.updating.unknowns import Unknowns


@dataclass(frozen=True, eq=False)
class Explanation:
    """Rows without those that no other supports, and the tests of what they say with a cause asked for.

    Attributes:
        calibration: As it was.
        rows: That count.
        held: Joints, from 0, whose offsets are not told, and what they are confounded with.
        outliers: Rows, from 0, that do not count.
        threshold: Below which the p of each test counts.
    """

    calibration: Calibration
    rows: JudgedRows
    held: dict[int, str]
    outliers: list[int]
    threshold: float

    @property
    def unknowns(self) -> Unknowns:
        """What was estimated."""
        return self.rows.scene.unknowns

    @cached_property
    def found(self) -> Estimate:
        """All unknowns."""
        return self._estimate(self.rows.start, self.unknowns.free)

    @cached_property
    def still(self) -> Estimate:
        """What is found anew alone: the old calibration."""
        return self._estimate(self._unchanged, self.unknowns.anew)

    @cached_property
    def changed(self) -> SquaresTest:
        """Whether offsets, base and tools are as they were."""
        unknowns = self.unknowns
        still = self.still
        if unknowns.caused.any():
            still = self._estimate(self._unchanged, unknowns.anew | unknowns.caused)
        return change_test(still, unknowns, self._known)

    @cached_property
    def rest(self) -> SquaresTest:
        """Whether what is left is more than field and noise may leave."""
        return rest_test(self.found, self.unknowns, self._known)

    @cached_property
    def cause(self) -> SquaresTest:
        """Whether there is what else was asked for, whatever offsets, frames and tools are."""
        unknowns, start = self.unknowns, self.rows.start
        without = State(np.where(unknowns.caused[: len(start.arm)], 0.0, start.arm), start.setup)
        found = self._estimate(without, unknowns.free & ~unknowns.caused)
        return cause_test(found, unknowns, self._known)

    @property
    def fits(self) -> bool:
        """Whether nothing more is left than field and noise may leave."""
        return self.rest.freedom > 0 and self.rest.p >= self.threshold

    @property
    def holds(self) -> bool:
        """Whether nothing else is left, nor changed."""
        return self.fits and self.changed.p >= self.threshold

    def is_explained(self, causes_asked: int) -> bool:
        """Whether the cause, one of so many, is plainly there, and nothing else is left."""
        if not self.fits or self.cause.p >= self.threshold / causes_asked:
            return False
        own, found = np.flatnonzero(self.unknowns.caused), self.found
        return not self.unknowns.cause.contradicts(found.state.arm[own], found.covariance[np.ix_(own, own)])

    @property
    def _unchanged(self) -> State:
        return self.rows.scene.unchanged(self.rows.start)

    @property
    def _known(self) -> int:
        return known_scale(self.calibration).freedom

    def _estimate(self, state: State, free: Mask) -> Estimate:
        return estimate(self.rows.scene, self.rows.scatter, state, free)


@dataclass(frozen=True, eq=False)
class Explaining:
    """Rows of an update, and what may have moved.

    Attributes:
        calibration: As it was.
        task: What is measured.
        data: The rows.
        options: What may have moved.
        unknowns: The same, in numbers.
    """

    calibration: Calibration
    task: Task
    data: Measurements
    options: UpdateOptions
    unknowns: Unknowns

    @cached_property
    def likeliest(self) -> Explanation:
        """What offsets, frames and tools explain; where that is not all, or rows are left out for it, what
        they do with one cause more, if that is plainly there and explains all.

        A cause that is asked for only where the calibration does not hold takes nothing from how often it
        does of unchanged arms.
        """
        plain, others = self._plain, self._others
        told = [
            other
            for other in others
            if other.is_explained(len(others))
            and not (plain.holds and len(other.outliers) >= len(plain.outliers))
        ]
        return min(told, key=lambda other: other.cause.p, default=plain)

    @property
    def instead(self) -> list[Cause]:
        """Causes of which each alone explains as well what offsets and tools do."""
        plain = self._plain
        if self.likeliest is not plain or plain.holds or not plain.fits:
            return []
        return [other.unknowns.cause for other in self._others if other.holds]

    @cached_property
    def _plain(self) -> Explanation:
        """What rows say where nothing else is asked for."""
        return self._with(Nothing(self.task.arm))

    @cached_property
    def _others(self) -> list[Explanation]:
        """The same with each cause that can be asked for; none where the calibration plainly holds."""
        holds = self._plain.holds and not self._plain.outliers
        return [] if holds else list(self._asked_for())

    def _asked_for(self) -> Iterator[Explanation]:
        """What each cause that can be asked for explains."""
        readings = self.data.readings
        for cause in causes(self.calibration, readings, take_scale=self.options.take_scale):
            try:
                check_enough(self.data, self.task, self.unknowns.beside(cause))
                yield self._with(cause)
            except TruearmError:
                # Too few rows are left for one unknown more: it is not asked for.
                continue

    def _with(self, cause: Cause) -> Explanation:
        """What rows say where a cause is asked for."""
        rows = self._rows(self.unknowns.beside(cause))
        held = untold(rows.scene, rows.scatter, rows.scene.unchanged(rows.start))
        if held:
            rows = self._rows(self.unknowns.holding(held).beside(cause))
        rows, outliers = without_outliers(self.calibration, rows)
        check_groups(rows.scene.data, self.task)
        return Explanation(self.calibration, rows, held, outliers, self.options.threshold)

    def _rows(self, unknowns: Unknowns) -> JudgedRows:
        return JudgedRows.of(Scene(self.task, self.data, self.calibration, unknowns))
