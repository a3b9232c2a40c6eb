"""Readings that differ by whole turns, and how exactly a reading is known."""

from typing import Final

import numpy as np

from truearm.description.robot_data import RobotData
from truearm.types import Floats, Integers, Mask
from truearm.units import FULL_TURN

EDGE_RAD: Final = np.deg2rad(0.01)
"""Readings are shown and written rounded: so near to an edge, a joint may be on the other side of it."""


def with_turns(branches: Floats, robot: RobotData) -> tuple[Integers, Floats]:
    """Readings of branches (n, K, N) with every full turn that the limits of the joints allow.

    Joints without limits may be a turn away from the principal range, not more.

    Returns:
        For each of m readings, in order, the row of `branches` it belongs to, (m,), and the readings, (m, N).
    """
    limits = _limits(robot) + np.array([-EDGE_RAD, EDGE_RAD])
    rows, which = np.nonzero(np.isfinite(branches).all(axis=2))
    found = branches[rows, which]
    for joint in np.flatnonzero(_turning(robot)).tolist():
        if len(found) > 0:
            rows, found = _turned(rows, found, joint, limits[joint])
    order = np.argsort(rows, kind="stable")
    return rows[order], found[order]


def turned_away(q: Floats, robot: RobotData) -> Floats:
    """Readings (n, N) with each joint a full turn farther, one way or the other, whose limits allow that.

    Joints without limits may be turned as in :func:`with_turns`.
    """
    low, high = _limits(robot).T
    turn = np.where(_turning(robot), FULL_TURN, 0.0)
    return np.where(q - turn >= low - EDGE_RAD, q - turn, np.where(q + turn <= high + EDGE_RAD, q + turn, q))


class NearestTurns:
    """Readings of branches at the turns nearest to others."""

    def __init__(self, robot: RobotData) -> None:
        low, high = _limits(robot).T
        self._turn = np.where(_turning(robot), FULL_TURN, 0.0)
        self._per_turn = np.where(self._turn > 0.0, 1.0 / FULL_TURN, 0.0)
        self._low, self._high = low - EDGE_RAD, high + EDGE_RAD

    def __call__(self, branches: Floats, before: Floats) -> tuple[Integers, Floats]:
        """Each joint of branches (b, N) at the allowed turn nearest to `before` (N,).

        Returns:
            Numbers (k,) of the branches that the limits allow, and their readings (k, N).
        """
        turned = branches + self._turn * np.rint((before - branches) * self._per_turn)
        below, above = turned < self._low, turned > self._high
        if below.any() or above.any():
            for _ in range(2):
                turned += self._turn * (turned < self._low)
                turned -= self._turn * (turned > self._high)
            (which,) = np.nonzero(((turned >= self._low) & (turned <= self._high)).all(axis=1))
            return which, turned[which]
        return np.arange(len(branches)), turned


def _turning(robot: RobotData) -> Mask:
    """Joints (N,) of which a full turn more is the same pose: all that is coupled to them turns fully too."""
    same = np.where(robot.revolute[:, None], robot.coupling % 1.0 == 0.0, robot.coupling == 0.0)
    return np.asarray(same.all(axis=0))


def _turned(rows: Integers, q: Floats, joint: int, limits: Floats) -> tuple[Integers, Floats]:
    """Readings with every turn of one joint within its limits."""
    first = np.ceil((limits[0] - q[:, joint]) / FULL_TURN).astype(np.int64)
    last = np.floor((limits[1] - q[:, joint]) / FULL_TURN).astype(np.int64)
    counts = np.maximum(last - first + 1, 0)
    owners = np.repeat(np.arange(len(q)), counts)
    turns = first[owners] + np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)
    turned = q[owners]
    turned[:, joint] += turns * FULL_TURN
    return rows[owners], turned


def _limits(robot: RobotData) -> Floats:
    limits = np.array(robot.limits, dtype=np.float64)
    open_ended = ~np.isfinite(limits)
    limits[open_ended] = np.broadcast_to([-FULL_TURN, FULL_TURN], limits.shape)[open_ended]
    return limits
