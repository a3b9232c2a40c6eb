"""Distances to a fixed point that are all off by one length: the zero of a wire is unknown."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from truearm.core_set import anchor_names
from truearm.errors import Notice, count_of
from truearm.fitting import Task
from truearm.measurements import Measurements
from truearm.models import ArmModel
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]

DISTANCE_ZERO: Final = "distance_zero"
EXPLAINED: Final = 0.7
"""A length that leaves a smaller part of what is missed is no chance."""
SURE: Final = 5.0
"""Standard errors that such a length has to be."""
UNKNOWNS: Final = 7
"""Where the fixed point and the target are, and the length."""
FEWEST: Final = 3 * UNKNOWNS
"""Distances to one fixed point, at the least."""


@dataclass(frozen=True)
class Zero:
    """How much longer distances to a fixed point are than they can be.

    Attributes:
        length_m: By how much.
        std_m: Standard error of that.
        before_m: What is missed as they are, root mean square.
        after_m: What is missed once that is subtracted.
    """

    length_m: float
    std_m: float
    before_m: float
    after_m: float

    @property
    def is_sure(self) -> bool:
        """Whether distances with this length taken out surely fit the arm better."""
        return self.after_m < EXPLAINED * self.before_m and abs(self.length_m) > SURE * self.std_m


def zero_notices(task: Task, data: Measurements, models: Sequence[ArmModel]) -> list[Notice]:
    """Warnings where distances to one anchor fit the arm once one length is subtracted.

    Constants may have taken a part of that length over: it is told by that of the models it fits best.
    """
    if data.anchor is None or data.distance_m is None:
        return []
    found = []
    for number, anchor in enumerate(anchor_names(data)):
        for index, group in enumerate(task.groups):
            rows = data.select((data.anchor == anchor) & (data.group == group) & np.isfinite(data.distance_m))
            if len(rows) >= FEWEST:
                zeros = [_zero(task, rows, model, (index, number)) for model in models]
                zero = min(zeros, key=lambda each: each.after_m)
                found += [_notice(anchor, zero, len(rows))] if zero.is_sure else []
    return found


def _zero(task: Task, rows: Measurements, model: ArmModel, place: tuple[int, int]) -> Zero:
    """That of rows of one set-up, by its number, with distances to one anchor, by its number."""
    group, anchor = place
    measured = np.asarray(rows.distance_m)
    values = np.ascontiguousarray(task.arm.robot.joints_from_readings(rows.readings))
    flanges = task.arm.flange_chain.pose(values, np.ascontiguousarray(model.constants))
    frame = model.setup.frames[group]
    fixed = frame[:3, :3].T @ (model.setup.anchors[anchor] - frame[:3, 3])
    start = np.concatenate([model.setup.targets[group, 0], fixed, [0.0]])

    def missed(unknowns: Floats) -> Floats:
        targets = flanges[:, :3, :3] @ unknowns[:3] + flanges[:, :3, 3]
        left: Floats = np.linalg.norm(targets - unknowns[3:6], axis=1) + unknowns[6] - measured
        return left

    def missed_without(unknowns: Floats) -> Floats:
        return missed(np.append(unknowns, 0.0))

    without, with_it = least_squares(missed_without, start[:6]), least_squares(missed, start)
    before, after = (float(np.sqrt(np.square(each.fun).mean())) for each in (without, with_it))
    noise = after * np.sqrt(len(rows) / (len(rows) - UNKNOWNS))
    std = float(noise * np.linalg.norm(np.linalg.pinv(np.asarray(with_it.jac, dtype=np.float64))[6]))
    return Zero(float(with_it.x[6]), std, before, after)


def _notice(anchor: str, zero: Zero, count: int) -> Notice:
    before, after, std = (MM_PER_METRE * each for each in (zero.before_m, zero.after_m, zero.std_m))
    length = f"{MM_PER_METRE * abs(zero.length_m):.4g} mm"
    too, how = ("long", f"Subtract {length} from") if zero.length_m > 0.0 else ("short", f"Add {length} to")
    text = (
        f'The {count_of(count, "distance")} to "{anchor}" seem to be {length} too {too}, give or take '
        f"{std:.2g} mm: without that they miss the arm by {after:.3g} mm in place of {before:.3g} mm, root "
        "mean square. A wire has to be counted from the point that it leads to, not from where it was "
        f"switched on. {how} these distances and calibrate again."
    )
    return Notice(DISTANCE_ZERO, text)
