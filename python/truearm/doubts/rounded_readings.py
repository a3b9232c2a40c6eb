"""Readings that were rounded to few decimals, and what that leaves of the noise of points."""

from typing import Final

import numpy as np

from truearm.errors import Notice
from truearm.lengths import length_mm
from truearm.robot import Robot
from truearm.types import Floats
from truearm.units import MM_PER_METRE, to_si

STEPS: Final = tuple((10.0**-decimals, unit) for unit in ("deg", "rad") for decimals in range(5))
"""What readings of joints that turn are rounded to, the coarsest of a unit first."""
WITHIN: Final = 1e-3
"""Part of a step by which its multiples may be off, as they come from another unit."""
GOOD_PART: Final = (0.7, 1.4)
"""Of the noise what rounding leaves, for a word: half of its variance, and no more than there is by chance.
More than there is was not left: the arm stood at round readings."""
MOST_ROWS: Final = 1000


def rounded_notices(robot: Robot, readings: Floats, noise_mm: float) -> list[Notice]:
    """A notice where rounded readings make a good part of the noise that points are said to have.

    A reading that is rounded to multiples of a step is off by step / sqrt(12) in the root of the mean square,
    and its joint's column of the Jacobian carries that to the point.

    Args:
        robot: The arm, with the measured point for its tool.
        readings: Readings (n, N), rad and m.
        noise_mm: Standard deviation of a coordinate's noise.
    """
    step = _step(readings[:, robot.revolute])
    if step is None:
        return []
    some = np.ascontiguousarray(readings[:: 1 + len(readings) // MOST_ROWS])
    squares = np.square(robot.joint_jacobian(some)[:, :, robot.revolute]).sum(axis=2)
    left_mm = MM_PER_METRE * to_si(*step) * float(np.sqrt(squares.mean() / 12.0))
    least, most = GOOD_PART
    if not least * noise_mm <= left_mm <= most * noise_mm:
        return []
    text = (
        f"All readings are multiples of {step[0]:g} {step[1]}. If they were rounded so, that alone leaves "
        f"about {length_mm(left_mm, 2)} per coordinate of the {length_mm(noise_mm, 2)} that are taken for "
        "noise. Give them with the decimals that the controller computes with, not those that it shows."
    )
    return [Notice("rounded_readings", text)]


def _step(readings: Floats) -> tuple[float, str] | None:
    """The coarsest step and its unit of which readings (n, J), rad, are multiples; None without one."""
    for size, unit in STEPS:
        steps = readings / to_si(size, unit)
        if steps.any() and np.abs(steps - np.round(steps)).max() <= WITHIN:
            return size, unit
    return None
