"""Spaces that are divided and that poses are drawn from: of joints, or of positions at one configuration."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, Protocol

import numpy as np
from numpy.typing import ArrayLike

from truearm.arrays import HoldsReadOnly, as_numbers, read_only
from truearm.errors import UsageError
from truearm.fits.scheme_options import MAJOR_JOINTS
from truearm.kinds import required, whole_numbers
from truearm.planning.configurations import Configuration
from truearm.planning.positioning import PositionInverse
from truearm.robot import Robot
from truearm.types import Floats, Mask

SAME: Final = 1e-9
"""Readings that differ by less are equal, rad or m."""


class Space(Protocol):
    """A box (low to high) of D coordinates, each of which means a pose of the arm."""

    @property
    def robot(self) -> Robot:
        """The nominal arm."""

    @property
    def low(self) -> Floats:
        """Lowest coordinates (D,), rad and m."""

    @property
    def high(self) -> Floats:
        """Highest coordinates (D,)."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates."""

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each: rad or m."""

    def readings(self, coordinates: Floats) -> tuple[Floats, Mask]:
        """Readings (n, N) of coordinates (n, D), NaN where the arm cannot get there, and whether it can."""

    def coordinates(self, readings: Floats) -> Floats:
        """Coordinates (n, D) of readings (n, N)."""


@dataclass(frozen=True, eq=False)
class JointSpace(HoldsReadOnly):
    """Readings of some joints; the others are held.

    Attributes:
        robot: The nominal arm.
        low: Lowest readings (D,) of the joints; their limits by default.
        high: Highest ones.
        joints: Which, from 1: by default 1, 2 and 3, as the paper divides its space. To calibrate all joints
            they all have to move, as with range(1, 7).
        held: Readings (N,) of the others; zero by default.
    """

    robot: Robot
    low: Floats = field(default_factory=lambda: np.empty(0))
    high: Floats = field(default_factory=lambda: np.empty(0))
    joints: Sequence[int] = MAJOR_JOINTS
    held: Floats | None = None

    def __post_init__(self) -> None:
        _check_joints(self)
        limits = self.robot.limits[self._columns]
        for name, limit in (("low", limits[:, 0]), ("high", limits[:, 1])):
            given = np.asarray(getattr(self, name), dtype=np.float64)
            object.__setattr__(self, name, read_only(limit if given.size == 0 else given))
        _check_box(self)
        self._check_limits(limits)

    def _check_limits(self, limits: Floats) -> None:
        """Raise UsageError where the box leaves the limits (D, 2) of the joints."""
        beyond = (self.low < limits[:, 0] - SAME) | (self.high > limits[:, 1] + SAME)
        for k in np.flatnonzero(beyond):
            low, high = limits[k]
            unit = self.units[k]
            raise UsageError(
                f"the space has {self.names[k]} from {self.low[k]:g} to {self.high[k]:g} {unit}",
                rule=f"The limits of the joint are {low:g} to {high:g} {unit}",
                way_out="Give low and high within them, or correct the limits of the robot",
            )

    @property
    def names(self) -> tuple[str, ...]:
        """q1, q2 and so on."""
        return tuple(f"q{joint}" for joint in self.joints)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint."""
        return tuple("rad" if self.robot.joints[column] == "revolute" else "m" for column in self._columns)

    def readings(self, coordinates: Floats) -> tuple[Floats, Mask]:
        """Every coordinate is a pose."""
        held = np.zeros(self.robot.joint_count) if self.held is None else self.held
        found = np.tile(held, (len(coordinates), 1))
        found[:, self._columns] = coordinates
        return found, np.ones(len(found), dtype=np.bool_)

    def coordinates(self, readings: Floats) -> Floats:
        """The readings of the joints."""
        return np.ascontiguousarray(readings[:, self._columns])

    @property
    def _columns(self) -> list[int]:
        return [joint - 1 for joint in self.joints]


