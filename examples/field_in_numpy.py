"""A calibration as plain functions of joint readings: parameters, predictions and how far to trust them."""

# %% A calibration: here of a virtual UR10; yours is ta.Calibration.load("result/calibration.calib")
import numpy as np

import truearm as ta
from truearm.simulation import VirtualArm

arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(100)))

# %% A grid over joints 2 and 3, the others at rest: (61, 61, 6) readings in rad
second, third = np.meshgrid(np.radians(np.linspace(-150, 0, 61)), np.radians(np.linspace(-120, 120, 61)))
q = np.zeros((61, 61, 6))
q[..., 1], q[..., 2] = second, third
flat = q.reshape(-1, 6)

# %% The field: absolute D-H parameters (n, 6, 5) in the order theta, d, a, alpha, beta
parameters = calibration.parameters(flat)
theta3 = 1e3 * (parameters[:, 2, 0] - arm.robot.table[2, 0]).reshape(61, 61)
print(f"theta 3 is corrected by {theta3.min():.2f} to {theta3.max():.2f} mrad")

# %% Where the tool really is, how certain that is, and where the nominal arm would have it
shift = 1e3 * np.linalg.norm(calibration.position(flat) - arm.robot.position(flat), axis=1)
std = 1e3 * np.linalg.norm(calibration.position_std(flat), axis=1)
print(f"the nominal arm misses by {shift.mean():.2f} mm; known to {std.min():.3f} ... {std.max():.3f} mm")

# %% Trust it where the standard deviation is small: a map of what is good enough
good = (2.0 * std < 0.28).reshape(61, 61)
print(f"{100 * good.mean():.0f} % of these configurations are known to 0.28 mm at two sigma")

# %% The least certain of them are what to measure next
print("measure next, deg:", np.degrees(flat[std.argmax()]).round(0))
