"""Cell files, lists of poses and session files: what is wrong with them is said in words."""

import contextlib
import re
import sqlite3

import numpy as np
import pytest

from tests.cell_support import cell_text, poses_of, write_poses
from truearm.cell import Cell
from truearm.cell.cell_file import FaultsSection
from truearm.cell.drivers import ROBOTS, driver_and_settings
from truearm.cell.examples import EXAMPLES, example
from truearm.cell.motion import Motion
from truearm.cell.opening import open_session
from truearm.cell.poses_file import Poses
from truearm.cell.sequence import steps_of
from truearm.cell.session import Session, Step
from truearm.cli.cell_simulate import FAULTS
from truearm.errors import InputError, WorkError
from truearm.planning import ClearOfItself
from truearm.robot import Robot
from truearm.rotations import transform_from_parts


@pytest.fixture(scope="module")
def cell():
    return Cell.from_toml(cell_text())


@pytest.fixture(scope="module")
def poses(cell):
    return poses_of(cell, 8)


def test_links_may_meet_where_the_cell_says_they_have_no_thickness():
    cell = Cell.from_toml(cell_text() + "\n[clearance]\nlink_radius_mm = 0\n")
    motion = Motion.of(cell.arm, cell, [], [cell.flange_from_target], None)
    assert not any(isinstance(rule, ClearOfItself) for rule in motion.rules)


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_are_cells(name):
    assert Cell.from_toml(example(name)).file.name


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("[robot]", "[robt]", 'unknown key "robt". Did you mean "robot"'),
        ('driver = "rv-m2"', 'driver = "rvm2"', 'there is no driver "rvm2".*Did you mean "rv-m2"'),
        ('driver = "rv-m2"', "", 'key "driver" is missing'),
        ('driver = "rv-m2"', 'driver = "nowhere.to:Find"', "cannot be imported"),
        ('driver = "rv-m2"', 'driver = "truearm.robot:Robot"', "has no class Settings"),
        ('port = "/dev/ttyS0"', "", 'robot: key "port" is missing'),
        ('port = "/dev/ttyS0"', 'port = "/dev/ttyS0"\nspeed = 12', "robot, speed: 12 cannot be used"),
        ('port = "/dev/ttyS0"', 'port = "/dev/ttyS0"\nbaud = "9600"', "robot, baud: '9600' cannot be used"),
        ('port = "/dev/ttyS0"', 'prt = "/dev/ttyS0"', 'unknown key "prt". Did you mean "port"'),
        ("expected_mm = 4", "expected_mm = -4", "process, expected_mm: -4 cannot be used"),
        ("expected_mm = 4", 'expected_mm = "four"', "Must be a number"),
        ("expected_mm = 4", "contacs = 4", 'Did you mean "contacts"'),
        ("xyz_mm = [400, -250, -100]", "xyz_mm = [400, -250]", r"xyz_mm: \[400, -250\] .* have 3 values"),
        ("xyz_mm = [400, -250, -100]", "xyz_mm = [4, 5, 6, 7]", "world, xyz_mm: .* It must have 3 values"),
        ("expected_mm = 4", 'expected_mm = "4"', "expected_mm: '4' cannot be used. Must be a number"),
        ("expected_mm = 4", "together = 1", "process, together: 1 cannot be used. Must be true or false"),
        ("expected_mm = 4", "expected_mm = 2020-01-01", "expected_mm: .* Must be a number"),
        ("expected_mm = 4", 'model = "varable"', "Either constant or variable.*Did you mean"),
        ("uncertain_mm = 6", "quaternion_wxyz = [1, 1, 0, 0]", "length 1.41421, must be 1"),
        ('arm = "rv-m2"', 'arm = "rv-m3"', "rv-m2"),
        ('arm = "rv-m2"', 'arm = "ur10"', "five turning joints"),
        ("[world]", "[world", "not TOML"),
        ("seed = 1", "seed = 1\n[simulate.faults]\nlost = 2", "faults, lost: 2"),
        ('port = "/dev/ttyS1"', 'port = "/dev/ttyS1"\npanel = { u = "+z" }', "along the same axis"),
    ],
)
def test_a_wrong_cell_file_is_told(before, after, message):
    text = example("rv-m2")
    assert before in text
    with pytest.raises(InputError, match=message):
        Cell.from_toml(text.replace(before, after, 1), where="cell.toml")


@pytest.mark.parametrize("frame", ["X8N1", "98N15", "8N3"])
def test_a_frame_is_bits_parity_and_stop_bits_and_no_more(frame):
    text = example("rv-m2").replace('port = "/dev/ttyS0"', f'port = "/dev/ttyS0"\nframe = "{frame}"', 1)
    with pytest.raises(InputError, match="robot, frame"):
        Cell.from_toml(text)


