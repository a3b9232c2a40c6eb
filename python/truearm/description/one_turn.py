"""Readings that poses are drawn from: within a robot's limits, one turn of each joint at the most."""

from typing import Final

import numpy as np

from truearm.description.robot_data import RobotData
from truearm.types import Floats
from truearm.units import FULL_TURN

OPEN_WAY_M: Final = 1.0
"""Of a joint that slides without limits."""


def one_turn(robot: RobotData) -> tuple[Floats, Floats]:
    """Lowest and highest readings (N,) to draw from.

    A joint that may turn further, or slides without end, gets the part of its limits with the middle nearest
    to zero: readings a turn apart are taken to err alike, and a joint may have its zero anywhere.
    """
    low, high = robot.limits.T
    slid = np.where(np.isfinite(robot.limits).all(axis=1), np.inf, OPEN_WAY_M)
    widest = np.where(robot.revolute, FULL_TURN, slid)
    part = np.where(np.isfinite(widest), widest, 0.0)
    begun = np.minimum(np.maximum(-0.5 * part, low), high - part)
    wide = high - low > widest
    return np.where(wide, begun, low), np.where(wide, begun + part, high)
