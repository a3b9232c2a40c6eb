"""Which poses can be measured: rules that are combined, each a function of places to true or false."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar, Final

import numpy as np
from numpy.typing import ArrayLike

from truearm.arrays import HoldsReadOnly, as_numbers, as_rows, read_only
from truearm.description.joint_axes import axes_at_zero
from truearm.errors import InputError, UsageError, count_of
from truearm.fits.endpoints import at_tool
from truearm.kinds import check_number, check_values
from truearm.planning.configurations import link_frames
from truearm.robot import Robot
from truearm.types import Floats, Mask

LEAST_CONTACT_DEG: Final = 15.0
UPRIGHT_COSINE: Final = np.cos(np.deg2rad(1.0))
LEVEL: Final = np.sin(np.deg2rad(1.0))
"""Cosines to the vertical of axes that are taken for vertical and for level."""


@dataclass(frozen=True, eq=False)
class Places:
    """n poses of a nominal arm, and where its parts are then, in the base frame.

    Attributes:
        robot: The arm.
        readings: Joint readings (n, N).
        flange_from_tool: Transform (4, 4) of the tool.
    """

    robot: Robot
    readings: Floats
    flange_from_tool: Floats

    @cached_property
    def base_from_tool(self) -> Floats:
        """Poses of the tool (n, 4, 4)."""
        into_tool = np.linalg.inv(self.robot.tool) @ self.flange_from_tool
        return np.asarray(self.robot.pose(self.readings) @ into_tool)

    @property
    def point(self) -> Floats:
        """Tool points (n, 3), m."""
        return self.base_from_tool[:, :3, 3]

    @cached_property
    def corners(self) -> Floats:
        """Origins (n, N + 2, 3) of the base, of the frames of the links, and of the tool."""
        values = self.robot.joints_from_readings(self.readings)
        corners = [np.broadcast_to(self.robot.base[:3, 3], self.point.shape)]
        corners += [link_frames(self.robot, values, k + 1)[:, :3, 3] for k in range(self.robot.joint_count)]
        return np.stack([*corners, self.point], axis=1)

    @property
    def lowest(self) -> Floats:
        """Heights (n,) of the lowest place beyond the links that stand on the floor themselves, m."""
        return np.asarray(self.corners[:, standing_links(self.robot) :, 2].min(axis=1))


@lru_cache(maxsize=8)
def standing_links(robot: Robot) -> int:
    """Links from the base on that no joint lifts, the first one always among them.

    A column turns about the vertical, and the carriage under it slides along a level rail.
    """
    axes, _ = axes_at_zero(robot)
    count = 0
    for axis in axes:
        up = abs(float(axis.direction_in_base[2]))
        if not (up > UPRIGHT_COSINE if axis.kind == "revolute" else up < LEVEL):
            break
        count += 1
    return max(1, count)


Rule = Callable[[Places], Mask]
"""Of places to true or false. One whose attribute `holds_on_ways` is true holds on ways between poses too."""


def accessible(
    robot: Robot, readings: ArrayLike, rules: Iterable[Rule], *, tool: ArrayLike | None = None
) -> Mask:
    """Which of readings (n, N), or (N,) for one, every rule allows, (n,).

    Args:
        robot: The nominal arm.
        readings: Poses.
        rules: Any of this module's, or functions of Places.
        tool: Transform (4, 4) from flange to tool, or a point (3,); the robot's own by default.

    Raises:
        InputError: If readings or tool are not finite numbers of these shapes, or a rule answers with
            anything but booleans (n,).
    """
    poses, _ = as_rows(readings, robot.joint_count, what=f"joint readings of {robot.name}")
    flange_from_tool = at_tool(robot, tool)
    allowed = np.ones(len(poses), dtype=np.bool_)
    for rule in rules:
        rows = np.flatnonzero(allowed)
        allowed[rows] = answer_of(rule, Places(robot, poses[rows], flange_from_tool))
    return allowed


def answer_of(rule: Rule, places: Places) -> Mask:
    """What a rule says of n places, (n,).

    Raises:
        InputError: If it says anything but true or false of each: taken for such, a distance, NaN or ~1 would
            allow what they are to forbid.
    """
    answer, count = np.asarray(rule(places)), len(places.readings)
    if answer.shape == (count,) and (answer.dtype == np.bool_ or count == 0):
        return answer.astype(np.bool_)
    raise InputError(
        f"a rule of accessibility answered with {answer.dtype} of shape {answer.shape}",
        where=name_of(rule),
        rule=f"It must say true or false of each of {count_of(count, 'pose')}, as booleans ({count},)",
        way_out="Answer with a comparison, such as places.point[:, 2] > 0.1",
    )


def name_of(rule: Rule) -> str:
    """The name of a rule's function or class."""
    return str(getattr(rule, "__name__", type(rule).__name__))


