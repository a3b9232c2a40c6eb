"""The measurement process on the virtual cell, through Python and through the command line."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from tests.cell_support import cell_text, measured, poses_of, virtual, write_poses
from tests.trials import measuring, simulated
from truearm.cell import Cell
from truearm.cell.accepted import accepted_table, measurements_of
from truearm.cell.checks import last_check
from truearm.cell.examples import EXAMPLES, SIMULATED
from truearm.cell.measuring import ACCURATE, DONE, Progress
from truearm.cell.poses_file import Poses
from truearm.cell.reading import Reading
from truearm.cell.registering import register_cell
from truearm.cell.session import Session, Step
from truearm.cell.summary import summary_of
from truearm.cli import main
from truearm.errors import WorkError

SMALL = {"stretch": 20, "check_every": 0}


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """A session of forty poses, some approached from either side; its path, the cell, and the virtual one."""
    path = tmp_path_factory.mktemp("session") / "session.db"
    text = cell_text(process=SMALL)
    cell = Cell.from_toml(text)
    poses = poses_of(cell, 40, seed=1, approach=np.tile([0, 1, -1, 0], 10))
    with virtual(text) as (running, found):
        reports: list[Progress] = []
        end, _ = measured(found, poses, path, reports)
        assert end == DONE
        yield path, cell, running.world, reports


def test_measurements_are_where_the_pin_really_was(session):
    path, cell, world, _ = session
    with Session(path, writing=False) as known:
        table, summary = accepted_table(known), summary_of(known)
    assert summary["measured"] == 40
    assert (table["readings"] == 2).all()
    assert (table["temperature_c"] == 21.0).all()
    joints = table[[f"q{j}" for j in range(1, 6)]].to_numpy()
    tenths = np.degrees(joints) * 10.0
    np.testing.assert_allclose(tenths, np.rint(tenths), atol=1e-6)
    truth = world.truth.true_pose(joints, tool=cell.flange_from_target)[:, :3, 3]
    truth = truth @ world.world_from_base[:3, :3].T + world.world_from_base[:3, 3]
    off_mm = 1e3 * np.linalg.norm(table[["x", "y", "z"]].to_numpy() - truth, axis=1)
    assert np.sqrt(np.square(off_mm).mean()) < 0.12
    assert off_mm.max() < 0.35


def test_they_calibrate_the_arm(session):
    with Session(session[0], writing=False) as known:
        data = measurements_of(known)
    calibration = ta.calibrate(session[1].arm, data, model="constant")
    errors = calibration.validation.holdout
    assert errors["constant"].position.mean < 0.3 * errors["nominal"].position.mean


def test_progress_tells_residuals_stretches_and_time_left(session):
    said = [report.text for report in session[3]]
    assert any("frame registered from 6 contacts" in text for text in said)
    assert any(text.startswith("20 poses, constant model") for text in said)
    assert sum("stored" in text for text in said) == 46
    assert session[3][-1].done == session[3][-1].total == 46
    assert all(report.left_s is None or report.left_s >= 0.0 for report in session[3])


def test_a_finished_session_is_not_done_again(session):
    path, cell, _, _ = session
    poses = poses_of(cell, 40, seed=1, approach=np.tile([0, 1, -1, 0], 10))
    assert measured(cell_text(process=SMALL), poses, path)[0] == DONE


def test_the_target_accuracy_ends_it_early(tmp_path):
    text = cell_text(process={"stretch": 15, "check_every": 0, "target_mm": 1.0})
    poses = poses_of(Cell.from_toml(text), 60, seed=2)
    with virtual(text) as (_, found):
        assert measured(found, poses, tmp_path / "s.db")[0] == ACCURATE
        assert measured(found, poses, tmp_path / "s.db")[0] == ACCURATE
    with Session(tmp_path / "s.db", writing=False) as known:
        summary = summary_of(known)
    assert summary["measured"] == 30
    assert all(row["p95_mm"] <= 1.0 for row in summary["stretches"])


def test_an_implausible_frame_is_refused(tmp_path):
    # The real base is turned by 10 degrees about a vertical axis: too far for the panel to catch the pin.
    turned = cell_text(simulate={"frame_error_deg": 10.0, "frame_error_mm": 0.0}, process={"attempts": 2})
    with virtual(turned) as (_, found), pytest.raises(WorkError, match="registration"):
        measured(found, poses_of(Cell.from_toml(turned), 8), tmp_path / "s.db")


def test_registration_finds_the_frame_and_refuses_what_cannot_be():
    cell = Cell.from_toml(cell_text())
    joints = poses_of(cell, 12, seed=4).readings
    assert cell.file.world is not None
    frame = cell.file.world.transform()
    points = cell.targets_in_base(joints) @ frame[:3, :3].T + frame[:3, 3]
    found = register_cell(cell, joints, points + 1e-3)
    assert found.residual_m < 1e-9
    np.testing.assert_allclose(found.world_from_base[:3, 3], frame[:3, 3] + 1e-3, atol=1e-9)
    with pytest.raises(WorkError, match="3 contacts"):
        register_cell(cell, joints[:3], points[:3])
    with pytest.raises(WorkError, match="of a line"):
        register_cell(cell, joints[[0] * 6], points[[0] * 6])
    with pytest.raises(WorkError, match="mm RMS.*implausible"):
        register_cell(cell, joints, points + 0.02 * np.random.default_rng(0).normal(size=points.shape))
    with pytest.raises(WorkError, match="from the cell file's: implausible"):
        register_cell(cell, joints, points + 0.1)


@pytest.mark.parametrize(
    ("read", "told", "message"),
    [
        ("m", 1e3, r'times as far apart.*like mm, and are read as m\b.*State length_unit = "mm"'),
        ("mm", 1e-3, 'like m, and are read as mm.*State length_unit = "m"'),
        ("in", 25.4, 'like mm, and are read as in.*State length_unit = "mm"'),
        ("mm", 1 / 304.8, "like ft, and are read as mm.*Have it say mm"),
    ],
)
def test_an_instrument_in_another_unit_is_told_by_the_frame(read, told, message):
    cell = Cell.from_toml(cell_text("tracker", sensor={"length_unit": read}))
    joints = poses_of(cell, 8).readings
    seen = cell.targets_in_base(joints) + 3e-3 * np.random.default_rng(0).normal(size=(8, 3))
    with pytest.raises(WorkError, match=message):
        register_cell(cell, joints, told * (seen + 3.0))


def test_what_the_table_cannot_reach_is_skipped_with_the_reason(tmp_path):
    text = cell_text(process={"check_every": 0})
    poses = poses_of(Cell.from_toml(text), 8, seed=6)
    up = np.radians([0.0, 60.0, -20.0, 0.0, 20.0])
    more = Poses(np.vstack([poses.readings, up]), np.append(poses.approach, 0), (*poses.purpose, ""))
    with virtual(text) as (_, found):
        assert measured(found, more, tmp_path / "s.db")[0] == DONE
    with Session(tmp_path / "s.db", writing=False) as known:
        skipped = summary_of(known)["skipped"]
    assert [entry["pose"] for entry in skipped] == [9]
    assert "the pin meets the panel at" in skipped[0]["reason"]


def test_a_laser_tracker_needs_no_guess_of_its_frame(tmp_path):
    text = cell_text("tracker", process={"check_every": 0})
    with virtual(text) as (running, found):
        assert measured(found, poses_of(Cell.from_toml(text), 8), tmp_path / "s.db")[0] == DONE
        truth = running.world.world_from_base
    with Session(tmp_path / "s.db", writing=False) as known:
        found_frame = known.registration()
    assert found_frame is not None
    frame, residual_mm = found_frame
    assert residual_mm < 3.0
    assert np.linalg.norm(frame[:3, 3] - truth[:3, 3]) < 0.02


@pytest.mark.slow
def test_the_commands_lead_from_a_cell_file_to_measurements(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["cell", "example", "rv-m2"]) == 0
    assert main(["cell", "example", "rv-m2"]) == 1
    text = cell_text(process=SMALL)
    poses = poses_of(Cell.from_toml(text), 15, seed=1)
    write_poses(tmp_path / "poses.csv", poses)
    capsys.readouterr()
    assert main(["measure", "cell.toml", "poses.csv", "--dry-run"]) == 0
    plan = capsys.readouterr().out
    assert "8 contacts for the frame, 15 poses" in plan
    assert main(["measure", "cell.toml", "poses.csv", "--dry-run", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["steps"]) == 24
    with simulated(tmp_path, text, "--seed", "3") as cell:
        done = measuring(cell, "poses.csv", "session.db")
        assert "15 of 15 poses measured" in done.communicate()[0]
        assert main(["cell", "check", str(cell), "--json"]) == 0
        assert len(json.loads(capsys.readouterr().out)["readings"]) == 5
    assert main(["session", "show", "session.db"]) == 0
    shown = capsys.readouterr().out
    assert "15 of 15 poses measured" in shown
    assert "The session is complete: nothing is left to measure." in shown
    assert max(map(len, shown.splitlines())) <= 80
    assert main(["session", "show", "session.db", "--pose", "2"]) == 0
    assert "accepted" in capsys.readouterr().out
    assert main(["session", "show", "session.db", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["measured"], told["complete"]) == (15, True)
    assert main(["session", "export", "session.db"]) == 0
    assert len(ta.Measurements.read_csv("measurements.csv")) == 15


def test_an_export_writes_over_no_session_and_over_nothing_that_is_not_named(
    session, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    places = (Path("measurements.csv"), Path("session.db"))
    places[0].write_text("mine")
    shutil.copy(session[0], places[1])
    before = [place.read_bytes() for place in places]
    assert main(["session", "export", "session.db"]) == 2
    assert "measurements.csv is there already" in capsys.readouterr().err
    assert main(["session", "export", "session.db", "-o", "session.db"]) == 2
    assert "never written over" in capsys.readouterr().err
    assert [place.read_bytes() for place in places] == before
    assert main(["session", "export", "session.db", "-o", "measurements.csv"]) == 0
    assert len(ta.Measurements.read_csv(places[0])) == 40


def test_a_pose_that_is_not_in_the_list_is_told_from_one_without_readings(session, capsys):
    assert main(["session", "show", str(session[0]), "--pose", "999"]) == 2
    assert "there is no pose 999. Its poses are 1 to 40." in capsys.readouterr().err
    assert main(["session", "show", str(session[0]), "--pose", "0"]) == 2
    assert "there is no pose 0." in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (["cell", "example", "nothing"], 2, "there is no example"),
        (["cell", "simulate", "missing.toml"], 1, "there is no such file"),
        (["cell", "simulate", "cell.toml", "-o", "cell.toml"], 2, "never written over"),
        (["cell", "simulate", "cell.toml", "--fault", "lost"], 2, "is no fault"),
        (["cell", "simulate", "cell.toml", "--fault", "lst=0.1"], 1, 'Did you mean "lost"'),
        (["cell", "simulate", "playback.toml"], 1, "no virtual counterpart"),
        (["measure", "cell.toml", "missing.csv"], 1, "there is no such file"),
        (["session", "show", "missing.db"], 1, "there is no such file"),
        (["session", "export", "missing.db"], 1, "there is no such file"),
    ],
)
def test_wrong_commands_are_told(words, status, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ("rv-m2", "playback"):
        main(["cell", "example", name, "-o", "cell.toml" if name == "rv-m2" else "playback.toml"])
    assert main(words) == status
    assert message in capsys.readouterr().err


def test_a_virtual_cell_is_not_written_over_the_arm_it_is_of(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("arm.toml").write_text(ta.Robot.load("rv-m2").to_toml())
    Path("cell.toml").write_text(cell_text(arm="arm.toml"))
    before = Path("arm.toml").read_bytes()
    assert main(["cell", "simulate", "cell.toml", "-o", "arm.toml"]) == 2
    assert "never written over" in capsys.readouterr().err
    assert Path("arm.toml").read_bytes() == before


def test_what_is_named_after_an_example_can_be_done(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in EXAMPLES:
        assert main(["cell", "example", name, "-o", f"{name}.toml"]) == 0
        named = capsys.readouterr().out
        assert f"truearm cell check {name}.toml" in named
        assert (f"truearm cell simulate {name}.toml" in named) == (name in SIMULATED)
    assert set(EXAMPLES) - set(SIMULATED) == {"playback"}


def test_a_check_is_held_against_the_same_pose_where_the_first_contact_was_given_up(tmp_path):
    plan = [("registration", 7), ("registration", 9), ("pose", 6), ("pose", 7), ("check", 7)]
    steps = [Step(k, kind, pose, "", 0, np.zeros(5)) for k, (kind, pose) in enumerate(plan)]
    with Session.create(tmp_path / "session.db", steps, {}) as known:
        known.add_outcome(0, "skipped", reason="out of range")
        for step in steps[1:]:
            point = np.array([step.pose, step.step, 0.0])
            known.add_reading(step.step, 1, Reading(point, 1e-4, 0.0, True, ""), np.zeros(5), point)
            assert last_check(known) is None
            known.add_outcome(step.step, "measured", attempts=[1])
        check = last_check(known)
    assert check is not None
    np.testing.assert_array_equal(check.first, [7.0, 3.0, 0.0])
    np.testing.assert_array_equal(check.now, [7.0, 4.0, 0.0])


def test_orientations_near_a_half_turn_are_averaged_in_files_of_any_name(tmp_path):
    steps = [Step(0, "pose", 0, "", 0, np.zeros(5))]
    turns = Rotation.from_rotvec([[np.pi - 1e-5, 0.0, 0.0], [np.pi + 1e-5, 0.0, 0.0]]).as_matrix()
    with Session.create(tmp_path / "a#1 %25?.db", steps, {}) as known:
        for attempt, turn in enumerate(turns, start=1):
            pose = np.eye(4)
            pose[:3, :3] = turn
            reading = Reading(np.zeros(3), 1e-4, 0.0, True, "", pose_in_world=pose)
            known.add_reading(0, attempt, reading, np.zeros(5), np.zeros(3))
        known.add_outcome(0, "measured", attempts=[1, 2])
        row = accepted_table(known).iloc[0]
    found = Rotation.from_quat([row[name] for name in ("qx", "qy", "qz", "qw")])
    wanted = Rotation.from_rotvec([np.pi, 0.0, 0.0])
    assert (found * wanted.inv()).magnitude() < 1e-9
    assert not (tmp_path / "a").exists()


def test_turns_temperatures_and_features_are_means_of_the_readings_that_have_them(tmp_path):
    told = [
        (21.0, {"humidity": 40.0, "lost": np.nan}, np.eye(4)),
        (None, {}, None),
        (22.0, {"humidity": 42.0, "pressure": 990.0, "lost": np.inf}, np.eye(4)),
        (np.nan, {"humidity": np.nan, "pressure": 992.0}, None),
    ]
    steps = [Step(0, "pose", 0, "", 0, np.zeros(5)), Step(1, "pose", 1, "", 0, np.zeros(5))]
    with Session.create(tmp_path / "session.db", steps, {}) as known:
        for attempt, (celsius, features, pose) in enumerate(told, start=1):
            reading = Reading(np.ones(3), 1e-4, 0.0, True, "", "", pose, celsius, features)
            known.add_reading(0, attempt, reading, np.zeros(5), np.zeros(3))
        known.add_outcome(0, "measured", attempts=[1, 2, 3, 4])
        known.add_reading(1, 1, Reading(np.ones(3), 1e-4, 0.0, True, ""), np.zeros(5), np.zeros(3))
        known.add_outcome(1, "measured", attempts=[1])
        table = accepted_table(known)
    assert table[["temperature_c", "humidity", "pressure"]].to_numpy()[0].tolist() == [21.5, 41.0, 991.0]
    assert np.isnan(table[["temperature_c", "humidity", "pressure"]].to_numpy()[1]).all()
    assert table["lost"].isna().all()
    assert table[["qw", "qx", "qy", "qz"]].to_numpy()[0].tolist() == [1.0, 0.0, 0.0, 0.0]
