"""Compensation of paths and of single waypoints, against Newton on pinocchio, NumPy and roboticstoolbox."""

import json
import sys
from functools import cache
from importlib.util import find_spec
from typing import Any

import numpy as np

import truearm as ta
from benches import numpy_compensation
from benches.field import measurements
from benches.kinematics import END, TABLE, PinocchioArm
from benches.ours import measured_with_threads
from benches.timing import Comparison, Results, Series, seconds_of
from truearm import _core
from truearm.limits import Limits

WAYPOINTS = 100_000
# A loop takes the same time for every waypoint, so a part of them tells the time of all.
LOOP_WAYPOINTS = 2000
GROWTH = (1, 100, 1000, 10_000, 100_000)
PIN, NUMPY, TOOLBOX = 80.0, 15.0, 40.0
VARIABLE_FACTOR, ONE_SECONDS = 10.0, 5e-6
TRAINING = 400
LENGTH_M, ANGLE_RAD = 4e-4, 9e-4
SAME_M, STEPS = 1e-12, 10
# Sines of joints, m for the shoulder: so far from singular configurations, where everybody's Newton fails.
STRETCHED = 0.3
# How far waypoints for the field lie from measured readings, rad, and what standard deviation it may state:
# the default bound of 1 mm would refuse most of the poses at which this UR10 was measured.
AROUND_RAD, LARGEST_STD_MM = 0.02, 5.0
# A UR10's joints end at a whole turn; so far, rad, waypoints and their corrections are within the limits.
TURNED = 6.2
BOUNDS = (
    "largest_angle", "largest_slide", "largest_shift", "largest_turn", "largest_std",
    "shift_change", "turn_change", "residual", "residual_turn",
)  # fmt: skip


@cache
def true_table():
    """The table of an arm that is not what it was meant to be; beta stays, pinocchio's arm has none."""
    signs = np.random.default_rng(1).choice([-1.0, 1.0], TABLE.shape)
    return TABLE + signs * [ANGLE_RAD, LENGTH_M, LENGTH_M, ANGLE_RAD, 0.0]


def readings(n):
    """Random waypoints (n, 6) with elbow and wrist bent."""
    return bent(np.random.default_rng(0).uniform(-2.5, 2.5, (20 * n + 100, 6)))[:n]


def bent(q):
    """Rows with shoulder, elbow and wrist bent."""
    joints = (np.abs(np.sin(q[:, [2, 4]])) > STRETCHED).all(axis=1)
    shoulder = np.abs(TABLE[1, 2] * np.cos(q[:, 1]) + TABLE[2, 2] * np.cos(q[:, 1] + q[:, 2])) > STRETCHED
    return q[joints & shoulder]


def measured_readings(n):
    """Waypoints (n, 6) so bent, within the limits, and close to where the arm was measured."""
    rng, measured = np.random.default_rng(0), bent(measurements()[0].readings)
    measured = measured[np.abs(measured).max(axis=1) < TURNED]
    q = measured[rng.integers(len(measured), size=2 * n)]
    return bent(q + rng.uniform(-AROUND_RAD, AROUND_RAD, q.shape))[:n]


@cache
def corrector():
    """Ours, with constants and without bounds."""
    chain = _core.Chain("standard", ["revolute"] * 6, TABLE, np.eye(4), np.eye(4))
    programming = _core.ArmModel(chain, TABLE, np.eye(6))
    calibrated = _core.ArmModel(chain, true_table(), np.eye(6))
    options: Any = {"task": "pose", "moving": None, "joints": np.empty((0, 2))}
    return _core.Corrector(calibrated, programming, END, options | dict.fromkeys(BOUNDS, np.inf))


def ours(q):
    return corrector().path(q, [])[0]


def compensator(model):
    """For a measured UR10, "constant" or "variable", with bounds and standard deviations on."""
    data, _ = measurements()
    options = {"use": "position", "train_size": TRAINING, "refit": False, "model": model}
    calibration = ta.calibrate(ta.Robot.load("ur10"), data, **options)
    return ta.Compensator(calibration, limits=Limits(largest_std_mm=LARGEST_STD_MM))


def newton_on_pinocchio(nominal, arm, q):
    """The loop that a pinocchio user writes."""
    pin, model, data, frame = arm.pin, arm.model, arm.data, arm.frame
    corrected = q.copy()
    for row in corrected:
        pin.framesForwardKinematics(nominal.model, nominal.data, row)
        target = nominal.data.oMf[nominal.frame].copy()
        for _ in range(STEPS):
            pin.framesForwardKinematics(model, data, row)
            error = pin.log6(data.oMf[frame].actInv(target)).vector
            if error @ error < SAME_M**2:
                break
            jacobian = pin.computeFrameJacobian(model, data, row, frame, pin.LOCAL)
            row[:] = row + np.linalg.solve(jacobian, error)
    return corrected


def toolbox_arm():
    """The true arm as roboticstoolbox sees it, whose ik_LM is C++."""
    import roboticstoolbox  # noqa: PLC0415 - it need not be installed
    from spatialmath import SE3  # noqa: PLC0415 - it comes with the toolbox

    links = [
        roboticstoolbox.RevoluteDH(offset=theta, d=d, a=a, alpha=alpha)
        for theta, d, a, alpha, _ in true_table()
    ]
    return roboticstoolbox.DHRobot(links, tool=SE3(END)).ets()


