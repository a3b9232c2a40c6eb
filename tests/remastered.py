"""A virtual arm after its encoders were set anew, and its target moved."""

import numpy as np

import truearm as ta
from truearm.simulation import VirtualArm

SHIFT = np.array([0.0, 0.6, -0.2, 0.9, 0.0])
TOOL_MM = (0.6, -0.5, 0.6)


def remastered_table(arm, readings, shift_deg, *, seed, tool_mm=(0.0, 0.0, 0.0)):
    """What is measured at `readings` (n, N) when each joint stands `shift_deg` (N,) further than it reads."""
    before = arm.target_in_flange
    arm.target_in_flange = before + 1e-3 * np.asarray(tool_mm)
    table = arm.measure_table(readings + np.radians(shift_deg), seed=seed)
    arm.target_in_flange = before
    for joint, column in enumerate(readings.T, start=1):
        table[f"q{joint}"] = column
    return table


def remastered(arm, readings, shift_deg, **more):
    """The same as Measurements."""
    return ta.Measurements.from_dataframe(remastered_table(arm, readings, shift_deg, **more))


def paper_arm():
    """The paper's arm and a calibration of it."""
    arm = VirtualArm.paper(seed=2)
    return arm, ta.calibrate(arm.robot, arm.measure(arm.poses(60)))


def updated(arm, calibration):
    """What 15 poses of the arm measured after SHIFT, and the update by these."""
    data = remastered(arm, arm.poses(15, seed=9), SHIFT, seed=9, tool_mm=TOOL_MM)
    return data, ta.update(calibration, data)


def std_mm(calibration, q):
    """Standard deviation of the tool's position, all coordinates together."""
    return 1e3 * np.linalg.norm(calibration.position_std(q), axis=1)


def check_offset(offset, truth, errors=4.0):
    """The change of an offset is found within some standard errors, which are small."""
    assert offset.std is not None
    assert abs(offset.change - truth) < errors * offset.std < 0.2
