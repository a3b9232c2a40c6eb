"""URDF chains: the Denavit-Hartenberg form has the very forward kinematics of the file."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from truearm.errors import InputError
from truearm.robot import Robot
from truearm.types import Floats

SPECIAL = ["0 0 1", "0 0 -1", "1 0 0", "0 -1 0", "0.6 0 0.8", "0.00001 0 1", "0 0.002 -1"]
QUARTERS = [0.0, np.pi / 2, -np.pi / 2, np.pi, 1.5708, -1.570796]
numbers = st.floats(-1.0, 1.0).map(lambda value: round(value, 4))
triples = st.tuples(numbers, numbers, numbers)
axes = st.one_of(
    st.sampled_from(SPECIAL),
    triples.filter(lambda t: sum(v * v for v in t) > 0.01).map(lambda t: f"{t[0]} {t[1]} {t[2]}"),
)
origins = st.one_of(
    st.just((0.0, 0.0, 0.0)),
    st.tuples(st.just(0.0), st.just(0.0), numbers),
    st.tuples(numbers, numbers, numbers),
)
angles = st.one_of(
    st.tuples(st.sampled_from(QUARTERS), st.sampled_from(QUARTERS), st.just(0.0)),
    st.tuples(*(st.floats(-3.0, 3.0),) * 3),
)
kinds = st.sampled_from(["revolute", "continuous", "prismatic", "fixed"])
joints = st.tuples(kinds, origins, angles, axes)


Joint = tuple[str, tuple[float, ...], tuple[float, ...], str]
Chain = Sequence[Joint]


def urdf(chain: Chain) -> str:
    parts = ['<robot name="arm"><link name="l0"/>']
    for i, (kind, xyz, rpy, axis) in enumerate(chain):
        parts.append(
            f'<link name="l{i + 1}"/><joint name="j{i}" type="{kind}">'
            f'<parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="{" ".join(map(repr, xyz))}" rpy="{" ".join(map(repr, rpy))}"/><axis xyz="{axis}"/>'
            '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
        )
    return "".join(parts) + "</robot>"


TURN = ("revolute", (0, 0, 0.1), (0, 0, 0), "0 0 1")
TWICE = '<joint name="{name}" type="revolute"><parent link="l0"/><child link="{child}"/></joint></robot>'
ONE_JOINT = urdf([("revolute", (0, 0, 0), (0, 0, 0), "0 0 1")])


def forward(chain: Chain, q: Floats) -> Floats:
    """The definition of a URDF: origin, then motion along or about the axis, joint by joint."""
    pose, values = np.eye(4), iter(q)
    for kind, xyz, rpy, axis in chain:
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = Rotation.from_euler("xyz", rpy).as_matrix(), xyz
        pose = pose @ step
        if kind == "fixed":
            continue
        unit = np.array(axis.split(), dtype=float)
        unit /= np.linalg.norm(unit)
        motion = np.eye(4)
        if kind == "prismatic":
            motion[:3, 3] = next(values) * unit
        else:
            motion[:3, :3] = Rotation.from_rotvec(next(values) * unit).as_matrix()
        pose = pose @ motion
    return pose


def load(tmp_path: Path, chain: Chain) -> Robot:
    path = tmp_path / "arm.urdf"
    path.write_text(urdf(chain))
    return Robot.from_urdf(path)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(chain=st.lists(joints, min_size=1, max_size=8), seed=st.integers(0, 2**32 - 1))
def test_any_chain_keeps_its_forward_kinematics(tmp_path: Path, chain: Chain, seed: int) -> None:
    chain = [
        *chain,
        ("revolute", (0.1, 0.0, 0.2), (0.0, 0.0, 0.0), "0 0 1"),
        ("fixed", (0.0, 0.0, 0.1), (0.3, 0.0, 0.0), "1 0 0"),
    ]
    robot = load(tmp_path, chain)
    moving = sum(kind != "fixed" for kind, *_ in chain)
    assert robot.joint_count == moving
    q = np.random.default_rng(seed).uniform(-2.0, 2.0, (5, moving))
    expected = np.array([forward(chain, row) for row in q])
    np.testing.assert_allclose(robot.pose(q), expected, atol=1e-9)


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(chain=st.lists(joints, min_size=2, max_size=6))
def test_no_row_is_far_away(tmp_path: Path, chain: Chain) -> None:
    """Near-parallel axes do not send a common normal a hundred metres off."""
    chain = [*chain, ("revolute", (0.1, 0.0, 0.2), (0.0, 0.0, 0.0), "0 0 1")]
    assert np.abs(load(tmp_path, chain).table[:, 1:3]).max() < 1000.0


def test_parallel_axes_have_beta_only_where_they_are_not_exactly_parallel(tmp_path: Path) -> None:
    z = ("revolute", (0.3, 0.0, 0.0), (0.0, 0.0, 0.0), "0 0 1")
    tilted = ("revolute", (0.3, 0.0, 0.0), (0.0, 1e-4, 0.0), "0 0 1")
    table = load(tmp_path, [z, z, tilted, z]).table
    np.testing.assert_allclose(table[:, 4], [0.0, 1e-4, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(table[:, 2], [0.3, 0.3, 0.3, 0.0], atol=1e-15)


def test_a_ur_urdf_gives_the_makers_table(tmp_path: Path) -> None:
    """Axes of a UR10 as its URDF has them come out with the d, a and alpha of the library."""
    chain = [
        ("revolute", (0.0, 0.0, 0.1273), (0.0, 0.0, 0.0), "0 0 1"),
        ("revolute", (0.0, 0.220941, 0.0), (0.0, np.pi / 2, 0.0), "0 1 0"),
        ("revolute", (0.0, -0.1719, 0.612), (0.0, 0.0, 0.0), "0 1 0"),
        ("revolute", (0.0, 0.0, 0.5723), (0.0, np.pi / 2, 0.0), "0 1 0"),
        ("revolute", (0.0, 0.1149, 0.0), (0.0, 0.0, 0.0), "0 0 1"),
        ("revolute", (0.0, 0.0, 0.1157), (0.0, 0.0, 0.0), "0 1 0"),
        ("fixed", (0.0, 0.0922, 0.0), (-np.pi / 2, 0.0, 0.0), "1 0 0"),
    ]
    table, library = load(tmp_path, chain).table, Robot.load("ur10").table
    np.testing.assert_allclose(np.abs(table[:, 1:4]), np.abs(library[:, 1:4]), atol=1e-12)


def test_the_parsers_own_kinematics_agree(tmp_path: Path) -> None:
    import yourdfpy

    rng = np.random.default_rng(3)
    places = rng.uniform(-3, 3, (6, 2, 3)).tolist()
    chain = [("revolute", tuple(xyz), tuple(rpy), "0 0.6 -0.8") for xyz, rpy in places]
    robot = load(tmp_path, chain)
    model = yourdfpy.URDF.load(str(tmp_path / "arm.urdf"), load_meshes=False)
    q = rng.uniform(-2, 2, 6)
    model.update_cfg(q)
    np.testing.assert_allclose(robot.pose(q), model.get_transform("l6", "l0"), atol=1e-9)


def test_limits_and_kinds(tmp_path: Path) -> None:
    xyz, rpy = (0.0, 0.0, 0.1), (0.0, 0.0, 0.0)
    robot = load(
        tmp_path,
        [
            ("revolute", xyz, rpy, "0 0 1"),
            ("continuous", xyz, rpy, "1 0 0"),
            ("prismatic", xyz, rpy, "0 0 1"),
        ],
    )
    assert robot.joints == ("revolute", "revolute", "prismatic")
    np.testing.assert_array_equal(robot.limits, [[-2, 2], [-np.inf, np.inf], [-2, 2]])


BRANCHED = """<robot name="arm"><link name="base"/><link name="a"/><link name="tool0"/><link name="camera"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="f1" type="fixed"><parent link="a"/><child link="tool0"/></joint>
<joint name="f2" type="fixed"><parent link="a"/><child link="camera"/></joint></robot>"""


def test_the_tip_is_chosen_behind_a_hash(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(BRANCHED)
    assert Robot.load(f"{path}#tool0").source == "arm.urdf, base to tool0"
    assert Robot.load(f"{path}#base,camera").joint_count == 1
    with pytest.raises(InputError, match='the chain may end at "tool0" or "camera"'):
        Robot.load(path)
    with pytest.raises(InputError, match=r'no link "tool1".*Did you mean "tool0"'):
        Robot.load(f"{path}#tool1")
    with pytest.raises(InputError, match='no joint moves between "a" and "camera"'):
        Robot.load(f"{path}#a,camera")
    with pytest.raises(InputError, match='"base" is not behind link "a"'):
        Robot.load(f"{path}#a,base")
    with pytest.raises(InputError, match='"base,a,camera" names 3 links.*its base link and its tip link'):
        Robot.load(f"{path}#base,a,camera")
    robot = Robot.load(f"{path}#base,camera")
    assert Robot.from_toml(robot.to_toml()) == robot


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<robot", "not XML: .*A URDF is an XML file"),
        ("<sdf/>", "the XML is a <sdf>"),
        ("", "not XML"),
        ('<robot name="a"><link name="b"/></robot>', "no joint moves"),
        ('<robot name="a"><joint name="j"/></robot>', 'joint "j": it has no type'),
        ('<robot name="a">\n<joint type="fixed"/></robot>', "line 2, a joint without a name: it has no name"),
        (ONE_JOINT.replace("<child", "<kid"), 'joint "j0": it has no child link'),
        (ONE_JOINT.replace('<link name="l0"/>', ""), 'its parent "l0" is no link of the file'),
        (ONE_JOINT.replace('xyz="0 0 0"', 'xyz="0 0"'), 'xyz="0 0" of <origin> in line .*3 finite numbers'),
        (ONE_JOINT.replace('rpy="0 0 0"', 'rpy="0 0 nan"'), 'rpy="0 0 nan".*3 finite numbers'),
        (ONE_JOINT.replace('rpy="0 0 0"', 'rpy="90 0 0"'), 'rpy="90 0 0" .*in rad: if these are degrees'),
        (
            urdf([TURN, TURN]).replace("</robot>", TWICE.format(name="j0", child="l2")),
            'joint "j0": it stands in line 1 and again in line 1. Every joint needs a name of its own',
        ),
        (ONE_JOINT.replace("</robot>", '<link name="l1"/></robot>'), 'link "l1" stands twice'),
        (
            urdf([TURN, TURN]).replace("</robot>", TWICE.format(name="rod", child="l2")),
            'link "l2" is the child of "j1" and "rod". One joint leads to a link',
        ),
        (ONE_JOINT.replace('lower="-2"', 'lower="low"'), 'lower="low" of <limit> in line .*a number'),
        (ONE_JOINT.replace('lower="-2"', 'lower="${-limit}"'), r"\$\{-limit\}.*is xacro.*Expand it first"),
        (ONE_JOINT.replace("<axis", "<xacro:axis"), "<xacro:axis> in line .* is xacro"),
        (urdf([("floating", (0, 0, 0), (0, 0, 0), "0 0 1")]), 'joint "j0": its type is floating'),
        (urdf([("revolute", (0, 0, 0), (0, 0, 0), "0 0 0")]), "has no direction"),
        (ONE_JOINT.replace('lower="-2"', 'lower="3"'), "limits 3 to 2"),
        (ONE_JOINT.replace("<axis", '<mimic joint="x"/><axis'), 'follows joint "x".*coupling'),
    ],
)
def test_bad_files_are_explained(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(content)
    with pytest.raises(InputError, match=message) as caught:
        Robot.from_urdf(path)
    assert str(caught.value).startswith(str(path))


def test_xacro_is_told_apart() -> None:
    with pytest.raises(InputError, match=r"xacro macro.*Expand it first"):
        Robot.load(Path("arm.urdf.xacro"))


def test_a_urdf_in_millimetres_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mm.urdf"
    path.write_text(urdf([("revolute", (0.0, 0.0, 425.0), (0.0, 0.0, 0.0), "0 0 1")]))
    with pytest.raises(InputError, match=r"425 m from the joint before.*longer than 50 m.*divide all xyz"):
        Robot.load(path)


def test_measurements_in_the_place_of_a_robot_are_told(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text("q1,x,y,z\n0,1,2,3\n")
    with pytest.raises(InputError, match="table of measurements.*calibrate ROBOT MEASUREMENTS"):
        Robot.load(path)


def test_a_urdf_that_names_no_robot_is_called_after_its_file():
    joint = '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>{}</joint>'
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    text = f'<robot><link name="a"/><link name="b"/>{joint.format(limit)}</robot>'
    found = Robot.from_urdf_text(text, where="arm.urdf")
    assert Robot.from_toml(found.to_toml()).name == "arm.urdf"
