"""Exports read again by somebody else: the same forward kinematics, nothing lost without a word."""

import csv
import json
import math
import re
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from yourdfpy import URDF

import truearm as ta
from truearm import Robot
from truearm.cli import main
from truearm.controller import Controller
from truearm.description.library import library_names
from truearm.errors import InputError, UsageError, WorkError
from truearm.exporting import FORMATS, ExportOptions, constant_robot, export
from truearm.exporting.losses import beta_is_lost
from truearm.exporting.origins import joint_origins, roll_pitch_yaw
from truearm.exporting.urdf_file import comment
from truearm.simulation import VirtualArm
from truearm.ur_kinematics import has_ur_structure, robot_from_yaml

ARM_URDF = """<?xml version="1.0"?>
<robot name="hand made">
  <link name="world"/>
  <link name="foot"><visual><geometry><mesh filename="package://arm/foot.stl"/></geometry></visual></link>
  <link name="upper"/><link name="elbow"/><link name="fore"/><link name="hand"/><link name="wrist"/>
  <link name="finger"/><link name="mount"/><link name="camera"/>
  <!-- the maker's own words -->
  <joint name="stand" type="fixed"><parent link="world"/><child link="foot"/>
    <origin xyz="0.1 0 0.2" rpy="0 0 0.3"/></joint>
  <joint name="turn" type="revolute"><parent link="foot"/><child link="upper"/>
    <origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="0 0 -1"/>
    <limit lower="-3" upper="3" effort="40" velocity="2"/></joint>
  <joint name="lift" type="revolute"><parent link="upper"/><child link="elbow"/>
    <origin xyz="0.05 0 0.1"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="40" velocity="2"/></joint>
  <joint name="bend" type="revolute"><parent link="elbow"/><child link="fore"/>
    <origin xyz="0 0.02 0.4"/><axis xyz="0 2 0"/>
    <limit lower="-2" upper="2" effort="40" velocity="2"/></joint>
  <joint name="roll" type="continuous"><parent link="fore"/><child link="hand"/>
    <origin xyz="0.1 0 0.05" rpy="0 1.5707963267948966 0"/><axis xyz="0 0 1"/></joint>
  <joint name="nod" type="revolute"><parent link="hand"/><child link="wrist"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="5"/></joint>
  <joint name="spin" type="revolute"><parent link="wrist"/><child link="finger"/>
    <limit lower="-4" upper="4" effort="9" velocity="5"/></joint>
  <joint name="plate" type="fixed"><parent link="finger"/><child link="mount"/>
    <origin xyz="0.07 0 0" rpy="0 1.57 0"/></joint>
  <joint name="eye" type="fixed"><parent link="fore"/><child link="camera"/>
    <origin xyz="0 0.1 0.1" rpy="0.5 0 0"/></joint>
</robot>
"""


def calibrated(robot, *, frame="free", model="constant", seed=3, count=60):
    arm = VirtualArm(robot, seed=seed)
    data = arm.measure(arm.poses(count))
    return ta.calibrate(robot, data, model=model, frame=frame)


def random_readings(robot, count=30):
    low, high = np.where(np.isfinite(robot.limits), robot.limits, [-np.pi, np.pi]).T
    return np.random.default_rng(5).uniform(low, high, (count, robot.joint_count))


@pytest.fixture(scope="module")
def ur10():
    return calibrated(Robot.load("ur10"))


@pytest.fixture(scope="module")
def variable():
    return calibrated(Robot.load("ur10"), model="variable", count=100)


@pytest.fixture(scope="module")
def hand_made(tmp_path_factory):
    path = tmp_path_factory.mktemp("urdf") / "arm.urdf"
    path.write_text(ARM_URDF)
    return path, calibrated(Robot.load(f"{path}#mount"))


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_roll_pitch_yaw_gives_the_matrix_back(quaternion):
    matrix = Rotation.from_quat(quaternion).as_matrix()
    again = Rotation.from_euler("xyz", roll_pitch_yaw(matrix)).as_matrix()
    assert np.abs(again - matrix).max() < 1e-14


