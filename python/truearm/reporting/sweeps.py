"""How the parameters vary along each joint and feature: the model asked where one of them alone differs."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.errors import WorkError
from truearm.reporting.axes import curve_axis, places, readings_at
from truearm.reporting.facts import OUTER, Facts
from truearm.reporting.parameters import effect_mm
from truearm.types import Floats
from truearm.units import MM_PER_METRE

STEPS: Final = 121
BAND_STEPS: Final = 31
AROUND: Final = 6
"""Poses about which the effect of a joint is averaged."""
POSES: Final = 400
FEATURE_STEPS: Final = 9


@dataclass(frozen=True, eq=False)
class Sweep:
    """Parameters along one input, all others as in a usual pose.

    Attributes:
        q: Values of the input (s,): rad, m, or the feature's own unit.
        values: Corrections of all parameters to the nominal ones (s, 5 L), SI.
    """

    q: Floats
    values: Floats


def swept_names(facts: Facts) -> list[str]:
    """What can be swept, numbered as the inputs of the model: joints, then features whose range is known."""
    joints = [curve_axis(facts, joint).name for joint in range(len(facts.joints))]
    return joints if facts.readings is None else [*joints, *facts.features]


def feature_ends(facts: Facts, name: str) -> tuple[float, float]:
    """Usual range of a feature over the rows, but for a percent on either side, in its own unit.

    Raises:
        ValueError: If the rows were left out of the file.
    """
    rows = facts.calibration.learned_from
    if rows is None:
        raise ValueError("there are no rows")
    low, high = np.quantile(rows.data.features[name].to_numpy(), [OUTER, 1.0 - OUTER])
    return float(low), float(high)


def _asked(
    facts: Facts, which: int, steps: int, base: Floats | None = None
) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Values (s,) of one input from end to end of its range, with readings (s, N) and features (s,) there."""
    start = facts.typical if base is None else base
    features = {name: np.full(steps, value) for name, value in facts.features.items()}
    if which < len(facts.joints):
        along = curve_axis(facts, which)
        values = places(facts, along, steps)
        return values, readings_at(facts, start, {along: values}), features
    name = swept_names(facts)[which]
    features[name] = np.linspace(*feature_ends(facts, name), steps)
    return features[name], np.repeat(start[None], steps, axis=0), features


def sweep(facts: Facts, which: int, steps: int = STEPS, base: Floats | None = None) -> Sweep:
    """Ask the model that predicts, along a joint or a feature."""
    values, readings, features = _asked(facts, which, steps, base)
    inputs = np.column_stack([facts.calibration.robot.joints_from_readings(readings), *features.values()])
    return Sweep(values, _corrections(facts, np.ascontiguousarray(inputs)))


def corrections(facts: Facts, readings: Floats) -> Floats:
    """Corrections (n, 5 L) of all parameters at readings (n, N), waves left out, SI."""
    return _corrections(facts, facts.inputs(readings))


def _corrections(facts: Facts, inputs: Floats) -> Floats:
    found = facts.without_waves.parameters(inputs)
    return np.asarray((found - facts.calibration.arm.table).reshape(len(inputs), -1))


def influence_mm(facts: Facts) -> Floats:
    """How far each parameter, varying along each input, moves the judged point (I, 5 L), mm peak to peak."""
    levers = effect_mm(facts)
    total = np.zeros((len(swept_names(facts)), len(levers)))
    bases = facts.drawn(AROUND)
    for base in bases:
        for which in range(len(total)):
            total[which] += np.ptp(sweep(facts, which, BAND_STEPS, base).values, axis=0)
    return total * levers / len(bases)


def moved_mm(facts: Facts, name: str) -> Floats:
    """How far apart a feature moves the judged point over its usual range (n,), at some usual poses, mm."""
    poses = facts.drawn(POSES)
    values = np.linspace(*feature_ends(facts, name), FEATURE_STEPS)
    places = [
        facts.calibration.position(poses, tool=facts.point, features=facts.features | {name: value})
        for value in values.tolist()
    ]
    apart = [np.linalg.norm(here - there, axis=1) for here in places for there in places]
    return np.asarray(MM_PER_METRE * np.max(apart, axis=0))


def deviations(facts: Facts, which: int, names: list[str]) -> Floats | None:
    """Standard deviations (s, c) of how parameters differ from their means along an input, SI.

    None where the model does not tell them.
    """
    _, readings, features = _asked(facts, which, BAND_STEPS)
    try:
        return facts.calibration.variation_std(readings, names, features=features or None)
    except WorkError:
        return None


def own_name(calibration: Calibration, joint: int) -> str:
    """Name of the parameter that a joint moves: theta, or d of a prismatic one."""
    return f"{'d' if calibration.robot.joints[joint] == 'prismatic' else 'theta'}{joint + 1}"
