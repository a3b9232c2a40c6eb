"""Choice of poses against the same exchange in NumPy; regions against what is allowed."""

import json
import sys
from functools import cache
from typing import Any

import numpy as np

import truearm as ta
from benches.numpy_exchange import Exchange
from benches.ours import measured_with_threads
from benches.timing import Comparison, Results, seconds_of
from truearm import _core
from truearm.fits.identified import IdentifiedArm
from truearm.simulation import PAPER_PARAMETERS

CANDIDATES, CHOSEN, PASSES = 5000, 60, 20
REGIONS, POSES, TESTS, DRAWN = 110, 20, 10, 200
LOOKED_UP = 10_000
CHOICE_TARGET, CHOICE_SECONDS = 7.0, 6e-3
LOOK_UP_SECONDS, DIVISION_SECONDS = 50e-9, 2.0
SAME_DETERMINANT = 1e-6
NAMES = ("theta", "d", "a", "alpha", "beta")
ANGLE_ARM_M = 0.3
LOW, HIGH = np.deg2rad([[-150.0, -30.0, -120.0], [150.0, 100.0, 0.0]])


@cache
def pool():
    """Jacobians (N, 3, 27) of a UR10's candidates: the arm's, then frame and target; and their columns."""
    robot = ta.Robot.load("ur10")
    arm = IdentifiedArm(robot)
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (CANDIDATES, 6))
    rows = arm.flange_chain.parameter_jacobian(q)
    frames = arm.flange_chain.pose(q)
    points = frames[:, :3, 3]
    turned = np.cross(np.eye(3)[None], points[:, None]).transpose(0, 2, 1)
    shifted = np.broadcast_to(np.eye(3), (CANDIDATES, 3, 3))
    columns = [k for k in range(30) if k % 5 != 4 and k not in (0, 1, 6, 11, 26, 27)]
    every = np.concatenate([rows[:, :, columns], shifted, turned, frames[:, :3, :3]], axis=2)
    kinds = [*columns, 1, 1, 1, 0, 0, 0, 1, 1, 1]
    return np.ascontiguousarray(every), kinds


def choose():
    jacobian, columns = pool()
    options: Any = {
        "columns": columns,
        "criterion": "d",
        "limit": None,
        "given": None,
        "start": None,
        "passes": PASSES,
    }
    return _core.choose_poses(jacobian, CHOSEN, options)


def scaled():
    jacobian, columns = pool()
    return jacobian / [1.0 if k % 5 in (1, 2) else ANGLE_ARM_M for k in columns]


class VirtualRvM2:
    """The paper's arm with errors of 0.4 mm and 0.05 deg, measured at the poses asked for."""

    def __init__(self):
        robot = ta.Robot.load("rv-m2")
        arm = IdentifiedArm(robot, "world")
        self.chain, self.table = arm.flange_chain, np.ascontiguousarray(arm.table)
        self.measured = arm.chain(robot.flange @ robot.tool)
        self.columns = [5 * int(name[-1]) + NAMES.index(name[:-1]) for name in PAPER_PARAMETERS]
        self.true = self.table.copy()
        for column in self.columns:
            self.true.flat[column] += 4e-4 if column % 5 in (1, 2) else np.deg2rad(0.05)
        point = np.asarray(robot.tool)[:3, 3]
        self.setup = _core.Setup(np.eye(4)[None], point[None, None], np.eye(3)[None], np.zeros((0, 3)))

    def candidates(self, low, high, count, seed):
        features = np.random.default_rng(seed).uniform(low, high, (count, 3))
        return np.hstack([features, np.zeros((count, 2))]), features

    def measure(self, q):
        arrays: Any = {
            "joints": q,
            "group": np.zeros(len(q), dtype=np.int64),
            "targets": self.measured.position(q, self.true)[:, None],
            "rotations": None,
            "sigma": np.zeros((len(q), 4)),
            "weight": np.ones(len(q)),
            "distances": [],
        }
        return _core.MeasurementSet(arrays)

    def divide(self):
        options: Any = {
            "low": LOW,
            "high": HIGH,
            "accuracy": 0.0,
            "regions": REGIONS,
            "halving": "longest",
            "order": "breadth",
            "poses": POSES,
            "limit": 2000.0,
            "seed": 0,
        }
        measuring: Any = {
            "candidates": DRAWN,
            "tests": TESTS,
            "criterion": "kappa",
            "passes": PASSES,
            "orientation": False,
        }
        arguments = (self.chain, self.columns, self.table, self.setup, self)
        return _core.divide(*arguments, options, measuring)


def run():
    """Compare, and check that both choose as well."""
    ours = measured_with_threads("planning", 1)
    peer_chosen = Exchange(scaled()).choose(CHOSEN, PASSES)
    check(peer_chosen)
    peer = seconds_of(lambda: Exchange(scaled()).choose(CHOSEN, PASSES), repeats=3)
    name = f"{CHOSEN} of {CANDIDATES} poses, 27 parameters"
    comparisons = [
        Comparison(name, "NumPy, rank-3 updates", ours["choice"], peer, CHOICE_TARGET),
        Comparison(name, "hand-written Rust, timed apart", ours["choice"], CHOICE_SECONDS),
        Comparison(
            f"region of a point among {REGIONS}",
            "the 50 ns allowed",
            ours["look_up"] / LOOKED_UP,
            LOOK_UP_SECONDS,
            1.0,
        ),
        Comparison(
            f"division into {REGIONS} regions of {POSES} poses",
            "the 2 s allowed",
            ours["division"],
            DIVISION_SECONDS,
            1.0,
        ),
    ]
    remarks = [
        f"The division chooses {POSES} of {DRAWN} candidates by condition number in all {2 * REGIONS - 1} "
        f"regions of the tree, measures a virtual RV-M2 there, and judges each region at {TESTS} test points."
    ]
    return Results("Choice of poses and regions", comparisons, [], remarks)


def check(peer_chosen):
    """Both exchanges end at the same determinant."""
    chosen = choose()
    jacobian, columns = pool()
    found = _core.observability(np.ascontiguousarray(jacobian[peer_chosen]), columns)
    difference = abs(found["log_det"] - chosen.after["log_det"])
    if difference > SAME_DETERMINANT:
        raise AssertionError(f"log det M^t M differs by {difference:g}")


def own_timings():
    """Our side, in as many threads as this process has."""
    arm = VirtualRvM2()
    regions = arm.divide().regions
    points = np.random.default_rng(1).uniform(LOW, HIGH, (LOOKED_UP, 3))
    return {
        "choice": seconds_of(choose),
        "look_up": seconds_of(lambda: regions.find(points)),
        "division": seconds_of(arm.divide, repeats=3),
    }


if __name__ == "__main__":
    json.dump(own_timings(), sys.stdout)
