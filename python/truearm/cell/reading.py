"""What passes between the process and its devices: where a point is expected, and what was measured."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Expected:
    """What a sensor is prepared for. The world is the sensor's own frame.

    Attributes:
        readings: Joint readings (N,) of the pose, rad or m.
        point_in_world: Where the target should be (3,), m.
        radius_m: How far from there it may be.
        pointing_in_world: Unit vector (3,) along the tool, from flange to target.
    """

    readings: Floats
    point_in_world: Floats
    radius_m: float
    pointing_in_world: Floats


@dataclass(frozen=True, eq=False)
class Reading:
    """One measurement of the target on the tool.

    Attributes:
        point_in_world: The point (3,), m; None where nothing was measured.
        sigma_m: Standard deviation of each coordinate.
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
