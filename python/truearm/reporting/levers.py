"""What a target that is free takes over from the arm: the parameters of the link that it is mounted on."""

from typing import Final

import numpy as np

from truearm.parameters import KIND_COUNT
from truearm.reporting.facts import Facts
from truearm.units import MM_PER_METRE

ON_THE_AXIS_MM: Final = 5.0
"""Targets nearer to the last joint's axis than this hardly show how it turns."""


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
    """Names of the parameters that the target takes over; none where it is on the last axis or not seen.

    Behind an axis that slides it takes them over wherever it is: no motion turns the link.
    """
    if facts.calibration.selection.distances:
        return set()
    lever = target_lever_mm(facts)
    return of_last_link(facts) if lever is None or lever >= ON_THE_AXIS_MM else set()


def of_last_link(facts: Facts) -> set[str]:
    """Names of the last link's parameters: no pose tells them from where the target sits on it."""
    candidates = facts.calibration.arm.candidates
    last = facts.calibration.arm.table.size // KIND_COUNT - 1
    pairs = zip(candidates.names, candidates.columns, strict=True)
    return {name for name, column in pairs if column // KIND_COUNT == last}
