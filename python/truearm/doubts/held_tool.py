"""Tools that were held one way in all poses, so that nothing is known of how they are elsewhere."""

from typing import Final, NamedTuple

import numpy as np

from truearm.description.one_turn import one_turn
from truearm.robot import Robot
from truearm.types import Floats
from truearm.units import RADIANS_PER_DEGREE

HELD_RAD: Final = 2.0 * RADIANS_PER_DEGREE
"""A direction that turns by less, root mean square, points one way."""
DRAWN: Final = 200
"""Poses that tell how the arm could hold its tool."""
TURN_MORE: Final = (
    "Work whose tool is held so needs no others. For other work measure 20 to 30 poses with the wrist turned "
    "by 30 deg and more"
)
"""The way out."""


class HeldTool(NamedTuple):
    """How the tool was held in all poses.

    Attributes:
        entirely: Whether it was not turned at all, or about one direction of the flange.
        direction: Unit vector (3,) in the flange about which it was turned, if it was.
        spread_rad: How far that direction, or the tool, was turned, root mean square.
    """

    entirely: bool
    direction: Floats
    spread_rad: float


def held_tool(robot: Robot, readings: Floats) -> HeldTool | None:
    """How the tool was held in all poses; None if it was turned as the arm can turn it.

    Args:
        robot: The nominal arm.
        readings: Joint readings (n, N), rad or m.
    """
    spreads, directions = _spreads(robot, readings)
    possible, _ = _spreads(robot, _drawn(robot))
    held = int(np.count_nonzero(spreads < HELD_RAD))
    if held <= np.count_nonzero(possible < HELD_RAD):
        return None
    entirely = held == len(spreads)
    return HeldTool(entirely, directions[:, 0], float(spreads[-1 if entirely else 0]))


def never_turns_freely(robot: Robot) -> bool:
    """Whether an arm holds a direction of its flange wherever it goes, as a SCARA does."""
    return bool(_spreads(robot, _drawn(robot))[0][0] < HELD_RAD)


def held_words(held: HeldTool) -> str:
    """How the tool was held, in words that end a sentence's subject."""
    within = f"to within {max(0.01, held.spread_rad / RADIANS_PER_DEGREE):.2g} deg"
    if held.entirely:
        return f"the tool held one way, {within}"
    x, y, z = (part + 0.0 for part in np.round(held.direction, 2).tolist())
    return f"the tool turned about one direction of the flange alone, ({x:g}, {y:g}, {z:g}), {within}"


def _spreads(robot: Robot, readings: Floats) -> tuple[Floats, Floats]:
    """How far directions of the flange turn, root mean square, ascending (3,), and the directions (3, 3)."""
    turns = robot.flange_chain.pose(robot.joints_from_readings(readings))[:, :3, :3]
    off = turns - turns.mean(axis=0)
    squares, directions = np.linalg.eigh(np.einsum("nij,nik->jk", off, off) / len(turns))
    signs = np.sign(directions[np.abs(directions).argmax(axis=0), np.arange(3)])
    return np.sqrt(np.maximum(squares, 0.0)), directions * signs


def _drawn(robot: Robot) -> Floats:
    """Readings (DRAWN, N) within the limits, a turn at the most."""
    low, high = one_turn(robot)
    return np.random.default_rng(0).uniform(low, high, (DRAWN, robot.joint_count))
