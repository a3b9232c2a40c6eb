"""Notices on the arms of a fleet: which of them need attention, and where they are shown."""

from dataclasses import replace

import pytest

import truearm as ta
from tests.in_process import in_this_process
from truearm.doubts.held_tool import never_turns_freely
from truearm.doubts.of_calibration import OPEN_SETUP
from truearm.errors import Notice
from truearm.fleet import Fleet, run_fleet, running
from truearm.fleet.doubted import grave_notices
from truearm.simulation import VirtualArm

POSES = 60
FLEET = """
[defaults]
model = "constant"
report = false

[[arm]]
name = "other"
robot = "ur10"
measurements = "ur5e.csv"

[[arm]]
name = "scara"
robot = "adept-cobra-600"
measurements = "scara.csv"
"""
ANOTHER = "no UR10 deviates so far from its table. It is another robot"
OPEN = "The poses determine 8 of 9 unknowns of frame and target"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A fleet in which a UR5e is taken for a UR10, and a SCARA is as it should be."""
    made = tmp_path_factory.mktemp("hall")
    for file, name in (("ur5e.csv", "ur5e"), ("scara.csv", "adept-cobra-600")):
        arm = VirtualArm(ta.Robot.load(name), seed=1)
        arm.measure_table(arm.poses(POSES)).to_csv(made / file, index=False)
    return made


@pytest.fixture(scope="module")
def found(folder):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(running, "run_tasks", in_this_process)
        run = run_fleet(Fleet.from_toml(FLEET, folder=folder), folder / "out", workers=1)
    return {arm.row["arm"]: arm for arm in run.arms}


def test_an_arm_that_is_another_robot_needs_attention_and_is_told_everywhere(found, folder):
    (reason,) = (reason for reason in found["other"].reasons if reason.kind == "doubt")
    assert ANOTHER in reason.words
    for file in ("fleet.html", "fleet.csv", "fleet.json"):
        assert ANOTHER in (folder / "out" / file).read_text()


def test_a_scara_whose_set_up_is_open_as_on_any_scara_is_good_and_its_notice_is_on_the_page(found, folder):
    assert found["scara"].verdict == "good"
    page = (folder / "out" / "fleet.html").read_text()
    assert "What else should be known" in page
    assert OPEN in page


@pytest.mark.parametrize(("name", "grave"), [("ur10", ["open"]), ("adept-cobra-600", [])])
def test_an_open_set_up_is_grave_where_other_poses_would_close_it(folder, name, grave):
    file = "scara.csv" if name == "adept-cobra-600" else "ur5e.csv"
    made = ta.calibrate(ta.Robot.load(name), ta.Measurements.read_files([folder / file]), model="constant")
    notices = (Notice(OPEN_SETUP, "open"), Notice("mounting", "on a wall"))
    assert grave_notices(replace(made, notices=notices)) == grave


def test_arms_that_keep_a_direction_of_the_flange_are_known():
    robots = {name: ta.Robot.load(name) for name in ("adept-cobra-600", "ur10", "kuka-iiwa-7")}
    assert [name for name, robot in robots.items() if never_turns_freely(robot)] == ["adept-cobra-600"]


def test_constants_that_gross_rows_bend_are_grave():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1)
    table = arm.measure_table(arm.poses(POSES))
    assert (
        grave_notices(ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")) == []
    )
    table.loc[[3, 17, 40], "x"] += 0.02
    bent = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")
    assert any("bend the constants" in words for words in grave_notices(bent))
