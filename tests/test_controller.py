"""The controller's model: nominal, from robot files, and from Universal Robots' own files of an arm."""

import numpy as np
import pytest

from truearm import Robot
from truearm.controller import Controller
from truearm.errors import InputError

# As calibration.conf of a UR: the common normals of its nearly parallel axes are up to 93 m away.
CONF = """[mounting]
delta_theta = [ -8.2e-05, -0.1036, 0.6736, -0.5702, -4.6e-05, 9.7e-07]
delta_a = [ -0.00016, 0.00304, 0.09165, -9.6e-05, -3.0e-05, 0]
delta_d = [ 0.000505, 11.198, -92.527, 81.328, -0.000213, -0.000126]
delta_alpha = [ -0.000321, -0.00565, -0.00379, -0.001065, 0.001, 0]
joint_checksum = [ 0x6e0f7bf, 0xa32a713f, 0xf636a50, 0x9ec2338a, 0xa1afded8, 0xb29b2979]
calibration_status = 2 # 0 == notInitialized / 1 == notLinearised / 2 == Linearised
"""
NOMINAL_YAML = """kinematics:
  shoulder: {x: 0, y: 0, z: 0.089159, roll: -0, pitch: 0, yaw: -0}
  upper_arm: {x: 0, y: 0, z: 0, roll: 1.5707963267948966, pitch: 0, yaw: -0}
  forearm: {x: -0.425, y: 0, z: 0, roll: -0, pitch: 0, yaw: -0}
  wrist_1: {x: -0.39225, y: 0, z: 0.10915, roll: -0, pitch: 0, yaw: -0}
  wrist_2: {x: 0, y: -0.09465, z: 0, roll: 1.5707963267948966, pitch: 0, yaw: -0}
  wrist_3: {x: 0, y: 0.0823, z: 0, roll: 1.5707963267948966, pitch: 3.141592653589793, yaw: 3.141592653589793}
  hash: calib_12788084448423163542
"""


def random_readings(robot, count=20):
    return np.random.default_rng(0).uniform(-np.pi, np.pi, (count, robot.joint_count))


def row(theta, d, a, alpha):
    turn_z, turn_x = np.eye(4), np.eye(4)
    turn_z[:2, :2] = [[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]]
    turn_x[1:3, 1:3] = [[np.cos(alpha), -np.sin(alpha)], [np.sin(alpha), np.cos(alpha)]]
    turn_z[2, 3], turn_x[0, 3] = d, a
    return turn_z @ turn_x


def test_nominal_is_the_robot_itself():
    robot = Robot.load("ur5")
    q = random_readings(robot)
    controller = Controller.declared("nominal", robot)
    assert controller.kind == "nominal"
    assert np.array_equal(controller.pose(q), robot.pose(q))
    tool = np.eye(4)
    tool[:3, 3] = [0.0, 0.01, 0.1]
    assert np.allclose(controller.pose(q[0], tool), robot.pose(q[0]) @ tool, atol=1e-15)


def test_calibration_conf_adds_to_the_nominal_table(tmp_path):
    path = tmp_path / "calibration.conf"
    path.write_text(CONF)
    robot = Robot.load("ur5")
    controller = Controller.load(path, robot=robot)
    lists = {
        key: np.array(eval(text)) for key, text in (line.split(" = ") for line in CONF.splitlines()[1:5])
    }
    q = random_readings(robot)
    for one, pose in zip(q, controller.pose(q), strict=True):
        expected = np.eye(4)
        for j, (theta, d, a, alpha, _) in enumerate(robot.table):
            expected = expected @ row(
                theta + lists["delta_theta"][j] + one[j],
                d + lists["delta_d"][j],
                a + lists["delta_a"][j],
                alpha + lists["delta_alpha"][j],
            )
        assert np.abs(pose - expected).max() < 1e-12
    assert controller.kind == "factory"
    assert np.abs(controller.robot.table - robot.table).max() < 0.3
    assert np.array_equal(controller.robot.limits, robot.limits)
    assert np.abs(controller.inverse.near(controller.pose(q), q) - q).max() < 1e-8
    assert controller.inverse.method == "three parallel axes"


