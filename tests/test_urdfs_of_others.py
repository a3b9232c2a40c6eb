"""URDFs as people publish them: frames beside the arm, grippers, names of other programs, open limits."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from truearm.errors import InputError
from truearm.robot import Robot

JOINTS = """
<joint name="stand" type="fixed"><parent link="base_link"/><child link="base"/></joint>
<joint name="turn" type="revolute"><parent link="base_link"/><child link="upper"/><origin xyz="0 0 0.3"/>
  <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
<joint name="lift" type="revolute"><parent link="upper"/><child link="hand"/><origin xyz="0.1 0 0"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
"""
LINKS = '<link name="base_link"/><link name="base"/><link name="upper"/><link name="hand"/>'
GRIPPER = """
<link name="left"/><link name="right"/>
<joint name="grip" type="prismatic"><parent link="hand"/><child link="left"/><axis xyz="0 1 0"/>
  <limit lower="0" upper="0.04" effort="1" velocity="1"/></joint>
<joint name="follow" type="prismatic"><parent link="hand"/><child link="right"/><axis xyz="0 -1 0"/>
  <limit lower="0" upper="0.04" effort="1" velocity="1"/><mimic joint="grip"/></joint>
"""


def arm(more: str = "") -> str:
    return f'<robot name="arm">{LINKS}{JOINTS}{more}</robot>'


def with_limit(kind: str, limit: str) -> Robot:
    joint = (
        f'<robot name="arm"><link name="a"/><link name="b"/><joint name="j" type="{kind}"><parent link="a"/>'
        f'<child link="b"/><axis xyz="0 0 1"/><limit {limit} effort="0" velocity="0"/></joint></robot>'
    )
    return Robot.from_urdf_text(joint)


def test_a_frame_that_is_fixed_to_the_base_is_no_end_of_the_arm() -> None:
    """ROS-Industrial puts a "base" beside the "base_link" of every arm: the tip need not be named."""
    robot = Robot.from_urdf_text(arm())
    assert robot.urdf_names is not None
    assert (robot.urdf_names.base_link, robot.urdf_names.tip_link) == ("base_link", "hand")
    still = arm().replace('type="revolute"', 'type="fixed"')
    with pytest.raises(InputError, match='no joint moves behind "base_link"'):
        Robot.from_urdf_text(still)


def test_an_arm_with_a_gripper_says_where_its_fingers_part() -> None:
    message = (
        'may end at "left" or "right". Their ways part at "hand". Name one, or any link before it, such as '
        "the flange"
    )
    with pytest.raises(InputError, match=message):
        Robot.from_urdf_text(arm(GRIPPER))
    assert Robot.from_urdf_text(arm(GRIPPER), tip_link="hand").joint_count == 2
    with pytest.raises(InputError, match=r'follows joint "grip".*End the chain before it: "FILE.urdf#hand"'):
        Robot.from_urdf_text(arm(GRIPPER), tip_link="right")


def test_of_many_ends_those_behind_most_joints_are_named() -> None:
    frames = "".join(
        f'<link name="f{k}"/><joint name="{k}" type="fixed"><parent link="upper"/>'
        f'<child link="f{k}"/></joint>'
        for k in range(12)
    )
    with pytest.raises(InputError, match='end at "hand", "f0", "f1", .* "f6" or 5 others') as caught:
        Robot.from_urdf_text(arm(frames))
    assert "f7" not in str(caught.value)


def test_a_base_that_drives_is_left_out_by_naming_the_link_behind_it() -> None:
    driven = arm('<link name="world"/>').replace(
        "</robot>",
        '<joint name="drive" type="floating"><parent link="world"/><child link="base_link"/></joint></robot>',
    )
    with pytest.raises(
        InputError, match=r'type is floating.*Begin the chain behind it: "FILE.urdf#base_link,hand"'
    ):
        Robot.from_urdf_text(driven)
    assert Robot.from_urdf_text(driven, "base_link", "hand").joint_count == 2


def test_what_is_not_read_may_be_as_it_likes(caplog: pytest.LogCaptureFixture) -> None:
    """Prefixes that nobody declared, shapes and masses with faults, motors without a limit."""
    odd = arm(
        '<link name="x"><visual><origin xyz="0 0"/></visual><inertial><mass/></inertial></link>'
    ).replace(
        'effort="1" velocity="1"/>',
        'effort="inf" velocity="" drake:acceleration="3"><drake:gear r="1"/></limit>',
    )
    robot = Robot.from_urdf_text(odd, "base_link")
    assert robot.table.tolist() == Robot.from_urdf_text(arm()).table.tolist()
    assert not caplog.records


@pytest.mark.parametrize(
    ("kind", "limit", "expected"),
    [
        ("revolute", 'lower="0" upper="0"', [-np.inf, np.inf]),
        ("revolute", "", [-np.inf, np.inf]),
        ("revolute", 'lower="-1e6" upper="1000000"', [-np.inf, np.inf]),
        ("revolute", 'lower="-inf" upper="inf"', [-np.inf, np.inf]),
        ("revolute", 'upper="3"', [0.0, 3.0]),
        ("prismatic", 'lower="-1e6" upper="0.5"', [-np.inf, 0.5]),
    ],
)
def test_limits_that_are_none(kind: str, limit: str, expected: list[float]) -> None:
    robot = with_limit(kind, limit)
    assert robot.limits.tolist() == [expected]
    assert Robot.from_toml(robot.to_toml()) == robot


@pytest.mark.parametrize(
    ("kind", "limit", "message"),
    [
        (
            "revolute",
            'lower="-170" upper="170"',
            r"limits -170 to 170 rad.*m and rad.*degrees, multiply them by pi/180",
        ),
        (
            "prismatic",
            'lower="0" upper="800"',
            r"limits 0 to 800 m\..*If these are millimetres, divide them by 1000",
        ),
        ("prismatic", 'lower="0" upper="2000"', r"limits 0 to 2000 m\..*millimetres"),
        ("prismatic", 'lower="2000" upper="3000"', r"limits 2000 to 3000 m\..*millimetres"),
        ("revolute", 'lower="1000" upper="3000"', r"limits 1000 to 3000 rad.*degrees"),
        ("revolute", 'lower="1" upper="1"', "limits 1 to 1. The lower limit must be below"),
        ("revolute", 'lower="-1" upper="nan"', 'upper="nan" of <limit> in line 1. It must be a number'),
    ],
)
def test_limits_of_another_unit_are_told(kind: str, limit: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        with_limit(kind, limit)


def test_the_way_out_of_xacro_has_one_ending() -> None:
    with pytest.raises(InputError, match=r"xacro arm.urdf.xacro > arm.urdf\."):
        Robot.load(Path("arm.urdf.xacro#tool0"))


def test_a_file_without_links_says_so() -> None:
    with pytest.raises(InputError, match="it has no links"):
        Robot.from_urdf_text('<robot name="arm"/>')


def test_columns_of_an_arm_without_its_gripper_say_how_to_end_the_chain(tmp_path: Path) -> None:
    table = tmp_path / "m.csv"
    table.write_text("q1,q2,x,y,z\n0,0,0,0,0\n")
    robot = Robot.from_urdf_text(arm(GRIPPER), tip_link="left")
    with pytest.raises(
        InputError, match=r"2 joint columns. The robot has 3 joints.*as FILE.urdf#BASE,TIP the links"
    ):
        ta.Measurements.read_csv(table, joints=robot.joints)


@pytest.mark.parametrize(
    ("rpy", "told"),
    [
        ("1.57 0 0", "by up to 0.8 mrad"),
        ("0 -1.571 3.142", "by up to 0.41 mrad"),
        ("3.14 0 0", "by up to 1.6 mrad"),
        ("0 0 1.5707", "by up to 0.096 mrad"),
        ("1.5708 -1.570796 3.1416", None),
        ("1.5703 0.5 1", None),
        ("1.58 3.15 0", None),
        ("1.5703124 1.2 1.5e0", None),
    ],
)
def test_rounded_right_angles_are_kept_and_told(rpy: str, told: str | None) -> None:
    joint = '<origin xyz="0.1 0 0"/>'
    robot = Robot.from_urdf_text(arm().replace(joint, f'<origin xyz="0.1 0 0" rpy="{rpy}"/>'))
    expected = Rotation.from_euler("xyz", [float(word) for word in rpy.split()]).as_matrix()
    np.testing.assert_allclose(robot.pose(np.zeros(2))[:3, :3], expected, atol=1e-12)
    assert robot.source.partition("; its right angles are rounded, ")[2] == (told or "")


def test_rounding_beside_the_chain_is_not_told() -> None:
    beside = '<link name="eye"/><joint name="e" type="fixed"><parent link="upper"/><child link="eye"/>'
    robot = Robot.from_urdf_text(arm(f'{beside}<origin rpy="1.57 0 0"/></joint>'), tip_link="hand")
    assert "rounded" not in robot.source
