"""From a CSV file to a calibration that is judged. Put your own arm and file into the first lines."""

# %% The arm and its measurements; where there is no such file yet, a virtual arm is measured
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import truearm as ta
from truearm.simulation import VirtualArm

robot = ta.Robot.load("ur10")
table = Path("measurements.csv")
if not table.exists():
    arm = VirtualArm(robot, seed=3)
    arm.measure_table(arm.poses(100)).to_csv(table, index=False)

data = ta.Measurements.read_csv(table)
print(f"{len(data)} poses of {robot.name}")

# %% The calibration, judged on the three tenths of the poses that took no part in the fit
calibration = ta.calibrate(robot, data)
for name, errors in calibration.validation.holdout.items():
    found = errors.position
    print(f"{name:>9}: {found.mean:.3f} mm mean, {found.p95:.3f} mm for 95 %, {found.max:.3f} mm at most")

# %% What the poses do not determine is named, and held at the nominal value
for words in calibration.identifiability.words:
    print(words)

# %% Corrections of joint 2's own angle over its range, with their band
q = np.zeros((181, robot.joint_count))
q[:, 1] = np.linspace(-np.pi, np.pi, len(q))
correction = 1e3 * (calibration.parameters(q)[:, 1, 0] - robot.table[1, 0])
figure = Figure(figsize=(6, 3), layout="constrained")
axes = figure.subplots()
axes.plot(np.degrees(q[:, 1]), correction)
axes.set(xlabel="joint 2, deg", ylabel="correction of theta 2, mrad", title=robot.name)
figure.savefig("theta2.png")

# %% A file that commands, compensation and controllers read
calibration.save("arm.calib")
print("written: arm.calib, theta2.png")
