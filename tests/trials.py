"""What trials of the cell share: client processes against virtual devices, killed and interrupted.

Trials run in small with the tests, and in full with `make trials`, which also prints what they measured.
"""

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

from truearm.cell.session import Session

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
