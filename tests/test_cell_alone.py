"""An arm, and a table, are driven by one process at a time, whatever session that one writes."""

from unittest.mock import Mock, patch

import numpy as np
import pytest

from tests.cell_support import cell_text
from truearm.cell import Cell
from truearm.cell.alone import alone
from truearm.cell.measuring import Process
from truearm.cell.opening import open_session
from truearm.cell.poses_file import Poses
from truearm.cli import main
from truearm.errors import WorkError

POSES = Poses(np.random.default_rng(0).uniform(0.1, 0.5, (8, 6)), np.zeros(8, dtype=np.int64), ("",) * 8)


def text(tmp_path, *, arm="arm", table="table"):
    """A cell at addresses that no other test has, where nobody answers."""
    place = f"{tmp_path.name.replace('_', '-')}.invalid"
    robot = {"host": f"{arm}.{place}", "timeout_s": 0.1}
    return cell_text("ur", robot=robot, sensor={"port": f"tcp://{table}.{place}:1"})


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"table": "other"}, "UR at .*another process drives this arm"),
        ({"arm": "other"}, "drives this table"),
    ],
)
def test_a_second_process_does_not_drive_the_arm_of_another_session(other, message, tmp_path, monkeypatch):
    cell, connect = Cell.from_toml(text(tmp_path)), Mock()
    monkeypatch.setattr(cell.robot, "connect", connect)
    with (
        alone(Cell.from_toml(text(tmp_path, **other))),
        open_session(tmp_path / "session.db", cell, POSES) as session,
        pytest.raises(WorkError, match=message),
    ):
        Process(cell, session, lambda _: None).run()
    connect.assert_not_called()


def test_what_drives_an_arm_lets_go_of_it_and_leaves_others_alone(tmp_path, capsys):
    path = tmp_path / "cell.toml"
    path.write_text(text(tmp_path))
    cell, other = Cell.load(path), Cell.from_toml(text(tmp_path, arm="other", table="second"))
    with alone(cell), alone(other):
        assert main(["cell", "check", str(path)]) == 1
    assert "another process drives this arm" in capsys.readouterr().err
    assert main(["cell", "check", str(path)]) == 1
    assert "no connection" in capsys.readouterr().err


def test_recordings_are_played_side_by_side():
    cell = Cell.from_toml(cell_text("playback"))
    with patch("truearm.cell.alone.FileLock") as lock, alone(cell), alone(cell):
        lock.assert_not_called()
