"""Updates, acceptance poses and proposed poses on virtual arms whose truth is known, and on public data.

    python -m benches.updating OUT [--seeds N] [--data DIR]
    python docs/make_updating.py OUT

Writes OUT/CASE-ARM-SEED.json; what is there is not run again.
"""

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import truearm as ta
from tests.remastered import remastered
from truearm.proposing import Candidates, acceptance_poses, next_poses
from truearm.simulation import VirtualArm

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
ARMS = {"rv-m2": 60, "ur10": 80}
FRESH = 400
UPDATED_WITH = 15
ACCEPTED_WITH = 10
SMALL_DEG = 0.03
UNCHANGED = 3
UNCHANGED_ARMS = {"rv-m2": 25, "ur10": 8}
START, ADDED = {"rv-m2": 40, "ur10": 60}, 20
CANDIDATES, WORKSPACE = 300, 200
REAL = (("A", "B"), ("A", "C"), ("B", "C"), ("C", "B"))
REAL_TRAIN = 400


@dataclass(frozen=True, eq=False)
class Known:
    """A virtual arm and its calibration."""

    arm: VirtualArm
    calibration: ta.Calibration
    table: pd.DataFrame

    @classmethod
    def of(cls, name: str, seed: int, poses: int) -> "Known":
        """That of a seed."""
        arm = VirtualArm.paper(seed=seed) if name == "rv-m2" else VirtualArm(ta.Robot.load(name), seed=seed)
        table = arm.measure_table(arm.poses(poses, seed=1), seed=1)
        return cls(arm, ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table)), table)

    def error_mm(self, calibration: ta.Calibration, shift: np.ndarray, tool_mm: np.ndarray) -> float:
        """Mean error, without noise, at fresh poses of an arm that was re-mastered, in the same set-up."""
        exact = self.arm.imperfections
        self.arm.imperfections = replace(exact, noise_mm=0.0)
        fresh = remastered(self.arm, self.arm.poses(FRESH, seed=50), shift, seed=50, tool_mm=tool_mm)
        self.arm.imperfections = exact
        return ta.evaluate(calibration, fresh, keep_frames=True).errors["variable"].position.mean


def updates(name: str, seed: int) -> dict[str, Any]:
    """Three re-masterings."""
    known = Known.of(name, seed, ARMS[name])
    arm, calibration = known.arm, known.calibration
    still, none = np.zeros(arm.robot.joint_count), np.zeros(3)
    found: dict[str, Any] = {"own_mm": known.error_mm(calibration, still, none), "moved": []}
    for k in range(3):
        rng = np.random.default_rng([seed, k])
        which = rng.permutation(arm.robot.joint_count)[: rng.integers(2, 5)]
        shift = still.copy()
        shift[which] = rng.uniform(0.1, 1.0, len(which)) * rng.choice([-1.0, 1.0], len(which))
        tool = rng.normal(size=3)
        tool /= np.linalg.norm(tool)
        poses = arm.poses(UPDATED_WITH, seed=10 + k)
        told = ta.update(calibration, remastered(arm, poses, shift, seed=10 + k, tool_mm=tool))
        ratios = [
            (entry.change - truth) / entry.std
            for entry, truth in zip(told.offsets, shift, strict=True)
            if entry.std is not None
        ]
        found["moved"].append(
            {
                "verdict": told.verdict,
                "old_mm": known.error_mm(calibration, shift, tool),
                "updated_mm": known.error_mm(told.calibration, shift, tool),
                "left_out_mm": told.after.position.mean,
                "ratios": ratios,
            }
        )
    return found


def unchanged(name: str, seed: int) -> dict[str, Any]:
    """Probabilities that three updates of an arm that did not change give it."""
    known = Known.of(name, seed, ARMS[name])
    calibration = replace(known.calibration, file=b"not rolled back")
    arm, found = known.arm, []
    for k in range(UNCHANGED):
        told = ta.update(calibration, arm.measure(arm.poses(UPDATED_WITH, seed=30 + k), seed=30 + k))
        found.append([told.changed.p, told.rest.p])
    return {"p": found}