def test_nominal_kinematics_yaml_is_the_nominal_arm(tmp_path):
    path = tmp_path / "default_kinematics.yaml"
    path.write_text(NOMINAL_YAML)
    robot = Robot.load("ur5")
    q = random_readings(robot)
    assert np.abs(Controller.load(path).pose(q) - robot.pose(q)).max() < 1e-12


def test_yaml_of_the_extraction_tool_is_read_as_the_tool_wrote_it(tmp_path):
    """roll, pitch, yaw about x, the new y and the new z: Rx(alpha) Rz(theta) keeps pitch at zero."""
    path = tmp_path / "arm.yaml"
    path.write_text(
        NOMINAL_YAML.replace(
            "z: 0, roll: 1.5707963267948966, pitch: 0, yaw: -0}", "z: 0, roll: 1.57, pitch: 0, yaw: 1e-2}", 1
        )
    )
    robot = Robot.load("ur5")
    table = robot.table.copy()
    table[0, 3], table[1, 0] = 1.57, 1e-2
    expected = Robot.from_dict({**robot.to_dict(), "table": table.tolist()})
    q = random_readings(robot)
    assert np.abs(Controller.load(path).pose(q) - expected.pose(q)).max() < 1e-12
    path.write_text("convention: urdf\n" + path.read_text())
    assert np.abs(Controller.load(path).pose(q) - expected.pose(q)).max() > 1e-3


def test_robot_files_and_urdfs_are_models_too(tmp_path):
    robot = Robot.load("ur5")
    path = tmp_path / "own.toml"
    path.write_text(robot.to_toml())
    assert Controller.load(path, robot=robot).robot == robot


@pytest.mark.parametrize(
    ("name", "text", "arm", "message"),
    [
        ("a.yaml", "[1, 2", "ur5", "this is no YAML"),
        ("a.yaml", "4", "ur5", "holds no keys"),
        ("a.yaml", "joints: 3", "ur5", 'there is no "kinematics"'),
        ("a.yaml", NOMINAL_YAML.replace("  forearm", "  elbow"), "ur5", 'there is no link "forearm"'),
        ("a.yaml", NOMINAL_YAML.replace("z: 0.089159", "z: high"), "ur5", "shoulder: z is 'high'"),
        ("a.yaml", NOMINAL_YAML.replace("z: 0.089159", "z: .nan"), "ur5", "shoulder: z is nan"),
        ("a.yaml", NOMINAL_YAML, "franka-panda", "has 6 revolute joints. The arm, Franka Emika Panda, has 7"),
        ("a.conf", CONF, None, "Name the arm as well"),
        ("a.conf", CONF, "rv-m2", "six rows in the standard convention"),
        ("a.conf", "nothing", "ur5", "this is no calibration.conf"),
        ("a.conf", "[robot]\nx = 1", "ur5", r'no section "\[mounting\]"'),
        ("a.conf", CONF.replace("delta_d", "delta_e"), "ur5", 'there is no "delta_d"'),
        ("a.conf", CONF.replace(", 0]", "]"), "ur5", "must be a list of six numbers"),
        ("a.conf", CONF.replace(", 0]", ", zero]"), "ur5", "must be a list of six numbers"),
        ("a.txt", CONF, "ur5", 'ends in ".txt" is no model of a controller'),
        ("a.toml", "x = 3", "ur5", "a.toml"),
    ],
)
def test_files_that_are_none_are_refused(tmp_path, name, text, arm, message):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        Controller.load(path, robot=arm and Robot.load(arm))
    with pytest.raises(InputError, match="no such file"):
        Controller.load(tmp_path / "missing.yaml")
