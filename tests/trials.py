"""What trials of the cell share: client processes against virtual devices, killed and interrupted.

Trials run in small with the tests, and in full with `make trials`, which also prints what they measured.
"""

import contextlib
import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd

import truearm as ta
from truearm.cell import Cell, line_port
from truearm.cell.accepted import accepted_table, measurements_of, moved_poses
from truearm.cell.device_errors import silent
from truearm.cell.line_port import LinePort
from truearm.cell.session import Session
from truearm.cell.summary import summary_of

FULL = os.environ.get("TRUEARM_TRIALS") == "full"
RESULTS = Path(os.environ.get("TRUEARM_TRIALS_RESULTS", "build/trials"))
PROGRAM = str(Path(sys.executable).parent / "truearm")
STARTS_WITHIN_S = 60.0


def sized(small, full):
    return full if FULL else small


def say(text):
    """A line of the report that `make trials` prints."""
    if FULL:
        sys.stderr.write(f"\n  {text}\n")
        sys.stderr.flush()


def record(trial, **figures):
    """Keep what a trial in full measured, for docs/make_trials.py."""
    say(f"{trial}: {figures}")
    if FULL:
        RESULTS.mkdir(parents=True, exist_ok=True)
        (RESULTS / f"{trial}.json").write_text(json.dumps(figures, indent=1) + "\n")


@contextlib.contextmanager
def simulated(folder, text, *options):
    """The virtual cell of a text in processes of its own; gives the path of the cell file to measure with."""
    cell, virtual = folder / "cell.toml", folder / "virtual.toml"
    cell.write_text(text)
    virtual.unlink(missing_ok=True)
    command = [PROGRAM, "cell", "simulate", str(cell), "-o", str(virtual), *options]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            wait_for(virtual.exists)
            yield virtual
        finally:
            process.send_signal(signal.SIGINT)
            process.wait()


def wait_for(condition, within_s=STARTS_WITHIN_S):
    until = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < until, "it did not happen in time"
        time.sleep(0.01)


def measuring(cell, poses, session, **options):
    """A `truearm measure` process."""
    command = [PROGRAM, "measure", str(cell), str(poses), "-o", str(session)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def acknowledged(lines):
    """Steps that a process said were stored, by kind and pose."""
    stored = []
    for line in lines.splitlines():
        head, _, rest = line.partition(": ")
        if " stored, " in rest and "/" in head:
            kind, pose = rest.split()[:2]
            stored.append((kind, int(pose) - 1))
    return stored


def outcomes(session):
    """Kind and pose of every measured step of a session file."""
    with Session(session, writing=False) as known:
        return known.rows(
            "SELECT kind, pose FROM outcomes JOIN steps USING (step) WHERE outcome = 'measured'"
        )


def killed_after(process, seconds, *, once_it_measures):
    """Kill a process without warning, a time after its start or its first word; what it said on stderr."""
    first = process.stderr.readline() if once_it_measures else ""
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(seconds)
    process.kill()
    return first + process.communicate()[1]


def moments(count, longest_s, seed=0):
    """Random times, evenly spread."""
    source = random.Random(seed)
    return [longest_s * (k + source.random()) / count for k in source.sample(range(count), count)]


def finished(session):
    with Session(session, writing=False) as known:
        return accepted_table(known), measurements_of(known), summary_of(known)


def accepted(path):
    """Accepted points of a session by pose (x, y, z), m; without those while something moved."""
    with Session(path, writing=False) as known:
        table = accepted_table(known)
        if table.empty:
            return pd.DataFrame(columns=list("xyz"))
        return table[~table["pose"].isin(moved_poses(known, table))].set_index("pose")[list("xyz")]


def apart_mm(path, clean_path):
    """How far the accepted points of two sessions are apart, pose by pose."""
    both = accepted(path).join(accepted(clean_path).add_suffix("_clean"), how="inner")
    apart = both[["x", "y", "z"]].to_numpy(float) - both[["x_clean", "y_clean", "z_clean"]].to_numpy(float)
    return 1e3 * np.linalg.norm(apart, axis=1)


def remarks_of(path):
    with Session(path, writing=False) as known:
        return sum(summary_of(known)["events"].values())


def calibrated(text, data):
    """Where a calibration of the measurements has the target at their readings (n, 3), m."""
    calibration = ta.calibrate(Cell.from_toml(text).arm, data, model="constant")
    return calibration.position(data.readings, group=calibration.groups[0], target=1)


class Wires:
    """Counts what the drivers send, and the answers that did not come in time, without faults and with them.

    Attributes:
        more: How much more that is with faults.
    """

    def __init__(self, monkeypatch):
        self.more = {"sent_again": 0, "too_late": 0}
        self._share = 1
        send, late = LinePort.send, silent

        def sending(port, *texts):
            self.more["sent_again"] += self._share
            send(port, *texts)

        def missing(*told, **words):
            self.more["too_late"] += self._share
            return late(*told, **words)

        monkeypatch.setattr(LinePort, "send", sending)
        monkeypatch.setattr(line_port, "silent", missing)

    @contextlib.contextmanager
    def without_faults(self):
        self._share = -1
        yield
        self._share = 1


def heads_for(world, readings):
    """Whether the arm is on its way to a place, rad."""
    with_end = world.arm.at(world.arm.ends())
    return bool(world.arm.speed(world.shared.now()).any()) and np.allclose(with_end, readings)


def assert_stands(world):
    """The arm neither moves nor begins to."""
    motions = world.arm.ends()
    time.sleep(0.2)
    assert not world.arm.speed(world.shared.now()).any()
    assert world.arm.ends() == motions


def growth_of(used):
    """Milliseconds a pose of the process itself and of the system for it; memory grown, and in all, MB."""
    first, last = np.array(used[len(used) // 4]), np.array(used[-1])
    poses, process, system, grown = (last - first).tolist()
    milliseconds = {"process_ms_a_pose": 1e3 * process / poses, "system_ms_a_pose": 1e3 * system / poses}
    return milliseconds, grown, float(last[-1])


def memory_mb():
    """Resident memory now, where the system tells it, else the most so far."""
    pages = Path("/proc/self/statm")
    if pages.exists():
        return int(pages.read_text().split()[1]) * resource.getpagesize() / 1e6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
