"""The robot: what its file says is what its kinematics do."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from truearm.description.library import library_names
from truearm.description.robot_data import Payload
from truearm.description.urdf_names import UrdfNames
from truearm.errors import InputError
from truearm.fits.identified import IdentifiedArm
from truearm.robot import Robot

LINK = """
[[link]]
joint = "revolute"
theta = 0.0
d = 100.0
a = 50.0
alpha = 90.0
"""
HEAD = 'name = "arm"\nconvention = "standard"\nlength_unit = "mm"\nangle_unit = "deg"\n'


def arm(tail: str = "", head: str = HEAD, links: str = LINK * 2) -> Robot:
    return Robot.from_toml(head + links + tail, where="arm.toml")


def test_units_become_si() -> None:
    robot = arm()
    np.testing.assert_allclose(robot.table, [[0, 0.1, 0.05, np.pi / 2, 0]] * 2, rtol=0, atol=0)
    metres = arm(
        head=HEAD.replace("mm", "m").replace("deg", "rad"),
        links=LINK.replace("100.0", "1.0").replace("90.0", "1.5") * 2,
    )
    np.testing.assert_array_equal(metres.table[0, [1, 3]], [1.0, 1.5])


def test_limits_are_degrees_for_revolute_and_lengths_for_prismatic() -> None:
    slide = LINK.replace("revolute", "prismatic") + "limits = [0, 210]\n"
    robot = arm(links=LINK + "limits = [-90, 180]\n" + slide + LINK)
    np.testing.assert_allclose(robot.limits, [[-np.pi / 2, np.pi], [0, 0.21], [-np.inf, np.inf]])


def test_paper_arm_has_the_forward_kinematics_of_the_fixtures(root: Path) -> None:
    path = root.parent / "shared" / "reference" / "rv_m2_fixtures.json"
    if not path.is_file():
        pytest.skip(f"no fixtures at {path}")
    fixtures = json.loads(path.read_text())
    position_mm = 1000 * Robot.load("rv-m2").position(fixtures["q_rad"])
    np.testing.assert_allclose(position_mm, fixtures["nominal_mm"], atol=1e-9)


def test_base_given_as_a_row_is_kept_as_one() -> None:
    robot = Robot.load("RV-M2")
    assert robot.base_row is not None
    np.testing.assert_allclose(robot.base_row, [np.pi / 2, 0.4, -0.08, np.pi, 0.0])
    assert arm().base_row is None


def test_another_base_is_not_the_row_of_the_first_one() -> None:
    robot, shift = Robot.load("RV-M2"), np.eye(4)
    shift[:3, 3] = [0.5, 0.0, 0.2]
    moved, q = replace(robot, base=shift @ robot.base), np.full(5, 0.1)
    assert moved.base_row is None
    for made in (moved, Robot.from_toml(moved.to_toml()), Robot.from_dict(moved.to_dict())):
        np.testing.assert_allclose(made.position(q), robot.position(q) + shift[:3, 3], atol=1e-12)
    values = moved.joints_from_readings(q[None])
    in_world = IdentifiedArm(moved, "world").flange_chain.pose(values)
    np.testing.assert_allclose(in_world, moved.flange_chain.pose(values), atol=1e-12)
    assert replace(robot, name="other").base_row is not None


def test_direction_and_coupling_make_joint_values_from_readings() -> None:
    """q_dh = matrix . (direction * reading)."""
    robot = arm("[coupling]\nmatrix = [[1, 0], [1, 1]]\n", links=LINK + LINK + "direction = -1\n")
    np.testing.assert_array_equal(robot.joints_from_readings([0.3, 0.1]), [0.3, 0.3 - 0.1])
    plain = arm()
    q = np.random.default_rng(0).uniform(-1, 1, (9, 2))
    np.testing.assert_allclose(robot.pose(q), plain.pose(robot.joints_from_readings(q)), atol=1e-15)
    np.testing.assert_allclose(robot.readings_from_joints(robot.joints_from_readings(q)), q, atol=1e-15)


@pytest.mark.parametrize("name", ["fanuc-lr-mate-200id", "kuka-kr-6-r900", "adept-cobra-600", "franka-panda"])
def test_joint_jacobian_is_with_respect_to_readings(name: str) -> None:
    robot, step = Robot.load(name), 1e-6
    q = np.random.default_rng(4).uniform(-1, 1, robot.joint_count)
    for joint in range(robot.joint_count):
        ahead, behind = q.copy(), q.copy()
        ahead[joint] += step
        behind[joint] -= step
        slope = (robot.position(ahead) - robot.position(behind)) / (2 * step)
        np.testing.assert_allclose(robot.joint_jacobian(q)[:, joint], slope, atol=1e-8)


def test_parameter_jacobian_against_a_changed_table() -> None:
    robot, step = Robot.load("ur10"), 1e-6
    q = np.linspace(-1, 1, 6)
    jacobian = robot.parameter_jacobian(q)
    assert jacobian.shape == (3, 30)
    for k in (0, 7, 13, 29):
        change = np.zeros(30)
        change[k] = step
        ahead, behind = (
            {**robot.to_dict(), "table": (robot.table + s * change.reshape(6, 5)).tolist()} for s in (1, -1)
        )
        slope = (Robot.from_dict(ahead).position(q) - Robot.from_dict(behind).position(q)) / (2 * step)
        np.testing.assert_allclose(jacobian[:, k], slope, atol=1e-8)


def test_shapes_follow_the_readings() -> None:
    robot = Robot.load("ur5")
    one, many = np.zeros(6), np.zeros((4, 6))
    assert robot.position(one).shape == (3,)
    assert robot.pose(one).shape == (4, 4)
    assert robot.position(many).shape == (4, 3)
    assert robot.pose(many).shape == (4, 4, 4)
    assert robot.parameter_jacobian(many, pose=True).shape == (4, 6, 30)
    assert robot.joint_jacobian(one, pose=True).shape == (6, 6)
    assert robot.position(np.empty((0, 6))).shape == (0, 3)


def test_out_is_written_to() -> None:
    robot, q = Robot.load("ur5"), np.random.default_rng(5).uniform(-1, 1, (7, 6))
    out = np.empty((7, 3))
    assert robot.position(q, out=out) is out
    np.testing.assert_array_equal(out, robot.position(q))
    single = np.empty(3)
    robot.position(q[0], out=single)
    np.testing.assert_array_equal(single, out[0])


@pytest.mark.parametrize(
    ("out", "message"),
    [
        (np.zeros(3), r"has shape \(3,\)\. .*with shape \(2, 3\)"),
        (np.zeros((2, 3), dtype=np.float32), "is an array of float32"),
        (np.zeros((2, 3), order="F"), "is not C-contiguous"),
        (np.broadcast_to(0.0, (2, 3)), "is read-only"),
        ([[0.0] * 3] * 2, "is of type list"),
    ],
)
def test_what_results_cannot_be_written_to_is_told(out: Any, message: str) -> None:
    with pytest.raises(InputError, match=f"out {message}"):
        Robot.load("ur5").position(np.zeros((2, 6)), out=out)
    with pytest.raises(InputError, match=r"writable array of float64 with shape \(6, 30\)"):
        Robot.load("ur5").parameter_jacobian(np.zeros(6), pose=True, out=out)


def test_results_are_not_written_over_the_readings() -> None:
    robot = Robot.load("ur5")
    readings = np.random.default_rng(5).uniform(-1, 1, (4, 6))
    held, before = readings.reshape(-1)[:12].reshape(4, 3), readings.copy()
    with pytest.raises(InputError, match="shares memory.*in memory of its own"):
        robot.position(readings, out=held)
    np.testing.assert_array_equal(readings, before)
    anywhere = np.zeros(4 * 3 * 8 + 1, dtype=np.uint8)[1:].view(np.float64).reshape(4, 3)
    with pytest.raises(InputError, match="out is not aligned"):
        robot.position(readings, out=anywhere)


@pytest.mark.parametrize(
    ("q", "message"),
    [
        (np.zeros(5), r"shape \(5,\).*must be \(n, 6\), or \(6,\)"),
        (np.zeros((2, 3, 6)), "shape"),
        (0.0, "shape"),
        ([0, 0, np.nan, 0, 0, 0], "NaN or infinite values in row 0"),
        (["a"] * 6, "are not real numbers"),
        ([[0] * 6, [0] * 5], "are not real numbers"),
    ],
)
def test_readings_are_checked_at_the_door(q: Any, message: str) -> None:
    with pytest.raises(InputError, match=f"joint readings of UR5.*{message}|{message}"):
        Robot.load("ur5").position(q)


@pytest.mark.parametrize("table", ["x", [[1.0], [1.0, 2.0]], {}])
def test_a_dictionary_without_numbers_is_refused(table: object) -> None:
    with pytest.raises(InputError, match=r"values of table are not real numbers"):
        Robot.from_dict({**Robot.load("ur10").to_dict(), "table": table})


def test_a_dictionary_with_a_flange_that_is_not_rigid_is_refused() -> None:
    with pytest.raises(InputError, match="values of flange are not rigid"):
        Robot.from_dict({**Robot.load("ur10").to_dict(), "flange": np.diag([1.0, 1.5, 1.0, 1.0]).tolist()})


def test_transforms_that_are_not_rigid_are_refused_and_last_rows_made_exact() -> None:
    robot = Robot.load("ur10")
    with pytest.raises(InputError, match="tool: no rigid motion: R mirrors"):
        replace(robot, tool=np.diag([1.0, 1.0, -1.0, 1.0]))
    nearly = robot.pose(np.ones(6))
    nearly[3, 0] = 1e-17
    np.testing.assert_array_equal(replace(robot, tool=nearly).tool[3], [0.0, 0.0, 0.0, 1.0])


def test_robots_that_are_equal_have_one_hash() -> None:
    robot = Robot.load("ur10")
    other = replace(robot, table=np.where(robot.table == 0.0, -0.0, robot.table))
    assert other == robot
    assert hash(other) == hash(robot)


@pytest.mark.parametrize("name", library_names())
def test_dictionary_and_toml_bring_back_the_same_robot(name: str) -> None:
    robot = Robot.load(name)
    assert Robot.from_dict(json.loads(json.dumps(robot.to_dict(), allow_nan=False))) == robot
    assert Robot.from_toml(robot.to_toml()) == robot


numbers = st.floats(-3.0, 3.0)


@given(
    table=st.lists(st.tuples(*[numbers] * 5), min_size=2, max_size=2),
    coupling=st.sampled_from([np.eye(2), np.diag([1.0, -1.0]), np.array([[1.0, 0.0], [0.7, -1.0]])]),
    text=st.text(min_size=1).filter(lambda t: "\r" not in t),
    limits=st.sampled_from([(-np.inf, np.inf), (-1.0, 2.0), (-1.0, np.inf), (-np.inf, 2.0)]),
)
def test_any_robot_comes_back_bit_for_bit(table: Any, coupling: Any, text: str, limits: Any) -> None:
    robot = Robot(
        name=text,
        source=text,
        convention="modified",
        joints=("revolute", "prismatic"),
        table=np.array(table),
        base=np.eye(4),
        flange=np.eye(4),
        tool=np.eye(4),
        base_row=None,
        coupling=coupling,
        limits=np.array([limits, [-0.1, 0.2]]),
        payload=Payload(2.5, (1.0, 2.0, 3.0)),
        urdf_names=UrdfNames(text, ("j1", text), (text, "l2"), "tip"),
    )
    assert Robot.from_dict(json.loads(json.dumps(robot.to_dict()))) == robot
    assert Robot.from_toml(robot.to_toml()) == robot


def test_transforms_by_quaternion() -> None:
    robot = arm("[tool]\nxyz = [0, 0, 100]\nquaternion_wxyz = [0.7071, 0, 0.7071, 0]\n")
    np.testing.assert_allclose(robot.tool[:3, 3], [0, 0, 0.1])
    np.testing.assert_allclose(robot.tool[:3, :3], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-15)
    np.testing.assert_allclose(robot.pose([0, 0]), robot.flange_chain.pose(np.zeros((1, 2)))[0] @ robot.tool)


def test_arrays_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        Robot.load("ur5").table[0, 0] = 1.0


@pytest.mark.parametrize("name", ["UR10", "ur 10", "Ur-10", "rv_m2", "KUKA KR 6 R900"])
def test_library_names_forgive_case_and_separators(name: str) -> None:
    assert Robot.load(name).joint_count in (5, 6)


def test_unknown_names_bring_the_nearest() -> None:
    with pytest.raises(InputError, match=r'no robot "ur12" .*Did you mean .*"ur10".*truearm robots'):
        Robot.load("ur12")


def test_a_table_alone_makes_a_robot() -> None:
    known = Robot.load("abb-irb-120")
    plain = replace(known, source="", base_row=None, base=np.eye(4), flange=np.eye(4), tool=np.eye(4))
    plain = replace(plain, coupling=np.eye(6))
    assert Robot.from_table(known.name, known.table[:, :4], limits=known.limits) == plain
    assert np.isinf(Robot.from_table("Mine", known.table).limits).all()
    turned = Robot.from_table("Mine", known.table, coupling=np.diag([1, 1, 1, 1, 1, -1]))
    q = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    np.testing.assert_allclose(turned.joints_from_readings(q), q * [1, 1, 1, 1, 1, -1])
    slide = Robot.from_table("Mine", [[0, 0.1, 0, 0]], joints=["prismatic"], convention="modified")
    np.testing.assert_allclose(slide.position([0.2]), [0, 0, 0.3])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"table": np.zeros((6, 3))}, r"table: shape \(6, 3\).*theta, d, a, alpha for each link, \(N, 4\)"),
        ({"table": np.zeros(4)}, r"table: shape \(4,\)"),
        ({"table": [["a"] * 4]}, "values of table are not real numbers"),
        ({"joints": ["revolute"]}, "joints: 1 joint. The table has 2, one a row"),
        ({"table": [[90.0, 0, 0, 0], [0, 0, 0, 90.0]]}, "rad"),
        ({"limits": [[-1, 1]]}, r"limits: shape \(1, 2\)"),
    ],
)
def test_what_is_no_table_of_an_arm_is_refused(given: dict[str, Any], message: str) -> None:
    table = given.pop("table", [[0, 0.1, 0, 0], [0, 0, 0.3, 0]])
    with pytest.raises(InputError, match=message):
        Robot.from_table("Mine", table, **given)


@pytest.mark.parametrize("name", ["", "arm \udc80"])
def test_a_name_that_no_file_can_hold_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="The name is"):
        replace(Robot.load("ur5"), name=name)


def test_where_numbers_come_from_may_be_left_out_of_a_dictionary() -> None:
    content = Robot.load("ur5").to_dict()
    del content["source"]
    assert Robot.from_dict(content) == replace(Robot.load("ur5"), source="")