def test_a_driver_of_ones_own_may_lie_beside_the_cell_file(tmp_path):
    (tmp_path / "lying_beside.py").write_text(
        "from truearm.cell.playback import PlaybackRobot\n\nclass Own(PlaybackRobot): ...\n"
    )
    section = {"driver": "lying_beside:Own"}
    with pytest.raises(InputError, match=r"cannot be imported.*installed, on PYTHONPATH or in"):
        driver_and_settings(section, ROBOTS, where="cell.toml, robot", folder=tmp_path / "elsewhere")
    found, settings = driver_and_settings(section, ROBOTS, where="cell.toml, robot", folder=tmp_path)
    assert (found.__name__, settings.model_dump()) == ("Own", section)


def test_a_driver_that_cannot_be_read_is_an_error_with_words(tmp_path):
    (tmp_path / "broken_driver.py").write_text("class Own(:\n")
    for name in ("broken_driver:Own", ":Own"):
        with pytest.raises(InputError, match="cannot be imported: (SyntaxError|ValueError)"):
            driver_and_settings({"driver": name}, ROBOTS, where="cell.toml, robot", folder=tmp_path)


def test_a_driver_that_cannot_be_made_is_an_error_with_words(tmp_path, monkeypatch):
    (tmp_path / "unmade_driver.py").write_text(
        "from truearm.cell.rv_m2 import RvM2\n\nclass Own(RvM2):\n    def __init__(self, settings): ...\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    text = example("rv-m2").replace('driver = "rv-m2"', 'driver = "unmade_driver:Own"', 1)
    with pytest.raises(InputError, match=r"cell.toml: Own cannot be made: TypeError: .*Settings and the arm"):
        Cell.from_toml(text, where="cell.toml")


def test_patterns_need_their_groups():
    text = example("tracker").replace("(?P<z>", "(?P<h>")
    with pytest.raises(InputError, match=r"no group \(\?P<z>"):
        Cell.from_toml(text)


def test_poses_read_back(tmp_path, poses):
    write_poses(tmp_path / "poses.csv", poses)
    read = Poses.read_csv(tmp_path / "poses.csv", Robot.load("rv-m2"))
    np.testing.assert_allclose(read.readings, poses.readings, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("q1_deg,q2_deg\n1,2\n", "there are 2 joint columns"),
        ("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg\n0,0,20,0,0\n", "row 1 beyond the joint limits"),
        (
            "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,approach\n0,0,-20,0,0,2\n",
            'column "approach" holds 2 in row 1',
        ),
        ("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg\n0,0,x,0,0\n", 'holds "x" in row 1'),
        ("a,b\n1,2\n", "no joint columns"),
    ],
)
def test_a_wrong_list_of_poses_is_told(text, message, tmp_path):
    path = tmp_path / "poses.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        Poses.read_csv(path, Robot.load("rv-m2"))


def test_registration_comes_first_and_checks_repeat_its_first_contact(cell, poses):
    process = cell.file.process.model_copy(update={"check_every": 3, "registration_poses": 4})
    steps = steps_of(poses, process)
    assert [step.kind for step in steps[:4]] == ["registration"] * 4
    assert [step.pose for step in steps if step.kind == "pose"] == list(range(8))
    assert {step.pose for step in steps if step.kind == "check"} == {steps[0].pose}
    assert [step.kind for step in steps].count("check") == 3
    with pytest.raises(InputError, match="Registration needs 9"):
        steps_of(poses, process.model_copy(update={"registration_poses": 9}))


def test_the_frame_is_registered_from_different_poses(cell, poses):
    process = cell.file.process.model_copy(update={"registration_poses": 8})
    twice = Poses(np.repeat(poses.readings, 2, axis=0), np.tile([1, -1], 8), ("",) * 16)
    steps = [step for step in steps_of(twice, process) if step.kind == "registration"]
    assert len(np.unique([step.readings for step in steps], axis=0)) == len(steps) == 8
    with pytest.raises(InputError, match="the list has 8 different poses.*Registration needs 9"):
        steps_of(twice, process.model_copy(update={"registration_poses": 9}))


def test_a_session_belongs_to_its_arm_and_poses(cell, poses, tmp_path):
    path = tmp_path / "session.db"
    open_session(path, cell, poses).close()
    other = Poses(poses.readings[::-1].copy(), poses.approach, poses.purpose)
    with pytest.raises(InputError, match="another list of poses"):
        open_session(path, cell, other)
    moved = Cell.from_toml(cell_text(target={"in_flange_mm": [1, 2, 3]}))
    with pytest.raises(InputError, match="another target"):
        open_session(path, moved, poses)
    open_session(path, cell, poses).close()


def test_one_process_writes_and_any_reads(cell, poses, tmp_path):
    path = tmp_path / "session.db"
    with open_session(path, cell, poses):
        with pytest.raises(WorkError, match="another process"):
            open_session(path, cell, poses)
        with Session(path, writing=False) as reader:
            step = reader.next_step()
            assert step is not None
            assert step.step == 0
    open_session(path, cell, poses).close()


