"""FANUC's CONFIG 'N U T, 0, 0, 0': wrist, arm, front or back, and three turn numbers.

N: J5 < 0, on the side where the tool points down with J4 at zero; F: J5 > 0. U and D: on which side of the
line through the axes of J2 and J3 the wrist centre is, U where it is with J2 and J3 at zero. T: the wrist
centre is in front of the axis of J1; B: behind it. A turn number is 0 within half a turn, 1 from 180 to
539 deg, -1 from -180 to -539 deg. Of which joints is written differently: of J1, J4 and J6, or of J4, J5 and
J6 (KAREL Reference Manual, CONFIG). What a program and the limits of the arm rule out is not meant; where
both are left, only what is the same in both can be said.

J3 has no turn number. Read against the horizontal it may go through more than a turn, but the forearm cannot
pass the upper arm: of readings a turn apart, that within half a turn of the stretched arm is meant.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Final

import numpy as np

from truearm.programs.branches import Branches
from truearm.programs.configuration import ANY
from truearm.programs.layouts import EulerPose
from truearm.programs.turning import ON_THE_EDGE, turns
from truearm.robot import Robot
from truearm.types import Floats, Integers
from truearm.units import FULL_TURN

LETTERS: Final = ("NF", "UD", "TB")
ORDERS: Final = ((0, 3, 5), (3, 4, 5))
TURNING: Final = (0, 3, 4, 5)
ELBOW: Final = len(LETTERS) + len(TURNING)
MOST_TURNS: Final = 99
SAME_M, SAME_RAD = 1e-3, 1e-3
COLUMNS: Final = len(LETTERS) + 3
FIRST_LETTER: Final = 6


@dataclass(frozen=True)
class ConfiguredPose(EulerPose):
    """X Y Z W P R, three letters and three turn numbers."""

    words: ClassVar[Mapping[int, tuple[str, ...]]] = MappingProxyType(
        {FIRST_LETTER + place: tuple(letters) for place, letters in enumerate(LETTERS)}
    )
    columns: tuple[int, int, int] = (2, 1, 0)
    configuration: int = COLUMNS


@dataclass(frozen=True, eq=False)
class FanucConfiguration:
    """Eight digits: three letters, the turn numbers of J1, J4, J5 and J6, and whole turns of the elbow.

    Attributes:
        branches: Postures of the arm.
        orders: Joints that the three turn numbers may be of.
    """

    branches: Branches
    orders: tuple[tuple[int, int, int], ...]

    def digits(self, q: Floats) -> Integers:
        """As in Configuration."""
        up = self.branches.elbow(np.zeros((1, q.shape[1])))[0]
        letters = [
            self.branches.wrist(q) > 0.0,
            self.branches.elbow(q) * np.sign(up) < 0.0,
            self.branches.reach(q) < 0.0,
        ]
        turned = turns(q[:, TURNING]), turns(self.branches.bent(q))
        found: Integers = np.column_stack([*letters, *turned]).astype(np.int64)
        return found

    def digits_of_text(self, values: Floats) -> Integers:
        """As in Configuration; a joint without a turn number has none."""
        found = np.zeros((len(values), ELBOW + 1), dtype=np.int64)
        written = np.nan_to_num(values, nan=ANY + 1).astype(np.int64)
        found[:, : len(LETTERS)] = written[:, : len(LETTERS)]
        numbers = written[:, len(LETTERS) :]
        chosen = [self._spread(numbers, order) for order in self.orders]
        turned = chosen[0]
        for other in chosen[1:]:
            turned = np.where((turned == other).all(axis=1)[:, None], turned, ANY + 1)
        found[:, len(LETTERS) : ELBOW] = turned
        return found

    def text_of_digits(self, digits: Integers, values: Floats) -> Floats:
        """As in Configuration; NaN where the order of the turn numbers matters and is not known."""
        text = np.array(values)
        text[:, : len(LETTERS)] = digits[:, : len(LETTERS)]
        written = [self._gathered(digits[:, len(LETTERS) : ELBOW], order) for order in self.orders]
        alike = np.all([one == written[0] for one in written], axis=0).all(axis=1) & (digits[:, ELBOW] == 0)
        text[:, len(LETTERS) :] = np.where(alike[:, None], written[0], np.nan)
        return text

    @staticmethod
    def _spread(numbers: Integers, order: Sequence[int]) -> Integers:
        """Turns of J1, J4, J5 and J6 that three numbers say in an order."""
        found = np.zeros((len(numbers), len(TURNING)), dtype=np.int64)
        found[:, [TURNING.index(joint) for joint in order]] = numbers
        return found

    @staticmethod
    def _gathered(turned: Integers, order: Sequence[int]) -> Floats:
        """The three numbers that say the turns in an order; NaN where they cannot."""
        columns = [TURNING.index(joint) for joint in order]
        left = [column for column in range(len(TURNING)) if column not in columns]
        found: Floats = turned[:, columns].astype(np.float64)
        found[(turned[:, left] != 0).any(axis=1) | (found == ON_THE_EDGE).any(axis=1)] = np.nan
        return found


def turn_orders(
    stated: Integers, flange: Floats, taught: Floats, robot: Robot
) -> tuple[tuple[int, int, int], ...]:
    """The orders of turn numbers that a program and its arm leave possible.

    Args:
        stated: Turn numbers (n, 3) of Cartesian positions.
        flange: base_from_flange (n, 4, 4) of these; NaN where it is not known.
        taught: Readings (k, N) of joint positions, in rad.
        robot: The arm, for its limits and its nominal kinematics.
    """
    reach = np.abs(robot.limits).max(axis=1)
    most = np.where(
        np.isfinite(reach), np.round(np.where(np.isfinite(reach), reach, 0.0) / FULL_TURN), MOST_TURNS
    )
    left = []
    pairs = _pairs(flange, taught, robot)
    for order in ORDERS:
        within = (np.abs(stated) <= most[list(order)]).all() if len(stated) else True
        agrees = all(_agree(turns(taught[k])[list(order)], stated[n]) for n, k in pairs)
        if within and agrees:
            left.append(order)
    return tuple(left) or ORDERS


def _pairs(flange: Floats, taught: Floats, robot: Robot) -> list[tuple[int, int]]:
    """Cartesian and joint positions that are the same place."""
    if len(flange) == 0 or len(taught) == 0:
        return []
    poses = robot.flange_chain.pose(np.ascontiguousarray(robot.joints_from_readings(taught)))
    found = []
    for k, pose in enumerate(poses):
        apart = np.linalg.norm(flange[:, :3, 3] - pose[:3, 3], axis=1)
        turned = np.abs(flange[:, :3, :3] - pose[:3, :3]).max(axis=(1, 2))
        found += [(int(n), k) for n in np.flatnonzero((apart < SAME_M) & (turned < SAME_RAD))]
    return found


def _agree(found: Integers, stated: Integers) -> bool:
    """Whether turn numbers are the same where they are certain."""
    return bool(((found == stated) | (found == ON_THE_EDGE)).all())
