"""How the numbers of a target stand for joint readings or for a pose, and back."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Final, Literal, Protocol, TypeGuard

import numpy as np

from truearm.rotations import (
    euler_from_matrix,
    matrix_from_euler,
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    quaternion_from_matrix,
    rotation_vector_from_matrix,
)
from truearm.types import Floats
from truearm.units import FULL_TURN, MM_PER_METRE, RADIANS_PER_DEGREE

HALF_TURN_DEG: Final = 180.0
LOCKED: Final = 1e-7
NO_WORDS: Final[Mapping[int, tuple[str, ...]]] = MappingProxyType({})
DECIMALS_MM, DECIMALS_M, DECIMALS_DEG, DECIMALS_RAD, DECIMALS_QUATERNION = 3, 6, 4, 6, 7


class _InNumbers(Protocol):
    """What is told of the numbers of a target, whatever they stand for."""

    @property
    def width(self) -> int:
        """How many numbers a target has, those of the configuration included."""
        ...

    @property
    def configuration(self) -> int:
        """How many of them, the last ones, tell the branch and the turns."""
        ...

    @property
    def least_decimals(self) -> Sequence[int]:
        """Digits behind the point that are written at least, (width,)."""
        ...

    @property
    def words(self) -> Mapping[int, tuple[str, ...]]:
        """What numbers that are written as words can be, by column."""
        ...


class JointLayout(_InNumbers, Protocol):
    """Numbers that stand for joint readings; none of them is of a configuration."""

    @property
    def kind(self) -> Literal["joints"]:
        """What the numbers stand for."""
        ...

    def to_readings(self, values: Floats) -> Floats:
        """Readings (n, N), rad and m, of numbers (n, width)."""
        ...

    def from_readings(self, q: Floats, near: Floats) -> Floats:
        """Numbers (n, width) of readings (n, N); `near` are those that the text has."""
        ...


class PoseLayout(_InNumbers, Protocol):
    """Numbers that stand for a pose: its six or seven, then the integers of its configuration."""

    @property
    def kind(self) -> Literal["pose"]:
        """What the numbers stand for."""
        ...

    def to_poses(self, values: Floats) -> Floats:
        """Poses (n, 4, 4), m, of numbers (n, width - configuration)."""
        ...

    def from_poses(self, poses: Floats, near: Floats) -> Floats:
        """Numbers (n, width - configuration) of poses, in the notation nearest to `near`."""
        ...


Layout = JointLayout | PoseLayout


def of_pose(layout: Layout) -> TypeGuard[PoseLayout]:
    """Whether the numbers of a layout stand for a pose."""
    return layout.kind == "pose"


def of_joints(layout: Layout) -> TypeGuard[JointLayout]:
    """Whether the numbers of a layout stand for joint readings."""
    return layout.kind == "joints"


@dataclass(frozen=True)
class Joints:
    """One number a joint, in the arm's order: deg or rad for revolute, mm or m for prismatic ones.

    Attributes:
        units: What one unit of each number is in rad or m, (N,).
        least_decimals: As in JointLayout.
    """

    kind: ClassVar[Literal["joints"]] = "joints"
    configuration: ClassVar[int] = 0
    words: ClassVar[Mapping[int, tuple[str, ...]]] = NO_WORDS
    units: tuple[float, ...]
    least_decimals: tuple[int, ...]

    @classmethod
    def of(cls, joints: Sequence[str], *, degrees: bool = True, millimetres: bool = True) -> "Joints":
        """For an arm's `joints`, each "revolute" or "prismatic"."""
        angle = (RADIANS_PER_DEGREE, DECIMALS_DEG) if degrees else (1.0, DECIMALS_RAD)
        length = (1.0 / MM_PER_METRE, DECIMALS_MM) if millimetres else (1.0, DECIMALS_M)
        chosen = [angle if joint == "revolute" else length for joint in joints]
        return cls(tuple(unit for unit, _ in chosen), tuple(decimals for _, decimals in chosen))

    @property
    def width(self) -> int:
        """One number a joint."""
        return len(self.units)

    def to_readings(self, values: Floats) -> Floats:
        """As in JointLayout."""
        readings: Floats = values * np.array(self.units) if self._scaled else values
        return readings

    def from_readings(self, q: Floats, near: Floats) -> Floats:
        """As in JointLayout."""
        values: Floats = q / np.array(self.units) if self._scaled else q
        return values

    @property
    def _scaled(self) -> bool:
        return any(unit != 1.0 for unit in self.units)