@dataclass(frozen=True, eq=False)
class CartesianSpace(HoldsReadOnly):
    """Positions of the tool point, reached by three joints in one configuration; the others are held.

    Attributes:
        robot: The nominal arm.
        low: Lowest x, y, z from `origin` in the base frame, m.
        high: Highest.
        origin: In the base frame (3,), m.
        configuration: The branch; CEPs differ between branches, section 4.2 of the paper.
        joints: The three that reach, from 1; 1, 2 and 3 by default.
        held: Readings (N,) of the others; zero by default.
    """

    robot: Robot
    low: Floats
    high: Floats
    origin: ArrayLike = (0.0, 0.0, 0.0)
    configuration: Configuration = field(default_factory=Configuration)
    joints: Sequence[int] = MAJOR_JOINTS
    held: Floats | None = None

    def __post_init__(self) -> None:
        _check_joints(self)
        if len(self.joints) != len(self.names):
            raise UsageError(f"joints {list(self.joints)}", rule="Three joints reach a position")
        for name in ("low", "high", "origin"):
            object.__setattr__(self, name, read_only(np.asarray(getattr(self, name), dtype=np.float64)))
        _check_box(self)

    @property
    def names(self) -> tuple[str, ...]:
        """x, y, z."""
        return ("x", "y", "z")

    @property
    def units(self) -> tuple[str, ...]:
        """Metres."""
        return ("m", "m", "m")

    def readings(self, coordinates: Floats) -> tuple[Floats, Mask]:
        """Readings by nominal inverse kinematics."""
        return self._inverse.readings(self.points(coordinates))

    def points(self, coordinates: Floats) -> Floats:
        """Points (n, 3) of coordinates (n, 3) in the base frame, m."""
        return np.asarray(self.origin) + self._offset(coordinates)

    def coordinates(self, readings: Floats) -> Floats:
        """Where the nominal tool point is."""
        return self._coordinates_of(self.robot.position(readings) - np.asarray(self.origin))

    def _offset(self, coordinates: Floats) -> Floats:
        return coordinates

    def _coordinates_of(self, offset: Floats) -> Floats:
        return offset

    @cached_property
    def _inverse(self) -> PositionInverse:
        held = np.zeros(self.robot.joint_count) if self.held is None else self.held
        return PositionInverse(self.robot, held, self.joints, self.configuration)


@dataclass(frozen=True, eq=False)
class SphericalSpace(CartesianSpace):
    """Positions by radius, azimuth and elevation from `origin`, as in Figure 4(c) of the paper.

    x = R cos(phi) sin(theta), y = R cos(phi) cos(theta), z = R sin(phi): theta turns from the y axis to the x
    axis, phi rises from the plane. `low` and `high` are (R, theta, phi) in m and rad. Joints 1, 2 and 3 reach
    by default, and the others are held at zero, as in `CartesianSpace`.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """R, theta, phi."""
        return ("R", "theta", "phi")

    @property
    def units(self) -> tuple[str, ...]:
        """A length and two angles."""
        return ("m", "rad", "rad")

    def _offset(self, coordinates: Floats) -> Floats:
        radius, theta, phi = coordinates.T
        level = radius * np.cos(phi)
        return np.column_stack([level * np.sin(theta), level * np.cos(theta), radius * np.sin(phi)])

    def _coordinates_of(self, offset: Floats) -> Floats:
        x, y, z = offset.T
        level = np.hypot(x, y)
        return np.column_stack([np.hypot(level, z), np.arctan2(x, y), np.arctan2(z, level)])


def _check_joints(space: JointSpace | CartesianSpace) -> None:
    """Check the robot, its joints that move and the readings of the others, and settle these."""
    robot = required(space.robot, Robot, "the robot")
    joints, count = whole_numbers(space.joints, "joints"), robot.joint_count
    object.__setattr__(space, "joints", joints)
    if any(not 1 <= joint <= count for joint in joints):
        raise UsageError(f"joints {list(joints)}", rule=f"It has 1 to {count}")
    if not joints or len(set(joints)) < len(joints):
        raise UsageError(f"joints {list(joints)}", rule="One joint or more, each once")
    if space.held is None:
        return
    held = as_numbers(space.held, what="held readings")
    if held.shape != (count,) or not np.isfinite(held).all():
        raise UsageError(
            f"{held.tolist()}", where="held", rule=f"A finite reading of each of the {count} joints"
        )
    object.__setattr__(space, "held", read_only(held))


def _check_box(space: Space) -> None:
    low, high = space.low, space.high
    if low.shape != (len(space.names),) or high.shape != low.shape:
        shapes = f"low {low.shape}, high {high.shape}"
        raise UsageError(shapes, rule=f"Each has a number for {', '.join(space.names)}")
    if not (np.isfinite(low).all() and np.isfinite(high).all() and (low < high).all()):
        raise UsageError(
            f"the space reaches from {low.tolist()} to {high.tolist()}",
            rule="Each low must be below its high, and both finite",
            way_out="Give low and high where the robot file has no limits",
        )
