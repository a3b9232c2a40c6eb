"""Targets at turns of the joints that are not known, and whether their corrections depend on these."""

from collections.abc import Set
from typing import Final

import numpy as np

from truearm.programs.corrections import Compensator
from truearm.programs.environment import author_of
from truearm.programs.program import Program
from truearm.programs.solving import SAME_RAD
from truearm.programs.uses import Uses
from truearm.robot import Robot
from truearm.turns import turned_away
from truearm.types import Floats

TURNS_OPEN: Final = (
    "by how many full turns its joints are turned is not known, as lines or arcs over a place that is not "
    "known lead there, and its correction depends on that: go to joints before it"
)


def depending_on_turns(
    program: Program, uses: Uses, q: Floats, targets: Set[int], models: tuple[Robot, Compensator]
) -> dict[int, str]:
    """Why targets cannot be changed, by number: those that are corrected otherwise at other turns.

    All joints are turned at once: what depends on one of them differs, unless several undo one another.

    Args:
        program: The program.
        uses: How its targets are used.
        q: Readings of all targets (t, N).
        targets: Numbers of Cartesian targets, each known at one of the turns at which the arm may be there.
        models: The programming model, and what corrects its readings.
    """
    robot, compensator = models
    found: list[int] = []
    which = np.array(sorted(targets), dtype=np.int64)
    for number in np.unique(uses.environment[which]).tolist():
        here, environment = which[uses.environment[which] == number], program.environments[number]
        both = np.stack([q[here], turned_away(q[here], robot)])
        done = compensator.joints(
            both.reshape(-1, q.shape[1]),
            tool=environment.tool.true,
            author=author_of(robot, environment.tool, environment.displacement),
        )
        own, other = done.q.reshape(both.shape) - both
        refused = done.refused.reshape(2, -1)
        differs = (np.abs(other - own).max(axis=1) > SAME_RAD) | (refused[0] != refused[1])
        found += here[differs].tolist()
    return dict.fromkeys(found, TURNS_OPEN)
