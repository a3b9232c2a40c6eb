"""Ways on which all joints go straight from one place to the next, and the rules that hold on them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np

from truearm.planning.accessibility import Places, Rule, answer_of, lowest
from truearm.robot import Robot
from truearm.types import Floats, Mask

STEP_RAD: Final = np.deg2rad(1.0)
STEP_M: Final = 5e-3
"""Steps of joints that turn and that slide in which a way is looked at. A point at 1.3 m that three joints
turn at once leaves the straight line between two steps by half a millimetre."""
FIRST_LOOK: Final = 8
"""Every so many steps are looked at first: most ways that break a rule break it there already."""


def stepped(robot: Robot, stops: Floats) -> Floats:
    """Readings (n, N) along the straight ways through stops (s, N), which are among them."""
    pieces = [
        begin
        + np.linspace(0.0, 1.0, steps_of_way(robot, begin, end), endpoint=False)[:, None] * (end - begin)
        for begin, end in pairwise(stops)
    ]
    return np.concatenate([*pieces, stops[-1:]])


def steps_of_way(robot: Robot, begin: Floats, end: Floats) -> int:
    """In how many steps a straight way from readings (N,) to others is looked at, one at the least."""
    step = np.where(robot.revolute, STEP_RAD, STEP_M)
    return max(1, int(np.ceil(np.abs((end - begin) / step).max())))


@dataclass(frozen=True, eq=False)
class JointWays:
    """What rules allow on the ways of an arm.

    Attributes:
        robot: The nominal arm.
        rules: Of these only such count as hold on ways, see truearm.planning.accessibility.
        tools: Transforms (4, 4) from flange to what is measured, with each of which the rules hold.
    """

    robot: Robot
    rules: Sequence[Rule]
    tools: Sequence[Floats]

    @cached_property
    def rules_on_ways(self) -> list[Rule]:
        """Those of the rules that hold on ways."""
        return [rule for rule in self.rules if getattr(rule, "holds_on_ways", False)]

    def clear(self, stops: Floats) -> bool:
        """Whether the way through stops (s, N) keeps to the rules."""
        if not self.rules_on_ways:
            return True
        readings = stepped(self.robot, stops)
        looks = readings[::FIRST_LOOK], readings
        return all(self._kept_at(look).all() for look in looks)

    def seem_clear(self, begins: Floats, end: Floats) -> Mask:
        """Which ways from begins (n, N) to an end (N,) keep to the rules, (n,), looked at in wide steps."""
        count = -(-max(steps_of_way(self.robot, begin, end) for begin in begins) // FIRST_LOOK)
        shares = np.linspace(0.0, 1.0, count + 1)[:, None, None]
        places = begins + shares * (end - begins)
        return np.asarray(self._kept_at(places.reshape(-1, len(end))).reshape(count + 1, -1).all(axis=0))

    def _kept_at(self, readings: Floats) -> Mask:
        """Which readings (n, N) keep to the rules on ways with each of the tools, (n,)."""
        kept = np.ones(len(readings), dtype=np.bool_)
        for tool in self.tools:
            places = Places(self.robot, readings, tool)
            for rule in self.rules_on_ways:
                kept &= answer_of(rule, places)
        return kept

    def lowest_m(self, stops: Floats) -> float:
        """The lowest place of arm and tools on the way through stops (s, N), in the base frame, m."""
        return min(lowest(self.robot, stepped(self.robot, stops), tool=tool) for tool in self.tools)
