"""The library of arms against what their makers publish of them, written down here as screws.

Each arm is given once more, independently of its Denavit-Hartenberg table: where its axes are and which way
they turn at zero readings, and where its flange is, straight from the dimension drawings. The product of
exponentials of these screws must be the library's forward kinematics.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from truearm.description.library import library_names
from truearm.robot import Robot
from truearm.types import Floats

X, Y, Z = np.eye(3)


@dataclass
class Drawing:
    """Axes as (direction, point in mm) at zero readings, flange point in mm and its axes as columns."""

    axes: list[tuple[Floats, tuple[float, float, float]]]
    flange_mm: tuple[float, float, float]
    flange_axes: tuple[Floats, Floats, Floats] = (X, Y, Z)
    prismatic: tuple[int, ...] = ()

    def pose(self, q: Floats) -> Floats:
        pose = np.eye(4)
        for joint, ((direction, point), value) in enumerate(zip(self.axes, q, strict=True)):
            motion = np.eye(4)
            if joint in self.prismatic:
                motion[:3, 3] = value * np.asarray(direction)
            else:
                turn = Rotation.from_rotvec(value * np.asarray(direction)).as_matrix()
                centre = np.array(point) / 1000
                motion[:3, :3], motion[:3, 3] = turn, centre - turn @ centre
            pose = pose @ motion
        home = np.eye(4)
        home[:3, :3], home[:3, 3] = np.column_stack(self.flange_axes), np.array(self.flange_mm) / 1000
        return pose @ home


def ur(d1: float, a2: float, a3: float, d4: float, d5: float, d6: float) -> Drawing:
    """A UR at zero readings lies stretched out along -x, the wrist to the -y side."""
    reach = -(a2 + a3)
    return Drawing(
        [
            (Z, (0, 0, 0)),
            (-Y, (0, 0, d1)),
            (-Y, (-a2, 0, d1)),
            (-Y, (reach, 0, d1)),
            (-Z, (reach, -d4, d1)),
            (-Y, (reach, -d4, d1 - d5)),
        ],
        (reach, -d4 - d6, d1 - d5),
        (X, Z, -Y),
    )


def abb(height: float, upper: float, elbow: float, forearm: float, wrist: float) -> Drawing:
    return Drawing(
        [
            (Z, (0, 0, 0)),
            (Y, (0, 0, height)),
            (Y, (0, 0, height + upper)),
            (X, (0, 0, height + upper + elbow)),
            (Y, (forearm, 0, height + upper + elbow)),
            (X, (0, 0, height + upper + elbow)),
        ],
        (forearm + wrist, 0, height + upper + elbow),
        (-Z, Y, X),
    )


def iiwa(shoulder: float, elbow: float, wrist: float, flange: float) -> Drawing:
    elbow, wrist = shoulder + elbow, shoulder + elbow + wrist
    axes = [(Z, 0), (Y, shoulder), (Z, 0), (-Y, elbow), (Z, 0), (Y, wrist), (Z, 0)]
    return Drawing([(axis, (0, 0, height)) for axis, height in axes], (0, 0, wrist + flange))


DRAWINGS = {
    "ur3": ur(151.9, 243.65, 213.25, 112.35, 85.35, 81.9),
    "ur3e": ur(151.85, 243.55, 213.2, 131.05, 85.35, 92.1),
    "ur5": ur(89.159, 425, 392.25, 109.15, 94.65, 82.3),
    "ur5e": ur(162.5, 425, 392.2, 133.3, 99.7, 99.6),
    "ur10": ur(127.3, 612, 572.3, 163.941, 115.7, 92.2),
    "ur10e": ur(180.7, 612.7, 571.55, 174.15, 119.85, 116.55),
    "abb-irb-120": abb(290, 270, 70, 302, 72),
    "abb-irb-1200": abb(399.1, 448, 42, 451, 82),
    "kuka-iiwa-7": iiwa(340, 400, 400, 126),
    "kuka-iiwa-14": iiwa(360, 420, 400, 126),
    "kuka-kr-6-r900": Drawing(
        [
            (-Z, (0, 0, 0)),
            (Y, (25, 0, 400)),
            (Y, (480, 0, 400)),
            (-X, (0, 0, 435)),
            (Y, (900, 0, 435)),
            (-X, (0, 0, 435)),
        ],
        (980, 0, 435),
        (-Z, Y, X),
    ),
    "fanuc-lr-mate-200id": Drawing(
        [
            (Z, (0, 0, 0)),
            (Y, (50, 0, 0)),
            (-Y, (50, 0, 330)),
            (-X, (0, 0, 365)),
            (-Y, (385, 0, 365)),
            (-X, (0, 0, 365)),
        ],
        (465, 0, 365),
        (Z, -Y, X),
    ),
    "staubli-tx2-90l": Drawing(
        [
            (Z, (0, 0, 0)),
            (Y, (50, 0, 0)),
            (Y, (50, 0, 500)),
            (Z, (50, 50, 0)),
            (Y, (50, 50, 1050)),
            (Z, (50, 50, 0)),
        ],
        (50, 50, 1150),
    ),
    "mitsubishi-rv-4fl": Drawing(
        [
            (Z, (0, 0, 0)),
            (Y, (0, 0, 350)),
            (Y, (0, 0, 660)),
            (Z, (-50, 0, 0)),
            (Y, (-50, 0, 995)),
            (Z, (-50, 0, 0)),
        ],
        (-50, 0, 1080),
    ),
    "puma-560": Drawing(
        [
            (Z, (0, 0, 0)),
            (-Y, (0, 0, 0)),
            (-Y, (431.8, 0, 0)),
            (Z, (452.1, -150.05, 0)),
            (-Y, (452.1, -150.05, 431.8)),
            (Z, (452.1, -150.05, 0)),
        ],
        (452.1, -150.05, 431.8),
    ),
    "franka-panda": Drawing(
        [
            (Z, (0, 0, 0)),
            (Y, (0, 0, 333)),
            (Z, (0, 0, 0)),
            (-Y, (82.5, 0, 649)),
            (Z, (0, 0, 0)),
            (-Y, (0, 0, 1033)),
            (-Z, (88, 0, 0)),
        ],
        (88, 0, 926),
        (X, -Y, -Z),
    ),
    "adept-cobra-600": Drawing(
        [(Z, (0, 0, 0)), (Z, (325, 0, 0)), (-Z, (0, 0, 0)), (-Z, (600, 0, 0))],
        (600, 0, 387),
        (X, -Y, -Z),
        prismatic=(2,),
    ),
    "rv-m2": Drawing(
        [
            (-Z, (0, -80, 400)),
            (X, (0, 40, 400)),
            (X, (0, 290, 400)),
            (Z, (0, 555, 0)),
            (X, (0, 555, 400)),
        ],
        (0, 725, 400),
        (Y, Z, X),
    ),
}
WRIST_REACH_MM = {
    "abb-irb-120": 580,
    "abb-irb-1200": 901,
    "kuka-kr-6-r900": 901,
    "fanuc-lr-mate-200id": 717,
    "mitsubishi-rv-4fl": 649,
    "staubli-tx2-90l": 1100,
}


def test_every_arm_of_the_library_has_a_drawing() -> None:
    assert set(library_names()) == set(DRAWINGS)


@pytest.mark.parametrize("name", DRAWINGS)
def test_forward_kinematics_follow_the_drawing(name: str) -> None:
    robot, drawing = Robot.load(name), DRAWINGS[name]
    low, high = np.clip(robot.limits, -np.pi, np.pi).T
    q = np.random.default_rng(1).uniform(low, high, (50, robot.joint_count))
    turned = q.copy()
    if name == "fanuc-lr-mate-200id":  # J3 is read against the horizontal: J2 turns joint 3 along
        turned[:, 2] += q[:, 1]
    expected = np.array([drawing.pose(row) for row in turned])
    np.testing.assert_allclose(robot.pose(q), expected, atol=1e-12)


def test_fanuc_forearm_keeps_its_direction_when_j2_alone_moves() -> None:
    robot = Robot.load("fanuc-lr-mate-200id")
    before, after = robot.pose(np.array([[0, 0.0, 0, 0, 0, 0], [0, 0.7, 0, 0, 0, 0]]))
    np.testing.assert_allclose(before[:3, :3], after[:3, :3], atol=1e-15)


@pytest.mark.parametrize("name", library_names())
def test_every_arm_says_where_its_numbers_come_from_and_has_limits(name: str) -> None:
    robot = Robot.load(name)
    assert len(robot.source) > 20
    assert np.isfinite(robot.limits).all(axis=1).sum() >= robot.joint_count - 1
    assert (robot.limits[:, 0] < robot.limits[:, 1]).all()


@pytest.mark.parametrize(("name", "reach_mm"), WRIST_REACH_MM.items())
def test_wrist_reaches_as_far_as_the_data_sheet_says(name: str, reach_mm: float) -> None:
    """Published reach: from the axis of joint 1 to the centre of the wrist, arm stretched out."""
    table = 1000 * Robot.load(name).table
    stretched = table[0, 2] + table[1, 2] + np.hypot(table[2, 2], table[3, 1])
    assert stretched == pytest.approx(reach_mm, abs=0.6)
