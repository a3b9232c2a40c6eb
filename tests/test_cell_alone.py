"""An arm, and a table, are driven by one process at a time, whatever session that one writes."""

import socket
import tempfile
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


@pytest.mark.parametrize(
    ("robot", "table", "message"),
    [("localhost", "127.0.0.1", "drives this arm"), ("other.invalid", "LOCALHOST", "drives this table")],
)
def test_devices_are_known_under_each_name_of_their_host(
    robot, table, message, free_port, tmp_path, monkeypatch
):
    def at(robot, table):
        settings = {"host": robot, "realtime_port": free_port}
        return Cell.from_toml(
            cell_text("ur", robot=settings, sensor={"port": f"tcp://{table}:{free_port + 1}"})
        )

    with alone(at("127.0.0.1", "127.0.0.1")):
        monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
        with pytest.raises(WorkError, match=message), alone(at(robot, table)):
            pass


@pytest.fixture
def free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_serial_ports_are_known_under_each_of_their_names(tmp_path):
    port, name = tmp_path / "ttyS0", tmp_path / "by-id"
    port.touch()
    name.symlink_to(port)
    texts = [cell_text("rv-m2", robot={"port": str(robot)}) for robot in (port, name)]
    with (
        alone(Cell.from_toml(texts[0])),
        pytest.raises(WorkError, match="drives this arm"),
        alone(Cell.from_toml(texts[1])),
    ):
        pass


def test_recordings_are_played_side_by_side():
    cell = Cell.from_toml(cell_text("playback"))
    with patch("truearm.cell.alone.held") as lock, alone(cell), alone(cell):
        lock.assert_not_called()
