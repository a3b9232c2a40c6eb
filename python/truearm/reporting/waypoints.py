"""The measured poses as waypoints of a program: what compensation makes of them."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from truearm.compensation import Compensated, Compensator
from truearm.errors import count_of
from truearm.limits import Limits, Task
from truearm.measurements import Measurements
from truearm.reporting.numbers import without_zeros

if TYPE_CHECKING:
    from truearm.reporting.facts import Facts

MOST_POSES: Final = 2000
FULL_POSE: Final = 6
AXIS: Final = 5
MOSTLY: Final = 0.5
"""Share of refused waypoints from which a calibration hardly compensates anything."""
BOUNDS: Final[Mapping[int, tuple[str, str]]] = {
    5: ("--largest-joint-deg", "check the zero of that joint (theta in the robot file)"),
    6: ("--largest-mm", "check the robot's table and zeros, and which model its controller computes with"),
    7: (
        "--largest-deg",
        "check the robot's table and zeros and, where positions alone were measured, how the tool is turned",
    ),
    8: ("--largest-std-mm", "measure more poses"),
}
"""Option that widens a bound, and what to look at before, by the code of a refusal."""
LESS: Final = "position"
"""The task that asks for least."""


@dataclass(frozen=True, eq=False)
class Waypoints:
    """Measured rows (n), each corrected alone.

    Attributes:
        data: The rows.
        task: What of the tool was to be met.
        found: What became of them.
    """

    data: Measurements
    task: Task
    found: Compensated

    @classmethod
    def of(cls, facts: "Facts") -> "Waypoints | None":
        """Those of a calibration, the first of many; None of schemes, and where the file has no rows."""
        calibration, rows = facts.calibration, facts.calibration.rows
        if calibration.scheme is not None or rows is None:
            return None
        data = rows.data.select(np.arange(min(len(rows.data), MOST_POSES)))
        task: Task = _task(len(facts.joints))
        alone = Limits(change_mm_per_mm=None, change_mrad_per_rad=None)
        compensator = Compensator(calibration, task=task, limits=alone, features=facts.features or None)
        tool = None if facts.names_tool else facts.point
        return cls(data, task, compensator.joints(data.readings, tool=tool))

    @cached_property
    def main_code(self) -> int | None:
        """Code of the reason for which most are refused; None where most are corrected."""
        refusals = self.found.refusals
        if len(refusals) <= MOSTLY * len(self.found.q):
            return None
        return Counter(refusal.code for refusal in refusals).most_common(1)[0][0]

    @property
    def allowing(self) -> str:
        """The option, after a blank, that allows what is refused most; empty where most are corrected."""
        if self.main_code is None:
            return ""
        if self.main_code in BOUNDS:
            return f" {BOUNDS[self.main_code][0]} NUMBER"
        return "" if self.task == LESS else f" --task {LESS}"

    @property
    def mostly_refused(self) -> str:
        """In words, that most are refused, why, and what to do; empty where most are corrected."""
        if self.main_code is None:
            return ""
        refusals = self.found.refusals
        mine = [refusal.reason for refusal in refusals if refusal.code == self.main_code]
        return (
            f"Of {count_of(len(self.found.q), 'measured row')}, corrected as waypoints, {len(refusals)} are "
            f"refused, {len(mine)} of them for one reason, such as: {without_zeros(mine[0])}. {self._way_out}"
        )

    @property
    def _way_out(self) -> str:
        if self.main_code is not None and self.main_code in BOUNDS:
            option, look = BOUNDS[self.main_code]
            return f"{look[:1].upper()}{look[1:]}; {option} allows more."
        less = "" if self.task == LESS else f"; --task {LESS} asks for less than {self.task}"
        return f"The report lists all reasons{less}."


def _task(joints: int) -> Task:
    return "pose" if joints >= FULL_POSE else "axis" if joints == AXIS else "position"
