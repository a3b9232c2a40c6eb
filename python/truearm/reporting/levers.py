"""What a target that is free takes over from the arm: the parameters of the link that it is mounted on."""

from typing import Final

import numpy as np

from truearm.fits.parameters import KIND_COUNT, THETA, D
from truearm.reporting.facts import Facts
from truearm.units import MM_PER_METRE

ON_THE_AXIS_MM: Final = 5.0
"""Targets nearer to the last joint's axis than this hardly show how it turns."""
BEHIND_ITS_JOINT: Final = {"standard": tuple(range(KIND_COUNT)), "modified": (THETA, D)}
"""Kinds of a row that stand behind its joint."""


def target_lever_mm(facts: Facts) -> float | None:
    """Distance of the judged point from the last joint's axis, mm; None where that slides or none is seen."""
    robot = facts.calibration.robot
    if robot.joints[-1] == "prismatic" or facts.calibration.selection.distances:
        return None
    end = np.eye(4)
    end[:3, 3] = facts.point
    chain = facts.calibration.arm.chain(robot.flange @ end)
    moved = chain.joint_jacobian(robot.joints_from_readings(facts.typical[None]))[0, :3, -1]
    return float(MM_PER_METRE * np.linalg.norm(moved))


def taken_over(facts: Facts) -> set[str]:
    """Names of the parameters that free targets take over, however many and wherever they are.

    What stands behind the last joint moves all targets alike, whatever the pose: the whole last link in the
    standard convention, in the modified one what follows its axis.
    """
    arm = facts.calibration.arm
    last, behind = arm.table.size // KIND_COUNT - 1, BEHIND_ITS_JOINT[arm.robot.convention]
    pairs = zip(arm.candidates.names, arm.candidates.columns, strict=True)
    return {name for name, column in pairs if column - KIND_COUNT * last in behind}
