"""What is wrong with a virtual arm and its instrument, and the conditions that it moves under."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Final, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike
from pydantic import ConfigDict

from truearm import kinds

Point = tuple[float, float, float]
NonGeometric = Literal["cartesian", "joint"]
Signs = Literal["random", "positive"]

STANDARD_GRAVITY: Final = 9.80665
STRICT: Final = ConfigDict(extra="forbid", allow_inf_nan=False)
CHOICES: Final = {"non_geometric": get_args(NonGeometric), "signs": get_args(Signs)}
SIZES: Final = (
    "length_mm",
    "angle_deg",
    "share",
    "noise_mm",
    "noise_mrad",
    "repeatability_mm",
    "repeatability_deg",
)


@dataclass(frozen=True)
class Harmonic:
    """A sine of a joint's own angle: amplitude * sin(order * q + phase).

    A gear of ratio i errs with order i once a turn of the motor; an encoder that sits off its axis with
    order 1 (eccentricity) and, where it is bent, with order 2.

    Attributes:
        order: Periods in a turn of the joint.
        amplitude_deg: Largest error.
        phase_deg: Phase at reading zero.
    """

    __pydantic_config__: ClassVar = STRICT

    order: float
    amplitude_deg: float
    phase_deg: float = 0.0


@dataclass(frozen=True)
class JointError:
    """How a revolute joint errs by itself.

    Attributes:
        joint: Number from 1.
        harmonics: Of gears.
        eccentricity_deg: Error, once a turn, of an encoder or a wheel that sits off its axis.
        eccentricity_phase_deg: Its phase at reading zero.
        backlash_deg: The whole play. The joint stops half of it short of where it is sent, on the side
            that it came from.
    """

    __pydantic_config__: ClassVar = STRICT

    joint: int
    harmonics: tuple[Harmonic, ...] = ()
    eccentricity_deg: float = 0.0
    eccentricity_phase_deg: float = 0.0
    backlash_deg: float = 0.0


@dataclass(frozen=True)
class Mass:
    """A point mass that a link carries.

    Attributes:
        link: Number from 1.
        kg: Mass.
        at_m: Where, in the frame of the link (the one behind its row of the table).
    """

    __pydantic_config__: ClassVar = STRICT

    link: int
    kg: float
    at_m: Point = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Deflection:
    """Joints that give way under the weight of links and payload.

    A joint turns by its compliance times the torque of gravity about its axis; a sliding one moves by it
    times the force along its axis. Torques are those of the arm before it gave way.

    Attributes:
        compliance: Of each joint, rad per Nm (m per N of a sliding one).
        masses: Of the links.
        payload_at_m: Where a payload's centre of mass is in the flange frame.
        gravity_m_s2: In the frame that the robot file's base stands in.
    """

    __pydantic_config__: ClassVar = STRICT

    compliance: tuple[float, ...]
    masses: tuple[Mass, ...] = ()
    payload_at_m: Point = (0.0, 0.0, 0.0)
    gravity_m_s2: Point = (0.0, 0.0, -STANDARD_GRAVITY)


@dataclass(frozen=True)
class Thermal:
    """Growth with temperature.

    Attributes:
        growth_per_k: Part by which all d and a grow for each kelvin, such as 23e-6 of aluminium.
        drift_per_k: Further change of parameters by name, mm or deg for each kelvin.
        reference_c: Temperature at which nothing has grown.
    """

    __pydantic_config__: ClassVar = STRICT

    growth_per_k: float = 23e-6
    drift_per_k: Mapping[str, float] = field(default_factory=dict)
    reference_c: float = 20.0


@dataclass(frozen=True)
class Imperfections:
    """How wrong a virtual arm is, and its instrument.

    Attributes:
        length_mm: Size of the error of each erring d and a; the sign is drawn.
        angle_deg: Size of the error of each erring theta, alpha and beta; the sign is drawn.
        share: Mean of the non-geometric error as a share of the mean geometric one.
        non_geometric: What the harmonics of equation (6) are: an error of the point, in the frame of the
            base ("cartesian"), or of the joints themselves ("joint").
        noise_mm: Standard deviation of a measured coordinate.
        noise_mrad: Standard deviation of a measured orientation about each axis.
        signs: Whether drawn errors have random signs or are all positive.
        stated: Errors of parameters by name, mm or deg, in place of drawn ones: {"d1": 0.3, "theta2": -0.1}.
        repeatability_mm: Standard deviation of each coordinate of the point from one visit to the next.
        repeatability_deg: The same of each joint (of a sliding one, mm in place of deg).
        joint_errors: Errors of joints by themselves.
        deflection: Joints that give way under weight.
        thermal: Growth with temperature.
    """

    __pydantic_config__: ClassVar = STRICT

    length_mm: float = 0.4
    angle_deg: float = 0.05
    share: float = 0.09
    non_geometric: NonGeometric = "cartesian"
    noise_mm: float = 0.04
    noise_mrad: float = 0.1
    signs: Signs = "random"
    stated: Mapping[str, float] = field(default_factory=dict)
    repeatability_mm: float = 0.0
    repeatability_deg: float = 0.0
    joint_errors: tuple[JointError, ...] = ()
    deflection: Deflection | None = None
    thermal: Thermal | None = None

    def __post_init__(self) -> None:
        kinds.settle(self, numbers=SIZES)
        kinds.check_values(self, choices=CHOICES, not_negative=SIZES)


@dataclass(frozen=True, eq=False)
class Conditions:
    """What a pose is reached under; a number for all poses, or one (n,) for each.

    Attributes:
        payload_kg: Mass at the flange.
        temperature_c: Temperature of the arm; that of reference with None.
        approach: Sign (n, N) of each joint's last movement; +1 where it came from smaller readings.
            Without it nothing lags: joints stand in the middle of their play.
    """

    payload_kg: ArrayLike = 0.0
    temperature_c: ArrayLike | None = None
    approach: ArrayLike | None = None


def approach_in_sequence(readings: ArrayLike, start: ArrayLike | None = None) -> np.ndarray:
    """Signs (n, N) of each joint's last movement when `readings` (n, N) are visited one after another.

    Args:
        readings: In the order of the visits.
        start: Readings (N,) before the first; zero by default.
    """
    rows = np.atleast_2d(np.asarray(readings, dtype=np.float64))
    first = np.zeros(rows.shape[1]) if start is None else np.asarray(start, dtype=np.float64)
    signs = np.sign(np.diff(rows, axis=0, prepend=first[None]))
    last_moved = np.maximum.accumulate(np.where(signs != 0.0, np.arange(len(rows))[:, None], 0), axis=0)
    return np.asarray(np.take_along_axis(signs, last_moved, axis=0))
