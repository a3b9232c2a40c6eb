"""An arm whose joint 3 is turned through a parallel link: what drives leave goes with readings."""

from dataclasses import replace
from functools import cache

import numpy as np

import truearm as ta
from truearm.simulation import VirtualArm

CYCLES = np.arange(1, 21)
RAD = 2e-4
"""About what the curve of each drive reaches, rad."""
NOISE_M = 3e-5


def left_by_drives(readings, seed=1):
    """What drives leave at readings (n, 6), rad: a curve of each with some eight cycles a turn."""
    rng = np.random.default_rng(seed)
    share = np.exp(-0.5 * ((CYCLES - 8.0) / 6.0) ** 2)
    share *= RAD / np.linalg.norm(share)
    cosines, sines = rng.normal(size=(2, 6, len(CYCLES))) * share
    phases = readings[:, :, None] * CYCLES
    return (cosines * np.cos(phases) + sines * np.sin(phases)).sum(axis=2)


def of_drives(behind_a_link, poses, seed=1, noise_m=NOISE_M):
    """The arm, and its measurements where curves go with readings, or with D-H angles."""
    robot = ta.Robot.load("fanuc-lr-mate-200id")
    measured = VirtualArm(robot, seed=seed).measure(VirtualArm(robot, seed=seed).poses(poses, seed=seed))
    readings = measured.readings
    angles = readings @ robot.coupling.T
    if behind_a_link:
        turned = readings + left_by_drives(readings)
    else:
        turned = np.linalg.solve(robot.coupling, (angles + left_by_drives(angles)).T).T
    at = robot.pose(turned)
    noise = noise_m * np.random.default_rng(seed).normal(size=(poses, 3))
    target = at[:, :3, 3] + at[:, :3, :3] @ [0.03, 0.02, 0.1] + noise
    return robot, replace(measured, targets=target[:, None])


@cache
def calibrated(behind_a_link):
    """A calibration of 120 poses of such an arm."""
    return ta.calibrate(*of_drives(behind_a_link, 120), seed=1)
