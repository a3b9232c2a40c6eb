"""Nominal inverse kinematics of a point: three joints reach it, the others are held."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from truearm.errors import UsageError, list_rows
from truearm.planning.configurations import Configuration
from truearm.robot import Robot
from truearm.types import Floats, Mask
from truearm.units import FULL_TURN

STARTS: Final = 20_000
STARTS_TRIED: Final = 3
STEPS: Final = 12
LARGEST_STEP: Final = 0.3
REACHED_M: Final = 1e-9


@dataclass(frozen=True, eq=False)
class PositionInverse:
    """Readings whose tool point is where it is asked for, within limits and in one configuration.

    Newton's method from the nearest of many known poses, so that the branch of a point does not change from
    one call to the next. A point that is not reached is said to be so; nothing is returned in its stead.

    Attributes:
        robot: The nominal arm.
        held: Readings (N,) of the joints that do not take part.
        joints: The three that do, from 1.
        configuration: The branch.
    """

    robot: Robot
    held: Floats
    joints: Sequence[int] = (1, 2, 3)
    configuration: Configuration = field(default_factory=Configuration)

    def readings(self, points: Floats) -> tuple[Floats, Mask]:
        """Readings (n, N) of tool points (n, 3) in the base frame, m, and which were reached, (n,).

        Readings of points that were not reached are NaN.

        Raises:
            UsageError: If the joints that are held keep the arm out of the configuration.
        """
        found = np.full((len(points), self.robot.joint_count), np.nan)
        left = np.arange(len(points))
        for choice in range(min(STARTS_TRIED, len(self._starts))):
            if len(left) == 0:
                break
            near = np.asarray(self._tree.query(points[left], k=[choice + 1])[1])
            solved, reached = self._newton(points[left], self._starts[near[:, 0]])
            found[left[reached]] = solved[reached]
            left = left[~reached]
        return found, np.isfinite(found).all(axis=1)

    def _newton(self, points: Floats, start: Floats) -> tuple[Floats, Mask]:
        moving, readings = self._columns, start.copy()
        for _ in range(STEPS):
            miss = points - self.robot.position(readings)
            jacobian = self.robot.joint_jacobian(readings)[:, :, moving]
            step = _least_squares_step(jacobian, miss)
            size = np.abs(step).max(axis=1, keepdims=True)
            readings[:, moving] += step * np.minimum(1.0, LARGEST_STEP / np.maximum(size, LARGEST_STEP))
        readings = self._within_turn(readings)
        near = np.linalg.norm(points - self.robot.position(readings), axis=1) < REACHED_M
        low, high = self.robot.limits.T
        allowed = ((readings >= low) & (readings <= high)).all(axis=1)
        return readings, near & allowed & self.configuration.holds(self.robot, readings)

    def _within_turn(self, readings: Floats) -> Floats:
        """Turning joints without limits as readings of half a turn to either side."""
        free = [
            column
            for column in self._columns
            if self.robot.joints[column] == "revolute" and not np.isfinite(self.robot.limits[column]).any()
        ]
        readings[:, free] = (readings[:, free] + np.pi) % FULL_TURN - np.pi
        return readings

    @property
    def _columns(self) -> list[int]:
        return [joint - 1 for joint in self.joints]

    @cached_property
    def _starts(self) -> Floats:
        low, high = self.robot.finite_limits()
        readings = np.tile(np.asarray(self.held, dtype=np.float64), (STARTS, 1))
        drawn = np.random.default_rng(0).uniform(low, high, readings.shape)
        readings[:, self._columns] = drawn[:, self._columns]
        found = readings[self.configuration.holds(self.robot, readings)]
        if len(found) == 0:
            branch = ", ".join(f"{part} {word}" for part, word in asdict(self.configuration).items() if word)
            raise UsageError(
                f"no readings of {list_rows(list(self.joints), 'joint')} have {branch}",
                where="configuration",
                rule=f"The other joints are held where held = {np.asarray(self.held).tolist()} has them",
                way_out="Hold them elsewhere, or ask for another configuration",
            )
        return found

    @cached_property
    def _tree(self) -> "cKDTree[None]":
        return cKDTree(self.robot.position(self._starts))


def _least_squares_step(jacobian: Floats, miss: Floats) -> Floats:
    """Damped Newton steps (n, 3) of jacobian (n, 3, 3); the damping fades as the point is neared."""
    normal = jacobian.transpose(0, 2, 1) @ jacobian
    scale = np.einsum("nii->n", normal) / 3.0
    damping = scale * np.minimum(np.linalg.norm(miss, axis=1), 1e-2)
    normal[:, [0, 1, 2], [0, 1, 2]] += (damping + 1e-15)[:, None]
    right = np.einsum("nij,ni->nj", jacobian, miss)
    return np.asarray(np.linalg.solve(normal, right[:, :, None])[:, :, 0])
