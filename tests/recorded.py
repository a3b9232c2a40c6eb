"""Sessions over a recording instead of devices: ended and gone on with, with other recordings too."""

from contextlib import contextmanager

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm.cell import Cell
from truearm.cell.measuring import Process
from truearm.cell.opening import open_session
from truearm.cell.poses_file import Poses
from truearm.cell.session import Session
from truearm.simulation import VirtualArm

COUNT = 20
CELL = """
name = "recorded"
arm = "ur10e"
robot = { driver = "playback" }
sensor = { driver = "playback", file = "FILE" }
[process]
contacts = 1
stretch = 0
registration_mm = 300
"""


class KilledError(Exception):
    """What ends a process in the middle."""


class Recorded:
    """A recording of an arm, and one of the same with the instrument 20 mm elsewhere."""

    def __init__(self, folder):
        self.folder, self.session = folder, folder / "session.db"
        arm = VirtualArm(ta.Robot.load("ur10e"), seed=1)
        self.poses = Poses(arm.poses(COUNT), np.zeros(COUNT, dtype=np.int64), ("",) * COUNT)
        table = arm.measure_table(self.poses.readings)
        table.to_csv(folder / "there.csv", index=False)
        table.assign(x=table["x"] + 0.02).to_csv(folder / "moved.csv", index=False)

    def measure(self, recording="there", *, until="", text=CELL):
        """Measure until something is told, or to the end; what was told, and how it ended."""
        told: list[str] = []

        def tell(progress):
            told.append(progress.text)
            if until and progress.text.startswith(until):
                raise KilledError

        cell = Cell.from_toml(text.replace("FILE", str(self.folder / f"{recording}.csv")))
        with open_session(self.session, cell, self.poses) as session:
            end = Process(cell, session, tell).run()
        return told, end

    def killed(self, recording="there", **options):
        with pytest.raises(KilledError):
            self.measure(recording, **options)

    def without(self, poses):
        """A recording that lacks some poses."""
        table = pd.read_csv(self.folder / "there.csv")
        table.drop(index=poses).to_csv(self.folder / "without.csv", index=False)

    @contextmanager
    def read(self):
        with Session(self.session, writing=False) as session:
            yield session
