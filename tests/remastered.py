"""A virtual arm after its encoders were set anew, and its target moved."""

import numpy as np

import truearm as ta


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
