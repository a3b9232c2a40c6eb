"""What section 6 of the paper states: arm, spaces, paths, network, sizes of errors."""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from truearm.planning.spaces import JointSpace, Space, SphericalSpace
from truearm.robot import Robot
from truearm.simulation import Imperfections, VirtualArm
from truearm.types import Floats

ROBOT: Final = "rv-m2"
SHOULDER_M: Final = (0.0, -0.08, 0.4)
"""Origin of the spherical coordinates: where joint 1's axis meets the shoulder's height. From there the arm
reaches 805 mm, the largest R of Figure 4(c)."""
SPHERE_LOW: Final = (0.500, -150.0, -45.0)
SPHERE_HIGH: Final = (0.805, 150.0, 45.0)
JOINT_PATH_DEG: Final = ((60.0, 60.0, -35.0), (125.0, 90.0, -10.0))
SPHERE_PATH: Final = ((0.640, 20.0, 0.0), (0.740, 125.0, -20.0))
PATH_POINTS: Final = 200
WORKSPACE_POSES: Final = 3000
JOINT_REGIONS: Final = 110
SPHERE_REGIONS: Final = 130
TEST_POINTS: Final = 10
CANDIDATES: Final = 100
FREE_TO_STOP: Final = 1024
DEMANDED_M: Final = 0.1e-3
NOISE_MM: Final = 0.04
SHARE: Final = 0.09
MEMBERSHIPS: Final = 3
CELLS: Final = {"joint": (17, 11, 11), "sphere": (11, 17, 11), "cartesian": (17, 11, 11)}

Kind = Literal["joint", "sphere", "cartesian"]


@dataclass(frozen=True)
class Reading:
    """How the paper's errors are read.

    Attributes:
        signs: Of the fifteen parameters' errors.
        non_geometric: What equation (6) is an error of.
    """

    signs: Literal["random", "positive"] = "positive"
    non_geometric: Literal["cartesian", "joint"] = "cartesian"

    @property
    def name(self) -> str:
        """For keys of paper.json."""
        return f"{self.signs}_{self.non_geometric}"

    @property
    def words(self) -> str:
        """For people."""
        signs = "random signs" if self.signs == "random" else "all errors positive"
        return f"{signs}, equation (6) as {self.non_geometric.replace('cart', 'Cart')} errors"


MAIN_READING: Final = Reading()
"""Only positive errors leave what Figure 6(a) shows; of equation (6) it tells nothing."""
READINGS: Final = (
    MAIN_READING,
    Reading("positive", "joint"),
    Reading("random", "cartesian"),
    Reading("random", "joint"),
)


def paper_arm(seed: int, reading: Reading) -> VirtualArm:
    """The paper's RV-M2 with its errors; noise is added by those who measure."""
    wrong = Imperfections(
        share=SHARE, non_geometric=reading.non_geometric, signs=reading.signs, noise_mm=NOISE_MM
    )
    return VirtualArm.paper(seed=seed, imperfections=wrong)


def space_of(kind: Kind) -> Space:
    """The joint space of Figure 6, or the spherical space of Figure 7."""
    robot = Robot.load(ROBOT)
    if kind == "joint":
        return JointSpace(robot)
    return SphericalSpace(robot, _sphere(SPHERE_LOW), _sphere(SPHERE_HIGH), SHOULDER_M)


def path_of(kind: Kind) -> Floats:
    """Coordinates (200, 3) of the paper's path in that space."""
    ends = np.deg2rad(JOINT_PATH_DEG) if kind == "joint" else np.stack([_sphere(p) for p in SPHERE_PATH])
    return straight(ends[0], ends[1])


def straight(begin: Floats, end: Floats) -> Floats:
    """Points (200, D) of a straight line."""
    return np.linspace(begin, end, PATH_POINTS)


def _sphere(point: tuple[float, float, float]) -> Floats:
    radius, theta, phi = point
    return np.array([radius, np.deg2rad(theta), np.deg2rad(phi)])
