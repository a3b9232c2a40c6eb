"""Paths as the real arm follows them: compensated by a scheme, rounded by the controller."""

from typing import Final

import numpy as np

from truearm.planning.spaces import CartesianSpace
from truearm.studies.experiment import Experiment
from truearm.studies.metrics import Trace, scheme_chain
from truearm.studies.process.setting import COMMAND_MM
from truearm.studies.schemes import Scheme
from truearm.types import Floats
from truearm.units import MM_PER_METRE, to_si

STEPS: Final = 12
SETTLED_M: Final = 1e-9
"""Commands that move less in a step are as they will be: the controller rounds them far more coarsely."""


def followed(made: Experiment, space: CartesianSpace, scheme: Scheme, coordinates: Floats) -> Trace:
    """Errors of the real tool on a path (n, 3) of the space that a scheme has compensated.

    The command of each point is moved against what the scheme says the arm is off there, step by step until
    that fits, and rounded as the controller rounds it. Points that then are out of reach are NaN.
    """
    robot, wanted = made.arm.robot, space.points(coordinates)
    chain, origin = scheme_chain(made, scheme), np.asarray(space.origin)
    off, moving = np.zeros_like(wanted), np.arange(len(wanted))
    for _ in range(STEPS):
        if not len(moving):
            break
        readings, reached = space.readings(wanted[moving] - off[moving] - origin)
        readings, moving = readings[reached], moving[reached]
        values = np.ascontiguousarray(robot.joints_from_readings(readings))
        parameters = np.ascontiguousarray(scheme.parameters(readings))
        found = chain.position(values, parameters) - robot.position(readings)
        moved = np.abs(found - off[moving]).max(axis=1)
        off[moving] = found
        moving = moving[moved > SETTLED_M]
    step = to_si(COMMAND_MM, "mm")
    readings, reached = space.readings(np.rint((wanted - off) / step) * step - origin)
    errors, shown = np.full_like(wanted, np.nan), np.full((len(wanted), *made.identified.table.shape), np.nan)
    errors[reached] = MM_PER_METRE * (made.arm.true_position(readings[reached]) - wanted[reached])
    shown[reached] = scheme.parameters(readings[reached])
    return Trace(errors, shown)
