"""Configuration data: integers beside a pose that tell the controller which branch and turns are meant.

A language says how digits follow from readings; telling them of a branch and finding the branch that a
target means are the same function, so that what is written is what is read.
"""

from itertools import product
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from truearm.robot_data import RobotData

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

ANY: Final = -(2**31)
EDGE_RAD: Final = np.deg2rad(0.01)
FULL_TURN: Final = 2.0 * np.pi
MAX_TURNED: Final = 512


class Configuration(Protocol):
    """How a language writes branch and turns.

    A digit is the smallest thing that changes alone: a bit of KUKA's Turn, one of ABB's cf numbers. Each
    digit must depend on the readings alone (and on the arm's fixed geometry).
    """

    def digits(self, q: Floats) -> Integers:
        """Digits (n, D) of readings (n, N), rad and m."""
        ...

    def digits_of_text(self, values: Floats) -> Integers:
        """Digits (n, D) of the numbers (n, C) in the text; ANY where the text leaves a digit open."""
        ...

    def text_of_digits(self, digits: Integers, values: Floats) -> Floats:
        """Numbers (n, C) to write for `digits`; `values` are those of the text, what means else is kept."""
        ...


def meant(configuration: Configuration, values: Floats, candidates: Floats) -> NDArray[np.bool_]:
    """Which of the readings (k, N) the numbers (C,) of one target mean, (k,).

    The position in a text is rounded, so a joint within EDGE_RAD of a digit's edge agrees with the digits
    on both sides of it.
    """
    wanted = configuration.digits_of_text(values[None])
    agrees = np.zeros((len(candidates), wanted.shape[1]), dtype=bool)
    for shift in (0.0, EDGE_RAD, -EDGE_RAD):
        agrees |= configuration.digits(candidates + shift) == wanted
    found: NDArray[np.bool_] = (agrees | (wanted == ANY)).all(axis=1)
    return found


def with_turns(branches: Floats, robot: RobotData) -> Floats:
    """Readings (k, N) of branches (b, N) with every full turn that the limits of the joints allow.

    Joints without limits may be a turn away from the principal range, not more.
    """
    found = [turned for branch in branches for turned in _turned(branch, robot)]
    return np.array(found).reshape(-1, robot.joint_count)


def nearest_turns(branches: Floats, robot: RobotData, before: Floats) -> Floats:
    """Readings (k, N) of branches (b, N), each joint at the allowed turn nearest to `before`."""
    limits = _limits(robot)
    turning = np.array([joint == "revolute" for joint in robot.joints])
    turned = np.where(turning, branches + FULL_TURN * np.round((before - branches) / FULL_TURN), branches)
    for _ in range(2):
        turned = np.where(turning & (turned < limits[:, 0] - EDGE_RAD), turned + FULL_TURN, turned)
        turned = np.where(turning & (turned > limits[:, 1] + EDGE_RAD), turned - FULL_TURN, turned)
    inside = ((turned >= limits[:, 0] - EDGE_RAD) & (turned <= limits[:, 1] + EDGE_RAD)).all(axis=1)
    found: Floats = turned[inside]
    return found


def _turned(branch: Floats, robot: RobotData) -> list[tuple[float, ...]]:
    choices = []
    for value, joint, (low, high) in zip(branch, robot.joints, _limits(robot), strict=True):
        if joint != "revolute":
            choices.append([float(value)])
            continue
        first = int(np.ceil((low - EDGE_RAD - value) / FULL_TURN))
        last = int(np.floor((high + EDGE_RAD - value) / FULL_TURN))
        choices.append([float(value + turn * FULL_TURN) for turn in range(first, last + 1)])
    if np.prod([float(len(choice)) for choice in choices]) > MAX_TURNED:
        return []
    return list(product(*choices))


def _limits(robot: RobotData) -> Floats:
    limits = np.array(robot.limits, dtype=np.float64)
    open_ended = ~np.isfinite(limits)
    limits[open_ended] = np.broadcast_to([-FULL_TURN, FULL_TURN], limits.shape)[open_ended]
    return limits