@pytest.mark.parametrize(
    "pitch", [0.5 * math.pi, -0.5 * math.pi, 0.5 * math.pi - 1e-9, 0.5 * math.pi - 1e-16]
)
def test_roll_pitch_yaw_keeps_all_digits_where_pitch_is_a_quarter_turn(pitch):
    matrix = Rotation.from_euler("xyz", [0.3, pitch, 1.1]).as_matrix()
    again = Rotation.from_euler("xyz", roll_pitch_yaw(matrix)).as_matrix()
    assert np.abs(again - matrix).max() < 1e-14


@pytest.mark.parametrize("name", library_names())
def test_origins_and_pure_motions_make_the_arm(name):
    robot = Robot.load(name)
    q = random_readings(robot, 5)
    origins, last = joint_origins(robot)
    for values, pose in zip(robot.joints_from_readings(q), robot.pose(q), strict=True):
        frame = np.eye(4)
        for kind, origin, value in zip(robot.joints, origins, values, strict=True):
            motion = np.eye(4)
            if kind == "revolute":
                motion[:3, :3] = Rotation.from_rotvec([0.0, 0.0, value]).as_matrix()
            else:
                motion[2, 3] = value
            frame = frame @ origin @ motion
        assert np.abs(frame @ last @ robot.tool - pose).max() < 1e-12


@pytest.mark.parametrize(
    "name", ["ur10", "franka-panda", "kuka-kr-6-r900", "fanuc-lr-mate-200id", "rv-m2", "adept-cobra-600"]
)
def test_every_format_says_how_near_it_is(name):
    calibration = calibrated(Robot.load(name), count=40)
    for chosen in ("urdf", "dh-toml", "dh-json", "dh-csv"):
        made = export(calibration, chosen)
        assert made.difference_m is not None
        assert made.difference_m < 1e-12


def test_a_urdf_has_the_calibrated_kinematics_for_other_readers(ur10, tmp_path):
    path = tmp_path / "arm.urdf"
    export(ur10, "urdf", path)
    robot = constant_robot(ur10)
    model = URDF.load(str(path), load_meshes=False)
    for q in random_readings(robot):
        model.update_cfg(q)
        assert np.abs(model.get_transform("flange", "base_link") - robot.pose(q)).max() < 1e-9
        assert np.abs(model.get_transform("flange", "base_link") - ur10.robot.pose(q)).max() > 1e-5


def test_the_constant_part_is_what_the_constant_model_predicts():
    for frame in ("free", "world"):
        arm = VirtualArm.paper(seed=1)
        calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), model="constant", frame=frame)
        robot, q = constant_robot(calibration), arm.poses(20, seed=1)
        assert np.abs(robot.pose(q) - calibration.pose(q)).max() < 1e-12
        made = export(calibration, "dh-toml")
        assert np.abs(Robot.from_toml(made.text).pose(q) - calibration.pose(q)).max() < 1e-12


def test_a_directed_joint_turns_the_way_of_its_reading(tmp_path):
    calibration = calibrated(Robot.load("kuka-kr-6-r900"))
    path = tmp_path / "kuka.urdf"
    export(calibration, "urdf", path)
    again, robot = Robot.load(path), constant_robot(calibration)
    q = random_readings(robot)
    assert np.abs(again.pose(q) - robot.pose(q)).max() < 1e-9
    assert np.allclose(again.limits, robot.limits)


def test_coupled_readings_are_said(tmp_path):
    calibration = calibrated(Robot.load("fanuc-lr-mate-200id"))
    made = export(calibration, "urdf", tmp_path / "fanuc.urdf")
    assert "coupled" in " ".join(made.notes)
    assert "coupled" in made.text
    again, robot = Robot.load(tmp_path / "fanuc.urdf"), constant_robot(calibration)
    q = random_readings(robot)
    assert np.abs(again.pose(robot.joints_from_readings(q)) - robot.pose(q)).max() < 1e-9


