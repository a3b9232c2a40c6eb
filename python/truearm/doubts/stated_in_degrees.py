"""Readings that look like degrees read as radians, or are of joints that turn the other way."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import Final

import numpy as np

from truearm.doubts.nominal_misfit import Seen, relative_misfit
from truearm.doubts.turning_sense import FIT, MISFIT
from truearm.errors import InputError, Notice, list_rows
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.types import Floats, Mask
from truearm.units import RADIANS_PER_DEGREE

MAX_READING_RAD: Final = 4.0 * np.pi
"""Beyond two turns either way, and beyond its limits, a reading stated in no unit is taken for degrees."""
LIMIT_TOLERANCE: Final = 1e-6
AS_DEGREES: Final = "If these are degrees, give --angle-unit deg, or name the columns q1_deg, q2_deg, ..."
AS_RADIANS: Final = (
    "If these are radians, name the columns q1, q2, ..., and give no --angle-unit; if they were converted "
    "from degrees twice, convert them once"
)
MOST_OUTSIDE: Final = 0.5
"""Part of the rows outside the limits from which something is wrong with all of them."""
FEWEST_FAR: Final = 0.1
"""Part of the rows from which such readings are no slips of single rows."""
MOST_WAYS: Final = 2


def outside_limits(readings: Floats, limits: Floats) -> Mask:
    """Which readings (n, N) lie beyond limits (N, 2)."""
    below, above = readings < limits[:, 0] - LIMIT_TOLERANCE, readings > limits[:, 1] + LIMIT_TOLERANCE
    return np.asarray(below | above)


def check_degrees(measurements: Measurements, robot: Robot) -> None:
    """Check that readings stated in no unit are radians.

    Joints that are counted the other way, or exchanged, leave the limits too: where that explains all
    readings, and points deny that they are degrees, they stand, and `otherwise_notices` tells it.

    Raises:
        InputError: If they look like degrees.
    """
    unstated = robot.revolute & (np.array(measurements.joint_units) == "")
    readings = measurements.readings
    outside = outside_limits(readings, robot.limits) & unstated
    far = outside & (np.abs(readings) > MAX_READING_RAD)
    as_degrees = np.where(unstated, readings * RADIANS_PER_DEGREE, readings)
    fits = not (outside_limits(as_degrees, robot.limits) & unstated).any()
    if far.any(axis=1).mean() < FEWEST_FAR:
        far = np.zeros_like(far)
    if not far.any() and not (outside.any(axis=1).mean() > MOST_OUTSIDE and fits):
        return
    otherwise = "" if far.any() else _within_otherwise(readings, robot)
    if otherwise and _denied(replace(measurements, readings=as_degrees), robot):
        return
    found = far if far.any() else outside
    joint = int(np.where(found, np.abs(readings), 0.0).max(axis=0).argmax())
    largest = np.abs(readings[found[:, joint], joint]).max()
    low, high = robot.limits[joint]
    raise InputError(
        f"readings of joint {joint + 1} up to {largest:.4g} rad, whose limits are {low:.4g} to {high:.4g} "
        f"rad, in {measurements.row_names(found.any(axis=1))}, beyond what {robot.name} can reach",
        where=", ".join(measurements.files),
        rule="Revolute joints are in radians unless their columns say so (q1_deg)",
        way_out=AS_DEGREES
        + (f"; {otherwise}: if so, put that right in the robot file or in the data" if otherwise else "")
        + ("" if far.any() else "; if they are radians, they are of another arm: name that one"),
    )


def check_angles(measurements: Measurements, robot: Robot) -> None:
    """Check by the points that angles are in the unit they are read in, also where limits tell nothing.

    Raises:
        InputError: If the nominal arm, its frame and target fitted, is far from them with the readings as
            they are, and near with all of them divided, or multiplied, by the degrees of a radian.
    """
    revolute = robot.revolute
    unstated = revolute & (np.array(measurements.joint_units) == "")
    if not revolute.any() or _misfit(measurements, robot) <= MISFIT:
        return
    for joints, factor, looks, way_out in (
        (unstated, RADIANS_PER_DEGREE, "degrees that are read as radians", AS_DEGREES),
        (revolute, 1.0 / RADIANS_PER_DEGREE, "radians that were taken for degrees", AS_RADIANS),
    ):
        times = np.where(joints, factor, 1.0)
        if (
            joints.any()
            and _misfit(replace(measurements, readings=measurements.readings * times), robot) < FIT
        ):
            raise InputError(
                f"the joint readings look like {looks}: {factor:.4g} times as large they fit the points",
                where=", ".join(measurements.files),
                rule="Revolute joints are in radians unless their columns say so (q1_deg)",
                way_out=way_out,
            )


def otherwise_notices(measurements: Measurements, robot: Robot) -> list[Notice]:
    """A warning where most rows are outside the limits, and would be within if joints were otherwise."""
    if outside_limits(measurements.readings, robot.limits).any(axis=1).mean() <= MOST_OUTSIDE:
        return []
    otherwise = _within_otherwise(measurements.readings, robot)
    if not otherwise:
        return []
    message = (
        f"More than half of the rows are outside the limits of joints; {otherwise}. Jog these joints: which "
        "way they turn (direction in the robot file), and which column is whose, has to be as on the arm."
    )
    return [Notice("limits", message)]


def _within_otherwise(readings: Floats, robot: Robot) -> str:
    """In words, how joints would have to turn, or be exchanged, for all readings (n, N) to be within limits.

    Returns:
        The words; "" where that does not help.
    """
    beyond = np.flatnonzero(outside_limits(readings, robot.limits).any(axis=0))
    turned = readings.copy()
    turned[:, beyond] *= -1.0
    ways = []
    if not outside_limits(turned, robot.limits).any():
        ways.append(f"{list_rows(beyond + 1, 'joint')} the other way round")
    ways += [
        f"joints {first + 1} and {second + 1} exchanged" for first, second in _exchanges(readings, robot)
    ]
    named = " or ".join(f"with {way}" for way in ways[:MOST_WAYS])
    return f"{named} all readings are within the limits" if named else ""


def _exchanges(readings: Floats, robot: Robot) -> Iterator[tuple[int, int]]:
    """Pairs of joints of a kind whose readings are within the limits of one another, with all others."""
    beyond = np.asarray(outside_limits(readings, robot.limits).any(axis=0))
    for first, second in combinations(range(robot.joint_count), 2):
        pair = [first, second]
        if robot.joints[first] != robot.joints[second] or beyond.sum() != beyond[pair].sum():
            continue
        exchanged = outside_limits(readings[:, pair[::-1]], robot.limits[pair])
        if not exchanged.any():
            yield first, second


def _denied(converted: Measurements, robot: Robot) -> bool:
    """Whether points tell that readings so converted are not those of the nominal arm."""
    return _misfit(converted, robot) > MISFIT


def _misfit(given: Measurements, robot: Robot) -> float:
    """How far the first set-up's points are from the nominal arm's, over their spread; zero if too few."""
    seen = Seen.first(given)
    return 0.0 if seen is None else relative_misfit(robot, seen)
