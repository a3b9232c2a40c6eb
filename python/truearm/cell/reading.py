"""What passes between the process and its devices: where a point is expected, and what was measured."""

import math
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from truearm.arrays import rotation_fault
from truearm.cell.device_errors import MEND_THE_DRIVER, MalformedReadingError
from truearm.cell.shown import shown
from truearm.tables.columns import PURPOSE, means_something
from truearm.types import Floats

TRUTHS: Final = (bool, np.bool_)
TOLERANCE: Final = 1e-3
OWN_COLUMNS: Final = ("step", "pose", PURPOSE, "approach", "readings", "temperature_c")
"""Columns of a session's measurements beside those that measurement files know."""
NOT_FINITE: Final = "the driver gave a point that is not finite"


@dataclass(frozen=True, eq=False)
class Expected:
    """What a sensor is prepared for. The world is the sensor's own frame.

    Attributes:
        readings: Joint readings (N,) of the pose, rad or m.
        point_in_world: Where the target should be (3,), m.
        radius_m: How far from there it may be.
        pointing_in_world: Unit vector (3,) along the tool, from flange to target.
        approach: From which side joints come: 1 from lower readings, -1 from higher, 0 from anywhere.
        turned_rad: By how much the tool may be turned from there.
    """

    readings: Floats
    point_in_world: Floats
    radius_m: float
    pointing_in_world: Floats
    approach: int = 0
    turned_rad: float = 0.0


@dataclass(frozen=True, eq=False)
class Reading:
    """One measurement of the target on the tool.

    Attributes:
        point_in_world: The point (3,), m; None where nothing was measured.
        sigma_m: Standard deviation of each coordinate, m: above 0. It does not matter where `valid` is False.
        time_s: When, in seconds since the epoch.
        valid: Whether the instrument vouches for it.
        raw: What the device said, as it came.
        reason: Why it is not valid; empty where it is.
        pose_in_world: world_from_target (4, 4), where orientation was measured as well.
        temperature_c: Temperature at the instrument, where it has a thermometer.
        features: Further numbers by name.
    """

    point_in_world: Floats | None
    sigma_m: float
    time_s: float
    valid: bool
    raw: str
    reason: str = ""
    pose_in_world: Floats | None = None
    temperature_c: float | None = None
    features: dict[str, float] = field(default_factory=dict)


def is_column(name: str) -> bool:
    """Whether a measurement file has a column of this name already, so that no feature can be called so."""
    return name in OWN_COLUMNS or means_something(name)


def checked_reading(reading: object) -> Reading:
    """What a driver gave as a reading, with Python's own numbers and arrays of float64.

    Numbers of numpy and lists are taken as well. A point that is not finite is not valid. In a reading that
    is not valid sigma_m becomes 0 where it is no number above 0.

    Raises:
        MalformedReadingError: If it is no reading, or a part of it is not what Reading says.
    """
    if not isinstance(reading, Reading):
        raise _wrong(f"measure gave {shown(reading)}", "It gives a Reading, valid or not")
    if not isinstance(reading.valid, TRUTHS):
        raise _wrong(f"valid is {shown(reading.valid)}", "It is True or False")
    for key, text in (("raw", reading.raw), ("reason", reading.reason)):
        if not isinstance(text, str):
            raise _wrong(f"{key} is {shown(text)}", "It is text")
    valid, reason, point = bool(reading.valid), str(reading.reason), reading.point_in_world
    if point is None and valid:
        raise _wrong("a valid reading has no point", "Where nothing was measured valid is False")
    if point is not None:
        point = _array(point, (3,), "point_in_world")
        if not all(map(math.isfinite, point.tolist())):
            valid, reason, point = False, reason or NOT_FINITE, None
    time_s = _number(reading.time_s, "time_s")
    if not math.isfinite(time_s):
        raise _wrong(f"time_s is {time_s:g}", "It is in seconds since the epoch")
    sigma_m = _sigma_m(reading.sigma_m, valid=valid)
    pose, celsius, features = reading.pose_in_world, reading.temperature_c, reading.features
    pose = None if pose is None or not valid else _pose(pose)
    celsius = None if celsius is None else _number(celsius, "temperature_c")
    features = {} if features == {} else _features(features)
    return Reading(point, sigma_m, time_s, valid, str(reading.raw), reason, pose, celsius, features)


def _features(features: object) -> dict[str, float]:
    if not isinstance(features, dict):
        raise _wrong(f"features are {shown(features)}", "They are numbers by name")
    taken = [name for name in features if not isinstance(name, str) or is_column(name)]
    if taken:
        raise _wrong(
            f"a feature is called {shown(taken[0])}", "Names of columns of a measurement file are taken"
        )
    return {str(name): _number(value, f'feature "{name}"') for name, value in features.items()}


def _pose(pose: object) -> Floats:
    found = _array(pose, (4, 4), "pose_in_world")
    if rotation_fault(found[None, :3, :3], TOLERANCE) is not None:
        raise _wrong("pose_in_world is no turn and place", "It is world_from_target (4, 4), a rotation in it")
    return found


def _array(value: Any, shape: tuple[int, ...], what: str) -> Floats:  # noqa: ANN401 - whatever a driver gave
    try:
        found = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise _wrong(f"{what} is {shown(value)}", f"It is an array {shape} of numbers") from None
    if found.shape != shape:
        raise _wrong(f"{what} has the shape {found.shape}", f"It is an array {shape} of numbers")
    return found


def _sigma_m(value: Any, *, valid: bool) -> float:  # noqa: ANN401 - whatever a driver gave
    """A standard deviation; 0 where nothing was measured and it is none."""
    try:
        sigma_m = _number(value, "sigma_m")
        if not 0.0 < sigma_m < math.inf:
            raise _wrong(f"sigma_m is {sigma_m:g}", "It is above 0, in m")
    except MalformedReadingError:
        if valid:
            raise
        return 0.0
    return sigma_m


def _number(value: Any, what: str) -> float:  # noqa: ANN401 - whatever a driver gave
    try:
        number = None if isinstance(value, str | bytes) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = None
    if number is None:
        raise _wrong(f"{what} is {shown(value)}", "It is a number")
    return number


def _wrong(what: str, rule: str) -> MalformedReadingError:
    return MalformedReadingError(what, rule=rule, way_out=MEND_THE_DRIVER)
