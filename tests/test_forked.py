"""Processes that a program forks after it has worked: on Linux multiprocessing does so by default."""

import subprocess
import sys
from multiprocessing import get_all_start_methods

import pytest

pytestmark = pytest.mark.skipif("fork" not in get_all_start_methods(), reason="nothing is forked here")

PROGRAM = """
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import truearm as ta
from truearm.simulation import VirtualArm

robot = ta.Robot.load("ur10")
many = np.random.default_rng(0).uniform(-1.0, 1.0, (100_000, 6))
arm = VirtualArm(robot, seed=2)
data = arm.measure(arm.poses(30))


def done():
    return ta.calibrate(robot, data, refit=False).to_bytes() + robot.position(many).tobytes()


def forked(call):
    with ProcessPoolExecutor(1, mp_context=get_context("fork")) as processes:
        return processes.submit(call).result()


def done_twice():
    return done() + forked(done)


here = done()
assert forked(done_twice) == here + here, "a forked process, and one that it forked"
"""
PATIENCE_S = 300


def test_forked_processes_work_as_the_one_they_came_from():
    done = subprocess.run([sys.executable, "-c", PROGRAM], check=False, timeout=PATIENCE_S)
    assert done.returncode == 0