@dataclass(frozen=True)
class EulerPose:
    """X Y Z in mm and three angles in deg, of the rotation Rz Ry Rx.

    Attributes:
        columns: Which of the three numbers behind X Y Z turns about z, y and x: (0, 1, 2) for KUKA's A B C,
            (2, 1, 0) for W P R and for Mitsubishi's A B C.
        configuration: As in PoseLayout.
    """

    kind: ClassVar[Literal["pose"]] = "pose"
    words: ClassVar[Mapping[int, tuple[str, ...]]] = NO_WORDS
    columns: tuple[int, int, int] = (0, 1, 2)
    configuration: int = 0

    @property
    def width(self) -> int:
        """Six and the configuration."""
        return 6 + self.configuration

    @property
    def least_decimals(self) -> tuple[int, ...]:
        """As in PoseLayout."""
        return (DECIMALS_MM,) * 3 + (DECIMALS_DEG,) * 3 + (0,) * self.configuration

    def to_poses(self, values: Floats) -> Floats:
        """As in PoseLayout."""
        angles = np.deg2rad(values[:, 3:6][:, self.columns])
        return _poses(values[:, :3] * 1e-3, matrix_from_euler(angles, "ZYX"))

    def from_poses(self, poses: Floats, near: Floats) -> Floats:
        """As in PoseLayout: of the two triples of angles and their full turns the one nearest to `near`.

        Angles within half a turn stay within it: not every controller may take 180.1 where it had 180.
        """
        wanted = near[:, 3:6][:, self.columns]
        angles = _nearest_angles(poses[:, :3, :3], np.deg2rad(wanted))
        written = np.empty((len(poses), 6))
        written[:, :3] = poses[:, :3, 3] * MM_PER_METRE
        written[:, [3 + column for column in self.columns]] = np.rad2deg(angles)
        beyond = (np.abs(written) > HALF_TURN_DEG) & (np.abs(near[:, :6]) <= HALF_TURN_DEG)
        return np.where(beyond, within_half_turn(self, written), written)


def within_half_turn(layout: Layout, values: Floats) -> Floats:
    """Numbers (n, width) of poses with angles beyond -180 and 180 deg a turn back; others as they are."""
    if not isinstance(layout, EulerPose):
        return values
    within = np.array(values)
    within[:, 3:6] -= 2.0 * HALF_TURN_DEG * np.ceil((values[:, 3:6] / HALF_TURN_DEG - 1.0) / 2.0)
    return within


@dataclass(frozen=True)
class QuaternionPose:
    """X Y Z in mm and a quaternion, w first; the sign is that of the text."""

    kind: ClassVar[Literal["pose"]] = "pose"
    words: ClassVar[Mapping[int, tuple[str, ...]]] = NO_WORDS
    configuration: int = 0

    @property
    def width(self) -> int:
        """Seven and the configuration."""
        return 7 + self.configuration

    @property
    def least_decimals(self) -> tuple[int, ...]:
        """As in PoseLayout."""
        return (DECIMALS_MM,) * 3 + (DECIMALS_QUATERNION,) * 4 + (0,) * self.configuration

    def to_poses(self, values: Floats) -> Floats:
        """As in PoseLayout; a quaternion is scaled to unit length first."""
        return _poses(values[:, :3] * 1e-3, matrix_from_quaternion(values[:, 3:7]))

    def from_poses(self, poses: Floats, near: Floats) -> Floats:
        """As in PoseLayout."""
        quaternions = quaternion_from_matrix(poses[:, :3, :3])
        flipped = np.sum(quaternions * near[:, 3:7], axis=1) < 0.0
        quaternions[flipped] *= -1.0
        return np.hstack([poses[:, :3, 3] * MM_PER_METRE, quaternions])


@dataclass(frozen=True)
class RotationVectorPose:
    """x y z in m and a rotation vector in rad."""

    kind: ClassVar[Literal["pose"]] = "pose"
    words: ClassVar[Mapping[int, tuple[str, ...]]] = NO_WORDS
    configuration: int = 0
    width: int = 6
    least_decimals: tuple[int, ...] = (DECIMALS_M,) * 3 + (DECIMALS_RAD,) * 3

    def to_poses(self, values: Floats) -> Floats:
        """As in PoseLayout."""
        return _poses(values[:, :3], matrix_from_rotation_vector(values[:, 3:6]))

    def from_poses(self, poses: Floats, near: Floats) -> Floats:
        """As in PoseLayout: the vector, lengthened by full turns, that is nearest to `near`."""
        vectors = rotation_vector_from_matrix(poses[:, :3, :3])
        lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
        axes = np.divide(vectors, lengths, out=_unit(near[:, 3:6]), where=lengths > 0.0)
        turns = np.round((np.sum(near[:, 3:6] * axes, axis=1, keepdims=True) - lengths) / FULL_TURN)
        return np.hstack([poses[:, :3, 3], vectors + turns * FULL_TURN * axes])


def _poses(points: Floats, matrices: Floats) -> Floats:
    poses = np.zeros((len(points), 4, 4))
    poses[:, :3, :3], poses[:, :3, 3], poses[:, 3, 3] = matrices, points, 1.0
    return poses


def _unit(vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    units: Floats = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)
    return units


def _nearest_angles(matrices: Floats, near: Floats) -> Floats:
    """Angles (n, 3) about z, y and x of rotation matrices (n, 3, 3), those nearest to `near`."""
    first = euler_from_matrix(matrices, "ZYX")
    second = np.stack([first[:, 0] + np.pi, np.pi - first[:, 1], first[:, 2] + np.pi], axis=1)
    locked = np.cos(first[:, 1]) < LOCKED
    first[locked] = _locked(first[locked], near[locked])
    both = [angles + FULL_TURN * np.round((near - angles) / FULL_TURN) for angles in (first, second)]
    distances = [np.abs(angles - near).sum(axis=1) for angles in both]
    return np.where((distances[0] <= distances[1])[:, None] | locked[:, None], both[0], both[1])


def _locked(angles: Floats, near: Floats) -> Floats:
    """Where the middle angle is +-90 deg only a sum of the other two counts: the third is kept."""
    sign = np.where(angles[:, 1] > 0.0, 1.0, -1.0)
    together = angles[:, 0] - sign * angles[:, 2]
    return np.stack([together + sign * near[:, 2], angles[:, 1], near[:, 2]], axis=1)
