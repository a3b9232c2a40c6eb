"""The variable model, against scikit-learn's Gaussian process on the same residuals."""

import json
import sys
import warnings
from functools import cache, partial
from pathlib import Path
from statistics import median

import numpy as np

import truearm as ta
from benches.ours import measured_with_threads
from benches.timing import Comparison, Results, Series, seconds_of, seconds_once
from truearm.rows.splitting import SplitRule, split_rows
from truearm.simulation import VirtualArm

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data" / "ur10_ipa_C.csv"
TRAINING = 400
EVALUATED = 10_000
GROWTH = (100, 300, 1000, 3000, 10_000)
EVALUATION_TARGET, FIT_TARGET, FIT_SECONDS = 50.0, 1.0, 20.0
RESTARTS, FITS = 2, 3
SEED = 7


@cache
def measurements():
    """A UR10 that was measured, where its data is at hand; else a virtual one."""
    if SHARED.exists():
        return ta.Measurements.read_csv(SHARED), "the public measurements ur10_ipa_C.csv"
    return virtual(1400), "a virtual UR10"


@cache
def virtual(poses):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1)
    return arm.measure(arm.poses(poses))


def calibrate(data, poses, model="variable"):
    """A calibration from so many poses, as the command line makes it."""
    robot = ta.Robot.load("ur10")
    options = {"use": "position", "seed": SEED, "train_size": poses, "model": model, "refit": False}
    return ta.calibrate(robot, data, **options)


def readings(poses):
    return np.random.default_rng(0).uniform(-2.5, 2.5, (poses, 6))


def gaussian_process():
    """Anisotropic kernel and noise, one model for the three coordinates."""
    from sklearn.gaussian_process import GaussianProcessRegressor  # noqa: PLC0415 - our own process does without
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel  # noqa: PLC0415 - as above

    kernel = ConstantKernel(1.0) * RBF(np.ones(6), (0.05, 100.0)) + WhiteKernel(0.1)
    return GaussianProcessRegressor(kernel, n_restarts_optimizer=RESTARTS, normalize_y=True, random_state=0)


def training_residuals():
    """Readings and what the constant model leaves at them, m: the peer learns from the same rows."""
    data, _ = measurements()
    rows = split_rows(data, SplitRule(seed=SEED, train_size=TRAINING)).train
    constant = calibrate(data, TRAINING, model="constant")
    q = data.readings[rows]
    return q, data.targets[rows, 0] - constant.position(q, group=data.groups[0], target=1)


def fitted_process(q, residuals):
    """The peer's fit and the time it took."""
    process = gaussian_process()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # length scales at their bounds are what an idle joint gives
        seconds = median(seconds_once(lambda: process.fit(q, residuals)) for _ in range(FITS))
    return process, seconds


def run():
    """Compare evaluation and fit, and show how both grow."""
    single, double = (measured_with_threads("field", threads) for threads in (1, 2))
    process, peer_fit = fitted_process(*training_residuals())
    q = readings(EVALUATED)
    peer = seconds_of(lambda: process.predict(q), repeats=3)
    name = f"variable fit, {TRAINING} poses"
    comparisons = [
        Comparison(
            f"field at {EVALUATED} poses",
            "GaussianProcessRegressor",
            single["field"],
            peer,
            EVALUATION_TARGET,
        ),
        Comparison(name, "GaussianProcessRegressor", single["fit"], peer_fit, FIT_TARGET),
        Comparison(f"{name}, two threads", f"the {FIT_SECONDS:g} s allowed", double["fit"], FIT_SECONDS, 1.0),
    ]
    series = [
        Series(
            f"variable fit, {words}",
            [f"{n} poses" for n in GROWTH],
            [found["growth"][str(n)] for n in GROWTH],
        )
        for words, found in (("one thread", single), ("two threads", double))
    ]
    remarks = [
        f"Fitted to {measurements()[1]}, {TRAINING} training rows; the growth with poses to a virtual UR10. "
        "The peer learns what the constant model leaves, with an anisotropic kernel, noise, and "
        f"{RESTARTS} restarts; ours is for constants, hyper-parameters, field and set-up, with validation, "
        "and begins with a rough fit that shows how the set-up drifted."
    ]
    return Results("Variable calibration", comparisons, series, remarks)


def own_timings():
    """Our side, in as many threads as this process has."""
    data, _ = measurements()
    found = []
    fit = median(seconds_once(lambda: found.append(calibrate(data, TRAINING))) for _ in range(FITS))
    q = readings(EVALUATED)
    field = seconds_of(lambda: found[0].parameters(q))
    grown = virtual(int(max(GROWTH) / 0.7) + 1)
    growth = {poses: seconds_once(partial(calibrate, grown, poses)) for poses in GROWTH}
    return {"field": field, "fit": fit, "growth": growth}


if __name__ == "__main__":
    json.dump(own_timings(), sys.stdout)
