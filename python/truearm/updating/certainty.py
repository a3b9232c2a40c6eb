"""How certain a calibration is before and after an update, whatever frame and target are."""

from dataclasses import replace
from typing import Final

import numpy as np

from truearm._core import Problem, linearise, setup_jacobian
from truearm.calibration import Calibration
from truearm.errors import Notice
from truearm.fits.core_set import measured_points
from truearm.judgement.judging import model_inputs
from truearm.rows.evenly import some_rows
from truearm.types import AXES
from truearm.units import MM_PER_METRE
from truearm.update_words import kept_words
from truearm.updating.parts import part_of
from truearm.updating.scene import without

LESS_CERTAIN: Final = "less_certain"
CLEARLY: Final = 1.1
"""Times the standard deviation of before: no nearer is it known itself, from some dozens of poses."""
MOST_VALUES: Final = 300
"""They tell a mean over the poses as well as all."""


def expected_mm(before: Calibration, after: Calibration) -> tuple[float, float] | None:
    """Expected standard deviation of the targets' positions over the poses that constants and field are from.

    Root of the mean of the sum over x, y and z, of the calibration before and after an update; of what frame
    and target, found anew, do not take over: those of the update's set-up are not those of the one before.

    Returns:
        Both in mm; None where the poses are not in the file.
    """
    learned = before.learned_from
    if learned is None:
        return None
    number = len(before.groups) - 1
    used = replace(before.measured.selection(number, before.selection), orientation=False)
    values = AXES * len(used.targets)
    data = learned.data.select(some_rows(np.arange(len(learned.data)), MOST_VALUES // values))
    inputs = model_inputs(before.arm, data, before.options.features)
    arm, setup = before.arm, part_of(before.model.setup, used, before.selection)
    points = np.zeros((len(data), len(used.targets), AXES))
    measured = measured_points(arm.robot.joints_from_readings(data.readings), points, group=number)
    problem = Problem(arm.flange_chain, measured, list(range(arm.table.size)), arm.world_is_known)
    parameters = before.model.parameters(inputs)
    jacobian, _ = linearise(problem, parameters, setup)
    taken = setup_jacobian(problem, parameters, setup).reshape(len(data) * values, -1)
    both = (without(each.spread.joint(inputs, jacobian), taken) for each in (before, after))
    then, now = (float(MM_PER_METRE * np.sqrt(AXES * np.diagonal(left).mean())) for left in both)
    return then, now


def less_certain(expected: tuple[float, float] | None) -> list[Notice]:
    """A notice that what holds is to be kept, where the update made it clearly less certain."""
    if expected is None or expected[1] <= CLEARLY * expected[0]:
        return []
    return [Notice(LESS_CERTAIN, kept_words(*expected))]