@dataclass(frozen=True)
class JointLimits:
    """Readings stay within the robot's limits, and so far from them."""

    margin_rad: float = 0.0
    margin_m: float = 0.0

    def __call__(self, places: Places) -> Mask:
        """Of each pose."""
        margin = np.where(places.robot.revolute, self.margin_rad, self.margin_m)
        low, high = places.robot.limits.T
        inside = (places.readings >= low + margin) & (places.readings <= high - margin)
        return np.asarray(inside.all(axis=1))


@dataclass(frozen=True, eq=False)
class InBox(HoldsReadOnly):
    """The tool point lies in a box in the base frame, from `low` to `high` (3,), m."""

    low: ArrayLike
    high: ArrayLike

    def __post_init__(self) -> None:
        _hold_box(self)

    def __call__(self, places: Places) -> Mask:
        """Of each pose."""
        return np.asarray(
            ((places.point >= np.asarray(self.low)) & (places.point <= np.asarray(self.high))).all(axis=1)
        )


@dataclass(frozen=True, eq=False)
class InSphere(HoldsReadOnly):
    """The tool point is between `least_m` and `radius_m` away from `centre` (3,) in the base frame."""

    centre: ArrayLike
    radius_m: float
    least_m: float = 0.0

    def __post_init__(self) -> None:
        _hold_place(self, "centre")
        check_number(self.radius_m, "radius_m")
        check_number(self.least_m, "least_m")

    def __call__(self, places: Places) -> Mask:
        """Of each pose."""
        distance = np.linalg.norm(places.point - np.asarray(self.centre), axis=1)
        return np.asarray((distance <= self.radius_m) & (distance >= self.least_m))


@dataclass(frozen=True, eq=False)
class InCone(HoldsReadOnly):
    """A device at `apex` sees the tool point, within `half_angle_rad` of the `axis` that it looks along.

    Attributes:
        apex: Where the device stands in the base frame (3,), m.
        axis: Where it looks, in the base frame (3,).
        half_angle_rad: How far from it it sees.
        target_half_angle_rad: From how far beside its z axis the tool may be seen; from all sides by default.
    """

    apex: ArrayLike
    axis: ArrayLike
    half_angle_rad: float
    target_half_angle_rad: float = np.pi

    def __post_init__(self) -> None:
        _hold_place(self, "apex")
        _hold_direction(self, "axis")

    def __call__(self, places: Places) -> Mask:
        """Of each pose."""
        sight = places.point - np.asarray(self.apex)
        seen = _angle(sight, np.broadcast_to(np.asarray(self.axis, dtype=np.float64), sight.shape))
        facing = _angle(-sight, places.base_from_tool[:, :3, 2])
        return np.asarray((seen <= self.half_angle_rad) & (facing <= self.target_half_angle_rad))


@dataclass(frozen=True, eq=False)
class LeastContactAngle(HoldsReadOnly):
    """The pin meets the touch panel at no less than an angle, 15 deg in section 7 of the paper.

    Attributes:
        normal: Of the panel, in the base frame (3,).
        pin: Direction of the pin in the tool's frame (3,).
        least_deg: Least angle between the pin and the panel's plane.
    """

    normal: ArrayLike
    pin: ArrayLike = (1.0, 0.0, 0.0)
    least_deg: float = LEAST_CONTACT_DEG

    def __post_init__(self) -> None:
        _hold_direction(self, "normal")
        _hold_direction(self, "pin")

    def __call__(self, places: Places) -> Mask:
        """Of each pose."""
        pin = places.base_from_tool[:, :3, :3] @ np.asarray(self.pin, dtype=np.float64)
        from_normal = _angle(pin, np.broadcast_to(np.asarray(self.normal, dtype=np.float64), pin.shape))
        from_plane = np.pi / 2.0 - np.minimum(from_normal, np.pi - from_normal)
        return np.asarray(from_plane >= np.deg2rad(self.least_deg))


