"""A fleet over two local workers against one: what a second worker saves."""

import json
import sys
import tempfile
from pathlib import Path

import truearm as ta
from benches.ours import measured_with_threads
from benches.timing import Comparison, Results, seconds_once
from truearm.fleet import Fleet, run_fleet
from truearm.simulation import VirtualArm

ARMS, POSES = 8, 120
TARGET = 1.6
HEAD = '[defaults]\nrobot = "ur10"\nmeasurements = "{arm}.csv"\nreport = false\n'


def seconds_with(workers):
    """Wall time of a fleet, the start of the workers included."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for seed in range(ARMS):
            arm = VirtualArm(ta.Robot.load("ur10"), seed=seed)
            arm.measure_table(arm.poses(POSES)).to_csv(folder / f"R{seed}.csv", index=False)
        arms = "".join(f'[[arm]]\nname = "R{seed}"\n' for seed in range(ARMS))
        fleet = Fleet.from_toml(HEAD + arms, folder=folder)
        seconds = seconds_once(lambda: run_fleet(fleet, folder / "out", workers=workers))
        results = sorted((folder / "out").glob("*/calibration.calib"))
        if len(results) != ARMS:
            raise ValueError(f"{len(results)} of {ARMS} arms were calibrated")
    return seconds


def run():
    """Compare one worker with two, and with one that has the same processors as threads."""
    one, two = seconds_with(1), seconds_with(2)
    threaded = measured_with_threads("fleet", 2)
    work = f"fleet of {ARMS} arms, {POSES} poses each, two workers"
    comparisons = [
        Comparison(work, "one worker", two, one, TARGET),
        Comparison("the same", "one worker with two threads", two, threaded, 1.0),
    ]
    remarks = [
        "Wall time of `truearm fleet` on variable models of a virtual UR10, start of the workers included, "
        "without reports. Workers have one thread each; results are the same bit for bit."
    ]
    return Results("Many arms", comparisons, remarks=remarks)


if __name__ == "__main__":
    json.dump(seconds_with(1), sys.stdout)