def test_a_new_urdf_keeps_names_of_the_old(hand_made):
    _, calibration = hand_made
    root = ET.fromstring(export(calibration, "urdf").text)
    joints = [joint.get("name") for joint in root.findall("joint")]
    assert joints == ["turn", "lift", "bend", "roll", "nod", "spin", "mount_fixed"]
    links = [link.get("name") for link in root.findall("link")]
    assert links == ["world", "upper", "elbow", "fore", "hand", "wrist", "finger", "mount"]


def test_names_come_through_a_calibration_file(hand_made, tmp_path):
    _, calibration = hand_made
    calibration.save(tmp_path / "arm.calib")
    again = ta.Calibration.load(tmp_path / "arm.calib")
    assert again.robot == calibration.robot
    assert export(again, "urdf").text == export(calibration, "urdf").text


def test_a_tool_of_the_robot_file_follows_the_flange(tmp_path):
    plain = Robot.load("ur10").to_dict()
    tool = np.eye(4)
    tool[:3, 3] = [0.01, 0.02, 0.15]
    calibration = calibrated(Robot.from_dict({**plain, "tool": tool.tolist()}))
    path = tmp_path / "arm.urdf"
    export(calibration, "urdf", path)
    q = random_readings(calibration.robot)
    assert np.abs(Robot.load(f"{path}#tool0").pose(q) - constant_robot(calibration).pose(q)).max() < 1e-9


def test_the_command_that_is_named_after_correcting_a_urdf_works(hand_made, tmp_path, monkeypatch, capsys):
    path, calibration = hand_made
    monkeypatch.chdir(tmp_path)
    calibration.save("arm.calib")
    assert main(["export", "arm.calib", "--to", "urdf", "--urdf", f"{path}#mount", "-o", "new.urdf"]) == 0
    (named,) = re.findall(r"truearm (robots .*)", capsys.readouterr().out)
    assert named == "robots new.urdf#world,mount"
    assert main(named.split()) == 0


def test_a_corrected_urdf_keeps_all_but_the_chain(hand_made):
    path, calibration = hand_made
    made = export(calibration, "urdf", options=ExportOptions(urdf=f"{path}#mount"))
    robot = constant_robot(calibration)
    again = Robot.from_urdf_text(made.text, "world", "mount")
    q = random_readings(robot)
    assert np.abs(again.pose(q) - robot.pose(q)).max() < 1e-9
    assert "package://arm/foot.stl" in made.text
    assert "the maker's own words" in made.text
    before, after = origins_of(ARM_URDF), origins_of(made.text)
    assert list(before) == list(after)
    assert before["eye"] == after["eye"]
    assert before["stand"] == after["stand"]
    shifts = [np.abs(np.subtract(before[name][0], after[name][0])).max() for name in before]
    assert 1e-6 < max(shifts) < 0.01


def test_a_corrected_urdf_keeps_the_names_of_other_programs(hand_made, tmp_path):
    """Prefixes are part of names, declared as gazebo's here or not, as drake's."""
    path, calibration = hand_made
    odd = ARM_URDF.replace('<robot name="hand made">', '<robot name="hand made" xmlns:gz="http://gz">')
    odd = odd.replace('effort="40" velocity="2"/>', 'effort="40" velocity="2" drake:acceleration="9"/>')
    odd = odd.replace("</robot>", '<gz:plugin gz:file="a.so"><drake:gear ratio="80"/></gz:plugin></robot>')
    other = tmp_path / "odd.urdf"
    other.write_text(odd)
    made = export(calibration, "urdf", options=ExportOptions(urdf=f"{other}#mount"))
    for kept in ('xmlns:gz="http://gz"', '<gz:plugin gz:file="a.so">', '<drake:gear ratio="80" />'):
        assert kept in made.text
    assert made.text.count('drake:acceleration="9"') == 3
    plain = export(calibration, "urdf", options=ExportOptions(urdf=f"{path}#mount")).text
    assert origins_of(re.sub("(drake|gz):", "", made.text)) == origins_of(plain)


