"""How the parameters vary along each joint: the model asked at poses that differ in one joint alone."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.calibration import Calibration
from truearm.errors import WorkError
from truearm.reporting.facts import Facts
from truearm.reporting.parameters import effect_mm

Floats = NDArray[np.float64]

STEPS: Final = 121
BAND_STEPS: Final = 31
AROUND: Final = 6
"""Poses about which the effect of a joint is averaged."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """Parameters along one joint, all other joints as in a usual pose.

    Attributes:
        joint: From 0.
        q: Readings of the joint (s,), rad or m.
        values: Corrections of all parameters to the nominal ones (s, 5 L), SI.
    """

    joint: int
    q: Floats
    values: Floats


def readings_along(facts: Facts, joint: int, steps: int, base: Floats | None = None) -> Floats:
    """Readings (s, N) that differ in one joint alone, from end to end of its usual range."""
    readings = np.repeat((facts.typical if base is None else base)[None], steps, axis=0)
    readings[:, joint] = facts.places(joint, steps)
    return readings


def sweep(facts: Facts, joint: int, steps: int = STEPS, base: Floats | None = None) -> Sweep:
    """Ask the model that predicts."""
    readings = readings_along(facts, joint, steps, base)
    return Sweep(joint, readings[:, joint], corrections(facts, readings))


def corrections(facts: Facts, readings: Floats) -> Floats:
    """Corrections (n, 5 L) of all parameters at readings (n, N), waves left out, SI."""
    found = facts.without_waves.parameters(facts.inputs(readings))
    return np.asarray((found - facts.calibration.arm.table).reshape(len(readings), -1))


def influence_mm(facts: Facts) -> Floats:
    """How far each parameter, varying along each joint, moves the judged point (N, 5 L), mm peak to peak."""
    levers = effect_mm(facts)
    total = np.zeros((len(facts.joints), len(levers)))
    bases = facts.drawn(AROUND)
    for base in bases:
        for joint in range(len(facts.joints)):
            total[joint] += np.ptp(sweep(facts, joint, BAND_STEPS, base).values, axis=0)
    return total * levers / len(bases)


def deviations(facts: Facts, joint: int, names: list[str]) -> Floats | None:
    """Standard deviations (s, c) of how parameters differ from their means along a joint, SI.

    None where the model does not tell them.
    """
    readings = readings_along(facts, joint, BAND_STEPS)
    try:
        return facts.calibration.variation_std(readings, names, features=facts.features or None)
    except WorkError:
        return None


def own_name(calibration: Calibration, joint: int) -> str:
    """Name of the parameter that a joint moves: theta, or d of a prismatic one."""
    return f"{'d' if calibration.robot.joints[joint] == 'prismatic' else 'theta'}{joint + 1}"