def test_of_two_processes_that_begin_a_session_one_has_it(tmp_path):
    path = tmp_path / "session.db"
    steps = [Step(0, "pose", 0, "", 0, np.zeros(5))]
    with Session.create(path, steps, {"who": "first"}) as first:
        with pytest.raises(WorkError, match="another process is measuring into this session"):
            Session.create(path, steps, {"who": "second"})
        first.add_event("remark", "still here")
    with pytest.raises(WorkError, match="another process has made this session meanwhile"):
        Session.create(path, steps, {"who": "third"})
    with Session(path, writing=True) as known:
        assert known.meta("who") == "first"
        assert known.rows("SELECT message FROM events") == [("still here",)]
    assert {place.name for place in tmp_path.iterdir()} <= {"session.db", "session.db.lock"}


def test_a_link_to_a_session_is_that_session(cell, poses, tmp_path):
    path, link = tmp_path / "session.db", tmp_path / "link.db"
    link.symlink_to(path)
    with open_session(link, cell, poses), pytest.raises(WorkError, match="another process"):
        open_session(path, cell, poses)
    assert link.is_symlink()
    with open_session(path, cell, poses), pytest.raises(WorkError, match="another process"):
        open_session(link, cell, poses)
    assert not (tmp_path / "link.db.lock").exists()


def test_a_full_disk_is_one_line_and_what_was_stored_stays(cell, poses, tmp_path):
    path = tmp_path / "session.db"
    with open_session(path, cell, poses) as session:
        session.add_event("remark", "before")
        pages = session.rows("PRAGMA page_count")[0][0]
        session.rows(f"PRAGMA max_page_count = {pages}")
        with (
            pytest.raises(WorkError, match=r"session\.db: the session cannot be written: .*full"),
            session.together(),
        ):
            session.add_event("remark", "x" * 100_000)
        session.add_event("stopped", "after what could not be written")
    with open_session(path, cell, poses) as session:
        assert session.rows("SELECT message FROM events") == [("before",)]


def test_a_session_that_cannot_be_begun_leaves_nothing(cell, poses, tmp_path, monkeypatch):
    def full(*_, **__):
        raise sqlite3.OperationalError("database or disk is full")

    monkeypatch.setattr("truearm.cell.session.json.dumps", full)
    with pytest.raises(InputError, match=r"session\.db: cannot be written: database or disk is full"):
        open_session(tmp_path / "session.db", cell, poses)
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_session_is_told(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        Session(tmp_path / "none.db", writing=False)
    (tmp_path / "text.db").write_text("hello")
    with pytest.raises(InputError, match="this is no session file"):
        Session(tmp_path / "text.db", writing=False)
    with sqlite3.connect(tmp_path / "other.db") as other:
        other.execute("CREATE TABLE things (a)")
    other.close()
    with pytest.raises(InputError, match="no session file"):
        Session(tmp_path / "other.db", writing=False)
    with pytest.raises(InputError, match="no such directory"):
        open_session(
            tmp_path / "none" / "s.db", Cell.from_toml(cell_text()), poses_of(Cell.from_toml(cell_text()), 8)
        )


def test_a_database_of_somebody_else_is_left_as_it_is(tmp_path):
    path = tmp_path / "accounts.db"
    with contextlib.closing(sqlite3.connect(path)) as other:
        other.execute("CREATE TABLE accounts (name TEXT)")
        other.commit()
    before = path.read_bytes()
    for writing in (True, False):
        with pytest.raises(InputError, match="this is no session file"):
            Session(path, writing=writing)
    assert path.read_bytes() == before
    with pytest.raises(InputError, match="this is a directory"):
        Session(tmp_path, writing=False)


@pytest.mark.parametrize("lever", [(40.0, -25.0, 160.0), (0.0, 0.0, -80.0), (0.0, 0.0, 0.0)])
def test_a_frame_sees_the_target_and_the_tool_that_points_there(lever):
    cell = Cell.from_toml(cell_text(target={"in_flange_mm": lever}))
    frame = transform_from_parts([0.4, -0.3, 1.2], [0.6, 0.0, 0.8, 0.0])
    readings = np.radians([20.0, 35.0, -50.0, -15.0, 70.0])
    point, direction = cell.target_seen_from(frame)(readings)
    flange = frame @ cell.arm.flange_chain.pose(readings[None])[0]
    np.testing.assert_allclose(
        point, (frame @ [*cell.targets_in_base(readings[None])[0], 1.0])[:3], atol=1e-12
    )
    length = np.linalg.norm(lever)
    wanted = (point - flange[:3, 3]) / (length / 1e3) if length else flange[:3, 2]
    np.testing.assert_allclose(direction, wanted, atol=1e-9)


def test_all_kinds_of_faults_are_named():
    sizes = {"delay_s", "restart_s", "outlier_mm"}
    assert set(re.findall(r"\w+", FAULTS)) >= set(FaultsSection.model_fields) - sizes