def origins_of(text):
    """xyz and rpy of each joint by name."""
    found = {}
    for joint in ET.fromstring(text).findall("joint"):
        origin = joint.find("origin")
        attributes = {} if origin is None else origin.attrib
        numbers = [[float(x) for x in attributes.get(key, "0 0 0").split()] for key in ("xyz", "rpy")]
        found[joint.get("name")] = numbers
    return found


def test_a_tip_on_the_last_axis_cannot_hold_a_tilted_flange(hand_made):
    path, _ = hand_made
    calibration = calibrated(Robot.load(f"{path}#finger"))
    robot = constant_robot(calibration)
    options = ExportOptions(urdf=f"{path}#finger")
    if np.abs(robot.table[5, [2, 3]] - calibration.robot.table[5, [2, 3]]).max() == 0.0:
        assert export(calibration, "urdf", options=options).difference_m == pytest.approx(0.0, abs=1e-9)
    tilted = bent_at_the_end(calibration)
    with pytest.raises(WorkError, match='off the axis of joint "spin", and link "finger" is the tip'):
        export(tilted, "urdf", options=options)


def bent_at_the_end(calibration):
    """The same calibration with a last link that is turned and shifted."""
    from dataclasses import replace

    constants = calibration.models["constant"].constants.copy()
    constants[-1, 2:4] += [1e-3, 1e-3]
    model = replace(calibration.models["constant"], constants=constants)
    return replace(calibration, models={**calibration.models, "constant": model})


def test_another_urdf_is_not_corrected(hand_made, ur10, tmp_path):
    path, calibration = hand_made
    with pytest.raises(InputError, match="differs from UR10 by"):
        export(ur10, "urdf", options=ExportOptions(urdf=f"{path}#mount"))
    with pytest.raises(InputError, match="has 3 joints that move, hand made has 6"):
        export(calibration, "urdf", options=ExportOptions(urdf=f"{path}#fore"))
    with pytest.raises(InputError, match="this is no URDF"):
        export(ur10, "urdf", options=ExportOptions(urdf="ur10"))


def test_ur_yaml_is_what_the_drivers_description_makes_of_it(ur10):
    made = export(ur10, "ur-yaml", options=ExportOptions(kinematics_hash="calib_7"))
    kinematics = yaml.safe_load(made.text)["kinematics"]
    assert kinematics.pop("hash") == "calib_7"
    assert list(kinematics) == ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"]
    robot = constant_robot(ur10)
    for q in random_readings(robot):
        frame = np.eye(4)
        for link, angle in zip(kinematics.values(), q, strict=True):
            origin = np.eye(4)
            origin[:3, :3] = Rotation.from_euler(
                "xyz", [link["roll"], link["pitch"], link["yaw"]]
            ).as_matrix()
            origin[:3, 3] = link["x"], link["y"], link["z"]
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()
            frame = frame @ origin @ turn
        assert np.abs(frame - robot.pose(q)).max() < 1e-9


def test_ur_yaml_says_that_the_controller_stays_as_it_is(ur10, tmp_path):
    path = tmp_path / "arm.yaml"
    made = export(ur10, "ur-yaml", path)
    assert "It does not change the controller" in " ".join(made.notes)
    assert "not change the controller" in " ".join(made.text.replace("# ", "").split())
    assert yaml.safe_load(made.text)["kinematics"]["hash"].startswith("calib_")
    q = random_readings(ur10.robot)
    again = Controller.load(path, robot=ur10.robot)
    assert np.abs(again.pose(q) - constant_robot(ur10).pose(q)).max() < 1e-9


def test_ur_yaml_says_what_comes_behind_its_last_axis(ur10):
    made = export(bent_at_the_end(ur10), "ur-yaml")
    assert "Put that before the tool" in " ".join(made.notes)
    assert made.difference_m == pytest.approx(0.0, abs=1e-9)


