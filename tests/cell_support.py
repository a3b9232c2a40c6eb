"""What tests of the cell share: a small virtual cell, poses that it can measure, a process over them."""

import contextlib
import time
from pathlib import Path

import numpy as np
import pandas as pd
import tomli_w

from truearm.cell.cell_file import Cell
from truearm.cell.examples import example
from truearm.cell.measuring import Process
from truearm.cell.opening import open_session
from truearm.cell.poses_file import Poses
from truearm.cell.prediction import Prediction
from truearm.cell.rehearsal import problem_of
from truearm.cell.session import Step
from truearm.cell.virtual.launch import VirtualCell
from truearm.files import parsed

SPEED = 200.0


def cell_text(name="rv-m2", **changes):
    """An example's text with a fast clock; `changes` are merged into its sections."""
    content = parsed(example(name), where=name)
    merge(content, {"simulate": {"speed": SPEED}, "process": {"registration_poses": 6, "stretch": 0}})
    merge(content, changes)
    return tomli_w.dumps(content)


def merge(content, changes):
    for key, value in changes.items():
        if isinstance(value, dict):
            merge(content.setdefault(key, {}), value)
        else:
            content[key] = value


def possible_readings(cell, count, seed=0):
    """Readings (count, N) that the cell can measure, in ascending order of height."""
    rng, prediction = np.random.default_rng(seed), Prediction(cell)
    low, high = np.clip(cell.arm.limits.T, -np.pi, np.pi)
    chosen: list[np.ndarray] = []
    while len(chosen) < count:
        readings = rng.uniform(low, high)
        if not problem_of(cell, prediction, Step(0, "pose", 0, "", 0, readings)):
            chosen.append(readings)
    found = np.array(chosen)
    return found[np.argsort(cell.targets_in_base(found)[:, 2])]


def poses_of(cell, count, seed=0, approach=None):
    readings = possible_readings(cell, count, seed)
    directions = np.zeros(count, dtype=np.int64) if approach is None else np.asarray(approach)
    return Poses(readings, directions, ("",) * count)


def write_poses(path, poses):
    columns = {f"q{j + 1}": column for j, column in enumerate(poses.readings.T)}
    pd.DataFrame(columns | {"approach": poses.approach}).to_csv(path, index=False)


@contextlib.contextmanager
def virtual(text):
    """The devices of a cell as threads; gives the virtual cell and the cell file's text to measure with."""
    with VirtualCell(text, processes=False) as cell:
        yield cell, cell.cell_toml()


def measured(text, poses, path, reports=None):
    """Run a process to its end; how it ended, and how long it took."""
    cell, began = Cell.from_toml(text), time.monotonic()
    with open_session(Path(path), cell, poses) as session:
        end = Process(cell, session, (reports if reports is not None else []).append).run()
    return end, time.monotonic() - began