def solved_by_toolbox(arm, targets, q):
    # It stops where half the square of the error is below its tolerance.
    tolerance = SAME_M**2 / 4
    return np.array(
        [
            arm.ik_LM(target, q0=row, tol=tolerance, joint_limits=False)[0]
            for target, row in zip(targets, q, strict=True)
        ]
    )


def run():
    """Compare, and check that all find the same joints."""
    q = readings(WAYPOINTS)
    few = q[:LOOP_WAYPOINTS]
    nominal, arm = PinocchioArm(), PinocchioArm(true_table())
    single, double = (measured_with_threads("compensation", threads) for threads in (1, 2))
    check(arm, few, "pinocchio's", newton_on_pinocchio(nominal, arm, few))
    check(arm, few, "NumPy's", numpy_compensation.joints(TABLE, true_table(), END, few))
    constant = single["growth"][str(WAYPOINTS)]
    name = f"compensation, {WAYPOINTS} waypoints, constant CEPs, pose"
    scale = WAYPOINTS / LOOP_WAYPOINTS
    loop = seconds_of(lambda: newton_on_pinocchio(nominal, arm, few), repeats=3) * scale
    numpy = seconds_of(lambda: numpy_compensation.joints(TABLE, true_table(), END, q), repeats=3)
    comparisons = [
        Comparison(name, "Newton on pin in Python", constant, loop, PIN),
        Comparison(name, "NumPy", constant, numpy, NUMPY),
        *toolbox(arm, few, name, constant),
        Comparison(
            "the same with a UR10's field, standard deviation checked",
            f"{VARIABLE_FACTOR:g} times constant CEPs there",
            single["variable"],
            VARIABLE_FACTOR * single["constant"],
            1.0,
        ),
        Comparison("one waypoint from Python", "the 5 us allowed", single["one"], ONE_SECONDS, 1.0),
        Comparison(
            "one waypoint from Python, field and bounds",
            "the 5 us allowed",
            single["one_variable"],
            ONE_SECONDS,
        ),
    ]
    series = [
        Series(f"compensation, {words}", [f"{n} waypoints" for n in GROWTH], list(found["growth"].values()))
        for words, found in (("one thread", single), ("two threads", double))
    ]
    return Results("Compensation", comparisons, series, remarks())


def toolbox(arm, q, name, constant):
    """The comparison with roboticstoolbox, where it is installed."""
    if find_spec("roboticstoolbox") is None:
        return []
    peer, nominal = toolbox_arm(), PinocchioArm()
    targets = nominal.poses(q, np.zeros((len(q), 4, 4)))
    check(arm, q, "roboticstoolbox's", solved_by_toolbox(peer, targets, q))
    seconds = seconds_of(lambda: solved_by_toolbox(peer, targets, q), repeats=3) * WAYPOINTS / len(q)
    return [Comparison(name, "roboticstoolbox ik_LM (C++)", constant, seconds, TOOLBOX)]


def remarks():
    told = [
        "Waypoints are random, with elbow, shoulder and wrist bent. All search the joints at which an arm "
        f"with other parameters has the pose that the nominal arm has, to {SAME_M:g} m; loops were timed on "
        f"{LOOP_WAYPOINTS} waypoints and counted for all. The field was fitted to {measurements()[1]}; its "
        f"waypoints, and those of the constant CEPs beside it, lie within {AROUND_RAD:g} rad of measured "
        f"readings. With the field all bounds are on, as by default but for {LARGEST_STD_MM:g} mm of "
        "standard deviation; with constant CEPs none is, for the peers have none."
    ]
    if find_spec("roboticstoolbox") is None:
        told.append("roboticstoolbox is left out, as it is not installed: pip install --group bench-toolbox.")
    return told


def check(arm, q, name, found):
    """Raise ValueError unless joints put the true arm where ours put it."""
    apart = arm.poses(found, np.zeros((len(q), 4, 4))) - arm.poses(ours(q), np.zeros((len(q), 4, 4)))
    if np.abs(apart).max() > SAME_M:
        raise ValueError(f"{name} poses differ from ours by {np.abs(apart).max():.1e}")


def own_timings():
    """Our side, in as many threads as this process has."""
    constant, variable = compensator("constant"), compensator("variable")
    q = measured_readings(WAYPOINTS)
    if any(model.joints(q).refusals for model in (constant, variable)):
        raise ValueError("some waypoints are refused, so that not all of them would be timed")
    one = q[0]
    return {
        "growth": {str(n): _seconds(readings(n)) for n in GROWTH},
        "constant": _seconds(q),
        "variable": seconds_of(lambda: variable.joints(q)),
        "one": seconds_of(lambda: constant.correct(one)),
        "one_variable": seconds_of(lambda: variable.correct(one)),
    }


def _seconds(q):
    return seconds_of(lambda: ours(q))


if __name__ == "__main__":
    json.dump(own_timings(), sys.stdout)