NO_URS = ["franka-panda", "adept-cobra-600", "fanuc-lr-mate-200id", "rv-m2", "abb-irb-120"]


@pytest.mark.parametrize("name", NO_URS)
def test_ur_yaml_is_for_arms_of_universal_robots(name):
    arm = VirtualArm(Robot.load(name), seed=1)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(40)), model="constant")
    with pytest.raises(InputError, match=f"{re.escape(arm.robot.name)} is no arm of Universal Robots"):
        export(calibration, "ur-yaml")


def test_arms_of_universal_robots_are_known_by_their_axes(ur10):
    """By those of their nominal tables, and of tables that a controller was calibrated with."""
    known = {name for name in library_names() if has_ur_structure(Robot.load(name))}
    assert known == {name for name in library_names() if name.startswith("ur")}
    assert has_ur_structure(constant_robot(ur10))
    assert has_ur_structure(robot_from_yaml(export(ur10, "ur-yaml").text, where="the YAML"))


def test_tables_hold_the_constants(ur10):
    expected = ur10.models["constant"].constants
    assert np.array_equal(Robot.from_toml(export(ur10, "dh-toml").text).table, expected)
    content = json.loads(export(ur10, "dh-json").text)
    assert np.array_equal(content["table"], expected)
    assert np.array_equal(content["nominal_table"], ur10.robot.table)
    lines = [line for line in export(ur10, "dh-csv").text.splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    assert [float(row["alpha_rad"]) for row in rows] == expected[:, 3].tolist()
    assert [float(row["nominal_d_m"]) for row in rows] == ur10.robot.table[:, 1].tolist()


def test_beta_is_said_where_there_is_some(ur10):
    notes = " ".join(export(ur10, "dh-csv").notes)
    assert "Links 2 and 3 of the table have beta" in notes
    assert "beta" not in " ".join(export(ur10, "urdf").notes)


def test_a_beta_that_moves_nothing_is_not_said(ur10):
    table = np.array(ur10.robot.table)
    for beta, said in ((1e-11, False), (1e-7, True)):
        table[:, 4] = [0.0, beta, 0.0, 0.0, 0.0, 0.0]
        assert bool(beta_is_lost(replace(ur10.robot, table=table))) == said


def test_a_lost_field_is_said_with_what_it_costs(variable, ur10):
    errors = variable.validation.holdout
    for chosen in ("urdf", "ur-yaml", "dh-toml", "dh-json", "dh-csv"):
        made = export(variable, chosen)
        words = " ".join(made.notes)
        assert f"{errors['constant'].position.mean:.3f} mm" in words
        assert f"{errors['variable'].position.mean:.3f} mm" in words
        assert "vary over the workspace" in " ".join(made.text.replace("#", "").split())
        assert "vary" not in " ".join(export(ur10, chosen).notes)


def test_samples_are_the_calibration_at_their_readings(variable, tmp_path):
    path = tmp_path / "field.csv"
    made = export(
        variable, "field-csv", path, ExportOptions(grid="q2=-90:0:4,q3=0:90:3,q5=30", with_std=True)
    )
    table = pd.read_csv(path, comment="#")
    assert made.rows == len(table) == 12
    q = np.radians(table[[f"q{j}_deg" for j in range(1, 7)]].to_numpy())
    assert sorted({round(x) for x in table.q2_deg}) == [-90, -60, -30, 0]
    assert set(table.q5_deg) == {30.0}
    shift = variable.position(q, tool=np.eye(4)) - variable.robot.position(q)
    assert np.allclose(table[["dx_mm", "dy_mm", "dz_mm"]], 1e3 * shift, atol=1e-6)
    added = variable.parameters(q) - variable.robot.table
    assert np.allclose(table["theta3_deg"], np.degrees(added[:, 2, 0]), atol=1e-7)
    assert np.allclose(table["a2_mm"], 1e3 * added[:, 1, 2], atol=1e-6)
    lengths = np.linalg.norm(variable.position_std(q, tool=np.eye(4)), axis=1)
    assert np.allclose(table["std_mm"], 1e3 * lengths, atol=1e-6)
    assert table["theta3_deg"].std() > 0.0


def test_samples_say_where_they_were_taken_and_what_their_columns_are(variable):
    made = export(variable, "field-csv", options=ExportOptions(grid="q2=-90:0:4,q5=30", with_std=True))
    comments = " ".join(line[2:] for line in made.text.splitlines() if line.startswith("#"))
    assert "q2 from -90 to 0 deg, 4 readings; q3 = " in comments
    assert "q5 = 30 deg" in comments
    header = made.text.splitlines()[comments_of(made.text)].split(",")
    for name in header[6:14]:
        assert name in comments
    assert "Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)" in comments
    assert "std_mm" not in export(variable, "field-csv", options=ExportOptions(grid="q1=3")).text


@pytest.mark.parametrize("text", ["a--b", "a---b", "----", "the end-", "well-formed"])
def test_any_text_can_be_a_comment_of_xml(text):
    root = ET.fromstring(f"<robot><!--{comment(text)}--></robot>")
    assert root.tag == "robot"
    assert comment(text).replace(" ", "") == text.replace(" ", "")


def comments_of(text):
    return sum(line.startswith("#") for line in text.splitlines())


def test_samples_say_at_which_features(tmp_path):
    robot = ta.Robot.load("ur10")
    arm = VirtualArm(robot, seed=3)
    table = arm.measure_table(arm.poses(60)).assign(warmth=np.linspace(20.0, 30.0, 60))
    calibration = ta.calibrate(robot, ta.Measurements.from_dataframe(table), features=("warmth",))
    made = export(calibration, "field-csv", options=ExportOptions(grid="q1=3", features={"warmth": 21.5}))
    assert "# Features: warmth 21.5." in made.text
    number: Any = np.float32(21.5)
    again = export(calibration, "field-csv", options=ExportOptions(grid="q1=3", features={"warmth": number}))
    assert again.text == made.text


def test_samples_are_of_one_number_of_each_feature():
    several: Any = {"warmth": [20.0, 21.0, 22.0]}
    with pytest.raises(UsageError, match='the feature "warmth" is .*It must be a number'):
        ExportOptions(features=several)


def test_without_a_grid_samples_cover_the_measured_readings(variable):
    made = export(variable, "field-csv")
    assert made.rows == 5**6


@pytest.mark.parametrize(
    ("to", "options", "error", "message"),
    [
        ("udf", ExportOptions(), UsageError, 'there is no format "udf". Known are "urdf"'),
        ("dh-csv", ExportOptions(urdf="x.urdf"), UsageError, "--urdf is given with --to dh-csv"),
        ("urdf", ExportOptions(grid="q1=3"), UsageError, "It belongs to --to field-csv"),
        ("field-csv", ExportOptions(), WorkError, "this calibration has no field"),
        ("urdf", ExportOptions(urdf="missing.urdf"), InputError, "there is no such file"),
    ],
)
def test_what_cannot_be_exported_is_refused(ur10, to, options, error, message):
    with pytest.raises(error, match=message):
        export(ur10, to, options=options)


@pytest.mark.parametrize(
    "grid",
    [
        "q1",
        "q1=",
        "q9=3",
        "q1=1:2",
        "q1=1:2:0",
        "q1=1:2:1",
        "q1=400",
        "q1=a:b:3",
        "q1=nan",
        "q0=1",
        "q1=0:9:3000000",
        "q1=0:1:2,q1=5",
    ],
)
def test_bad_grids_are_refused(variable, grid):
    with pytest.raises(UsageError, match="--grid"):
        export(variable, "field-csv", options=ExportOptions(grid=grid))


def test_nothing_is_written_where_the_place_is_none(ur10, tmp_path):
    for chosen in FORMATS[:-1]:
        with pytest.raises(InputError, match="no such directory"):
            export(ur10, chosen, tmp_path / "nowhere" / "file")
