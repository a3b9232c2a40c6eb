"""The Movemaster command set, as far as a calibration needs it, and how its controller rounds.

Commands end with a carriage return and have no answer, but for WH and ER:

    NT                 go to the mechanical origin
    SP n               speed 0 to 9
    MJ w,s,e,p,r       turn the joints by so much, deg: the angles are increments
    MP x,y,z,p,r       move to a position, mm and deg
    HE n, MO n         keep the present position as number n; move to position n
    WH                 where: x,y,z,p,r in mm and deg
    ER                 error: 0 none, 1 hardware, 2 command
    RS                 reset after an error of kind 2

Commands are done one after another, so the answer to WH comes when the arm stands. All numbers have one
decimal place: 0.1 mm and 0.1 deg is what the controller rounds to. There is no command that ends a motion.

docs/reference/cell-protocols.md tells which of this is confirmed by what. The angles p and r of a position
are here the sum of the readings of joints 2 to 4 and the reading of joint 5.
"""

import re
from collections.abc import Sequence
from typing import Final

import numpy as np

from truearm.errors import InputError
from truearm.robot import Robot
from truearm.types import Floats
from truearm.units import MM_PER_METRE, RADIANS_PER_DEGREE

Tenths = tuple[int, ...]

TERMINATOR: Final = b"\r"
JOINTS: Final = 5
# Controllers leave out a zero before the point.
NUMBER: Final = r"[+-]?\d{0,4}\.\d"
NUMBERS: Final = re.compile(rf"\s*{NUMBER}(?:\s*,\s*{NUMBER}){{4}}\s*")
# What the controller rounds joints to, rad.
TENTH: Final = 0.1 * RADIANS_PER_DEGREE
# Joint speeds for SP 0 to 9, deg/s: the manual gives the share of the greatest, which is 140 here.
SPEEDS_DEG_S: Final = (4.0, 8.0, 14.0, 24.0, 40.0, 60.0, 80.0, 100.0, 120.0, 140.0)
NO_ERROR, HARDWARE_ERROR, COMMAND_ERROR = "0", "1", "2"


def check_arm(arm: Robot) -> None:
    """Raise InputError unless the arm has the five turning joints that the commands are about."""
    if arm.joint_count != JOINTS or set(arm.joints) != {"revolute"}:
        raise InputError(
            f"{arm.name} has {arm.joint_count} joints",
            rule="The Movemaster commands are those of an arm with five turning joints",
        )


def tenths(readings: Floats) -> Tenths:
    """Readings (N,) in rad as whole tenths of a degree, the controller's rounding."""
    return tuple([round(reading / TENTH) for reading in readings.tolist()])


def readings_of(count: Tenths) -> Floats:
    """Readings (N,) in rad of whole tenths of a degree."""
    return np.array([TENTH * value for value in count])


def listed(values: Sequence[int]) -> str:
    """Whole tenths as the numbers of a command."""
    return ",".join([f"{value / 10:+.1f}" for value in values])


def parse_numbers(text: str) -> Tenths | None:
    """Five numbers with one decimal as whole tenths; None if the text is anything else."""
    if NUMBERS.fullmatch(text) is None:
        return None
    return tuple([round(10.0 * float(part)) for part in text.split(",")])


def whereabouts(arm: Robot, readings: Floats) -> list[float]:
    """Position x, y, z in mm and angles p, r in deg that the controller computes, not yet rounded."""
    _, shoulder, elbow, pitch, roll = readings.tolist()
    angles = (shoulder + elbow + pitch) / RADIANS_PER_DEGREE, roll / RADIANS_PER_DEGREE
    return [*[MM_PER_METRE * value for value in _point(arm, readings).tolist()], *angles]


def readings_near(arm: Robot, position: Sequence[float], seed: Floats) -> Floats | None:
    """Readings (5,) that give a position, by Newton's method from `seed`; None if it leads nowhere.

    Angles p and r are met exactly; the first three unknowns follow from the point.
    """
    where, readings = np.asarray(position), np.array(seed, dtype=np.float64)
    readings[4] = where[4] * RADIANS_PER_DEGREE
    for _ in range(NEWTON_STEPS):
        readings[3] = where[3] * RADIANS_PER_DEGREE - readings[1] - readings[2]
        missing = where[:3] / MM_PER_METRE - _point(arm, readings)
        if np.abs(missing).max() < NEWTON_TOLERANCE_M:
            return readings
        jacobian = arm.joint_jacobian(readings)
        reduced = jacobian[:, :3].copy()
        reduced[:, 1:] -= jacobian[:, 3:4]
        step, *_ = np.linalg.lstsq(reduced, missing, rcond=None)
        readings[:3] += np.clip(step, -LONGEST_STEP_RAD, LONGEST_STEP_RAD)
    return None


def _point(arm: Robot, readings: Floats) -> Floats:
    """The nominal tool point (3,) of readings that are known to be sound."""
    return np.asarray(arm.chain.position(arm.values_of(readings[None]))[0])


NEWTON_STEPS: Final = 30
NEWTON_TOLERANCE_M: Final = 1e-9
LONGEST_STEP_RAD: Final = 0.3