def acceptance(name: str, seed: int) -> dict[str, Any]:
    """How often a small change of one joint is noticed with acceptance poses, and with random ones."""
    known = Known.of(name, seed, ARMS[name])
    arm = known.arm
    pool = arm.poses(CANDIDATES, seed=2)
    chosen = acceptance_poses(Candidates(known.calibration, pool), ACCEPTED_WITH)
    found: dict[str, Any] = {"noticed": chosen.noticed, "chosen": [], "random": []}
    for joint in range(1, arm.robot.joint_count - 1):
        shift = np.zeros(arm.robot.joint_count)
        shift[joint] = SMALL_DEG
        drawn = np.random.default_rng([seed, joint]).permutation(CANDIDATES)[:ACCEPTED_WITH]
        for kind, rows in (("chosen", chosen.rows), ("random", drawn)):
            told = ta.update(known.calibration, remastered(arm, pool[rows], shift, seed=60 + joint))
            found[kind].append([told.verdict != "holds", told.offsets[joint].std])
    return found


def added(name: str, seed: int) -> dict[str, Any]:
    """Error after twenty proposed poses, and after twenty random ones from the same candidates."""
    known = Known.of(name, seed, START[name])
    arm = known.arm
    still, none = np.zeros(arm.robot.joint_count), np.zeros(3)
    pool, workspace = arm.poses(CANDIDATES, seed=2), arm.poses(WORKSPACE, seed=3)
    chosen = next_poses(Candidates(known.calibration, pool), workspace, ADDED)

    def with_rows(rows: np.ndarray) -> float:
        table = pd.concat([known.table, arm.measure_table(pool[rows], seed=4)], ignore_index=True)
        more = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table))
        return known.error_mm(more, still, none)

    drawn = [np.random.default_rng([seed, k]).permutation(CANDIDATES)[:ADDED] for k in range(3)]
    return {
        "before_mm": known.error_mm(known.calibration, still, none),
        "proposed_mm": with_rows(chosen.rows),
        "random_mm": [with_rows(rows) for rows in drawn],
        "expected_mm": [float(chosen.expected_mm[0]), float(chosen.expected_mm[-1])],
    }


def real(data: Path, one: str, other: str) -> dict[str, Any]:
    """Updates of a UR10's calibration of one set-up with rows of another."""
    robot = ta.Robot.load("ur10")
    read = {key: ta.Measurements.read_csv(data / f"ur10_ipa_{key}.csv") for key in (one, other)}
    calibration = ta.calibrate(robot, read[one], use="position", train_size=REAL_TRAIN, refit=False)
    rng = np.random.default_rng(7)
    order = rng.permutation(len(read[other]))
    few, rest = read[other].select(order[:UPDATED_WITH]), read[other].select(order[UPDATED_WITH:1500])
    told = ta.update(calibration, few, use="position", new_tool=True)
    judge = ta.EvaluationOptions(use="position", frame_rows=200)
    return {
        "told": told.to_dict(),
        "old_mm": ta.evaluate(calibration, rest, judge).errors["variable"].position.mean,
        "updated_mm": ta.evaluate(told.calibration, rest, judge).errors["variable"].position.mean,
    }


def main() -> int:
    """Run what is missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--only", default="", help="cases whose names begin so")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    cases: list[tuple[str, Callable[[], dict[str, Any]]]] = []
    for seed in range(given.seeds):
        for arm in ARMS:
            for case in (updates, acceptance, added):
                cases += [(f"{case.__name__}-{arm}-{seed}", partial(case, arm, seed))]
    for arm, count in UNCHANGED_ARMS.items():
        cases += [(f"unchanged-{arm}-{seed}", partial(unchanged, arm, seed)) for seed in range(count)]
    for one, other in REAL if given.data.is_dir() else ():
        cases += [(f"real-{one}-{other}", partial(real, given.data, one, other))]
    for name, work in cases:
        target = given.out / f"{name}.json"
        if target.exists() or not name.startswith(given.only):
            continue
        target.write_text(json.dumps(work()) + "\n")
        sys.stderr.write(f"{target}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
