"""Constant calibration: 27 unknowns, against SciPy's Levenberg-Marquardt on the same model in NumPy."""

import json
import sys
from functools import cache
from typing import Any

import numpy as np

from benches.numpy_arm import Model
from benches.ours import measured_with_threads
from benches.timing import Comparison, Results, Series, seconds_of
from truearm import _core
from truearm.robot import Robot
from truearm.simulation import Imperfections, VirtualArm

SIZES = (100, 1000, 10_000)
GROWTH = (100, 300, 1000, 3000, 10_000)
TARGET = 15.0
ROUNDS = 3
ARM_UNKNOWNS = 18
NOISE_M = 4e-5
# How far the start is from the truth: what a closed-form start leaves.
START_SHIFT_M, START_TURN_RAD = 2e-3, 2e-3
SAME_COST, SAME_PARAMETERS = 1e-8, 1e-7


@cache
def problem(poses):
    """The model that SciPy minimises; ours is made from it, so that both see the same numbers."""
    robot = Robot.load("ur10")
    arm = VirtualArm(robot, seed=1, imperfections=Imperfections(share=0.0))
    q = arm.poses(poses)
    measured = arm.measure_table(q)[["x", "y", "z"]].to_numpy()
    start = arm.world_from_base.copy()
    start[:3, 3] += START_SHIFT_M
    turn = np.array([[1.0, -START_TURN_RAD, 0.0], [START_TURN_RAD, 1.0, 0.0], [0.0, 0.0, 1.0]])
    start[:3, :3] = np.linalg.qr(turn)[0] * np.sign(np.diag(np.linalg.qr(turn)[1])) @ start[:3, :3]
    values = robot.joints_from_readings(q)
    return Model(values, measured, robot.table, columns(), start, arm.target_in_flange + START_SHIFT_M)


@cache
def columns():
    """Eighteen parameters of the arm that positions determine beside frame and point."""
    robot = Robot.load("ur10")
    arm = VirtualArm(robot, seed=1)
    values = robot.joints_from_readings(arm.poses(300))
    every = list(range(robot.table.size))
    model = Model(values, np.zeros((300, 3)), robot.table, every, arm.world_from_base, arm.target_in_flange)
    jacobian = model.jacobian(model.start())
    setup = np.linalg.qr(jacobian[:, len(every) :])[0]
    left = jacobian[:, : len(every)] - setup @ (setup.T @ jacobian[:, : len(every)])
    chosen = []
    for _ in range(ARM_UNKNOWNS):
        best = int(np.argmax(np.einsum("ij,ij->j", left, left) * _scale(left.shape[1])))
        direction = left[:, best] / np.linalg.norm(left[:, best])
        left = left - np.outer(direction, direction @ left)
        chosen.append(best)
    return sorted(chosen)


def _scale(count):
    """Squared scale that makes one unit of an angle count like 0.3 m."""
    return np.where(np.isin(np.arange(count) % 5, (1, 2)), 1.0, 0.3**-2)


def ours(model):
    """The problem in the core's own terms, and a call that fits it."""
    robot = Robot.load("ur10")
    n = len(model.joints)
    arrays: Any = {
        "joints": model.joints,
        "group": np.zeros(n, dtype=np.int64),
        "targets": model.measured[:, None, :],
        "rotations": None,
        "sigma": np.zeros((n, 4)),
        "weight": np.ones(n),
        "distances": [],
    }
    setup = _core.Setup(
        model.world_from_base[None], model.point[None, None], np.eye(3)[None], np.empty((0, 3))
    )
    given = _core.Problem(robot.flange_chain, _core.MeasurementSet(arrays), model.columns)
    options: Any = {
        "prior": None,
        "noise": (NOISE_M, 1.0),
        "robust": None,
        "start": setup,
        "parameters": None,
        "threads": None,
    }
    return lambda: _core.fit_constant(given, options)


def run():
    """Compare, and check that both reach the same minimum."""
    single, double = _with_one_and_two_threads()
    comparisons = []
    for poses in SIZES:
        model = problem(poses)
        minimum = model.minimise()
        fit = ours(model)()
        check_same_minimum(model, minimum, fit)
        peer = seconds_of(model.minimise)
        name = f"constant calibration, 27 unknowns, {poses} poses"
        comparisons.append(Comparison(name, "scipy lm", single[str(poses)], peer, TARGET))
    comparisons += [
        Comparison(f"the same on two threads, {n} poses", "one thread", double[str(n)], single[str(n)], 0.97)
        for n in SIZES
    ]
    labels = [f"{n} poses" for n in GROWTH]
    series = [
        Series(f"constant calibration, {name}", labels, [seconds[str(n)] for n in GROWTH])
        for name, seconds in (("one thread", single), ("two threads", double))
    ]
    remarks = [
        "Both minimise the same squares over the same unknowns from the same start; ours also gives the "
        "covariance. Two threads pass when they are no slower than one, within 3 % of timing noise; both are "
        f"timed {ROUNDS} times in turn, and the best of each is compared."
    ]
    return Results("Constant calibration", comparisons, series, remarks)


def _with_one_and_two_threads():
    """Seconds by size with one thread and with two; a slow moment of the machine shall not count."""
    rounds = [[measured_with_threads("calibration", threads) for threads in (1, 2)] for _ in range(ROUNDS)]
    return (
        {size: min(one[size] for one in found) for size in found[0]} for found in zip(*rounds, strict=True)
    )


def check_same_minimum(model, minimum, fit):
    """Raise ValueError unless cost and parameters are the same."""
    cost = 0.5 * float(np.sum(np.square(fit.residuals)))
    apart = np.abs(np.ravel(fit.parameters)[model.columns] - minimum.x[: len(model.columns)]).max()
    if abs(cost - minimum.cost) > SAME_COST * minimum.cost or apart > SAME_PARAMETERS:
        raise ValueError(f"not the same minimum: costs {cost} and {minimum.cost}, parameters {apart} apart")


if __name__ == "__main__":
    json.dump({str(n): seconds_of(ours(problem(n))) for n in sorted({*SIZES, *GROWTH})}, sys.stdout)
