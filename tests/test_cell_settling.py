"""The joints of a reading are those of the arm while it was measured, not those with which it arrived."""

import dataclasses
import json

import numpy as np
import pytest
import tomli_w

from tests.cell_support import cell_text, measured, poses_of, virtual
from tests.recorded import CELL, Recorded
from truearm.cell import Cell
from truearm.cell.measuring import DONE, Process
from truearm.cell.opening import open_session
from truearm.cell.playback import PlaybackRobot
from truearm.cell.session import Session
from truearm.files import parsed

LINE = {
    "driver": "line",
    "port": "tcp://127.0.0.1:1",
    "move": "MOVE " + " ".join(f"{{q{j}:.7f}}" for j in range(1, 7)),
    "where": "POS?",
    "joints": "^POS " + " ".join(rf"(?P<q{j}>\S+)" for j in range(1, 7)) + "$",
    "stop": "HALT",
}
# All is fast but the servo, which lags by 10 ms of a real clock; the instrument waits for five times as long.
SPEED, LAG_S = 100.0, 1.0
CHANGES = {
    "sensor": {"average": 1, "settle_s": 5.0 * LAG_S},
    "process": {"check_every": 0, "registration_poses": 4, "contacts": 1},
    "simulate": {"speed": SPEED, "servo_lag_s": LAG_S},
}


@pytest.mark.parametrize("robot", ["ur", "line"])
def test_joints_are_read_where_the_arm_has_settled(robot, tmp_path):
    content = parsed(cell_text("tracker", **CHANGES), where="tracker")
    content["robot"] = content["robot"] if robot == "ur" else LINE
    with virtual(tomli_w.dumps(content)) as (_, found):
        cell = Cell.from_toml(found)
        measured(found, poses_of(cell, 4, approach=[0, 1, -1, 0]), tmp_path / "session.db")
    with Session(tmp_path / "session.db", writing=False) as session:
        rows = session.rows("SELECT joints, s.readings FROM readings JOIN steps s USING (step)")
    told, settled = (np.array([json.loads(row[k]) for row in rows]) for k in (0, 1))
    assert len(rows) == 8
    np.testing.assert_allclose(told, settled, atol=5e-6)


class Creeping(PlaybackRobot):
    """Is `first` rad short of its place as it arrives, and half as far each time that it is asked."""

    first = 4e-3

    def move_joints(self, readings):
        super().move_joints(readings)
        self._short = self.first

    def read_joints(self):
        self._short = 0.5 * getattr(self, "_short", 0.0)
        return super().read_joints() - self._short


@pytest.mark.parametrize(("first", "moved"), [(0.0, 0), (2e-5, 0), (4e-3, 4)])
def test_an_arm_that_moves_while_it_is_measured_is_measured_again_where_it_stands(first, moved, tmp_path):
    recorded = Recorded(tmp_path)
    cell = Cell.from_toml(CELL.replace("FILE", str(tmp_path / "there.csv")))
    robot = Creeping(PlaybackRobot.Settings(), cell.arm)
    robot.first = first
    with open_session(recorded.session, cell, recorded.poses) as session:
        assert Process(dataclasses.replace(cell, robot=robot), session, lambda _: None).run() == DONE
        reasons = [reason for (reason,) in session.rows("SELECT reason FROM readings WHERE step = 0")]
        off = session.rows("SELECT joints, s.readings FROM readings JOIN steps s USING (step) WHERE valid")
        skipped = session.rows("SELECT step FROM outcomes WHERE outcome = 'skipped'")
    assert [reason.startswith("the arm moved by ") for reason in reasons] == [True] * moved + [False]
    assert skipped == []
    np.testing.assert_allclose([json.loads(a) for a, _ in off], [json.loads(b) for _, b in off], atol=3e-4)