@dataclass(frozen=True, eq=False)
class KeepOut(HoldsReadOnly):
    """No part of the arm is in a box in the base frame, from `low` to `high` (3,), m.

    The arm is taken as straight lines between the frames of its links, from the base's to the tool: the box,
    `margin_m` wider on every side, meets none of them. On ways the arm is looked at in steps, of one degree
    where joints turn: the margin has to leave room for half of what the arm moves in one.
    """

    low: ArrayLike
    high: ArrayLike
    margin_m: float = 0.0

    holds_on_ways: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _hold_box(self)
        check_number(self.margin_m, "margin_m")
        check_values(self, not_negative=("margin_m",))

    def __call__(self, places: Places) -> Mask:
        """Of each pose."""
        begins, ends = places.corners[:, :-1], places.corners[:, 1:]
        low, high = np.asarray(self.low) - self.margin_m, np.asarray(self.high) + self.margin_m
        return np.asarray(~pieces_meet_box(begins, ends, low, high).any(axis=1))


def pieces_meet_box(begins: Floats, ends: Floats, low: Floats, high: Floats) -> Mask:
    """Which straight pieces from begins to ends (..., 3) share a point with the box from low to high (3,).

    Each pair of sides leaves a part of a piece between them: it meets the box where the three parts overlap
    (Kay and Kajiya, Ray Tracing Complex Scenes, 1986).
    """
    way = ends - begins
    moves = way != 0.0
    beside = ~moves & ~((begins >= low) & (begins <= high))
    with np.errstate(over="ignore"):
        to_low = np.divide(low - begins, way, out=np.full_like(way, -np.inf), where=moves)
        to_high = np.divide(high - begins, way, out=np.full_like(way, np.inf), where=moves)
    enters = np.minimum(to_low, to_high).max(axis=-1, initial=0.0)
    leaves = np.maximum(to_low, to_high).min(axis=-1, initial=1.0)
    return np.asarray((enters <= leaves) & ~beside.any(axis=-1))


@dataclass(frozen=True)
class AboveFloor:
    """No part of the arm beyond its first link, nor its tool, is lower than `height_m` in the base frame.

    The arm is taken as straight lines between the frames of its links: `height_m` has to leave room for half
    its thickness.
    """

    height_m: float

    holds_on_ways: ClassVar[bool] = True

    def __call__(self, places: Places) -> Mask:
        """Of each pose."""
        return np.asarray(places.lowest >= self.height_m)


def lowest(robot: Robot, readings: Floats, *, tool: Floats) -> float:
    """The lowest place of the arm beyond its first link and of its tool, in the base frame, m.

    Args:
        robot: The nominal arm.
        readings: Poses (n, N), one at the least.
        tool: Transform (4, 4) from flange to tool.
    """
    return float(Places(robot, readings, tool).lowest.min())


def either(*rules: Rule) -> Rule:
    """A rule that allows what any of `rules` allows, such as the sight of one device or another."""

    def any_of(places: Places) -> Mask:
        return np.asarray(np.logical_or.reduce([answer_of(rule, places) for rule in rules]))

    return any_of


def _hold_box(rule: InBox | KeepOut) -> None:
    """Make low and high the rule's own; raise UsageError unless they are the corners (3,) of a box."""
    least, most = (as_numbers(side, what="the sides of a box") for side in (rule.low, rule.high))
    if least.shape != (3,) or most.shape != (3,) or not (least <= most).all():
        raise UsageError(
            f"a box from {least.tolist()} to {most.tolist()}",
            rule="x, y and z in m, the lowest and then the highest",
        )
    _hold(rule, "low", least)
    _hold(rule, "high", most)


def _hold_place(rule: Rule, name: str) -> None:
    """Make a place the rule's own numbers; raise UsageError unless it is one (3,)."""
    place = as_numbers(getattr(rule, name), what=f"the numbers of {name}")
    if place.shape != (3,) or not np.isfinite(place).all():
        raise UsageError(
            f"{name} is {place.tolist()}", rule="A place has three finite numbers, x, y and z in m"
        )
    _hold(rule, name, place)


def _hold_direction(rule: Rule, name: str) -> None:
    """Make a direction the rule's own numbers; raise UsageError unless it is a vector (3,) that leads
    somewhere.
    """
    vector = as_numbers(getattr(rule, name), what=f"the numbers of {name}")
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise UsageError(
            f"{name} is {vector.tolist()}", rule="A direction has three finite numbers, not all of them zero"
        )
    _hold(rule, name, vector)


def _hold(rule: Rule, name: str, numbers: Floats) -> None:
    """Give a rule a read-only array that does not change with the one that was given."""
    object.__setattr__(rule, name, read_only(numbers))


def _angle(vectors: Floats, others: Floats) -> Floats:
    """Angles (n,) between vectors (n, 3), rad."""
    across = np.linalg.norm(np.cross(vectors, others), axis=1)
    return np.asarray(np.arctan2(across, np.einsum("ni,ni->n", vectors, others)))
