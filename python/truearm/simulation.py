"""A virtual arm that errs as real arms do, and the virtual instrument that measures it.

It plays the part of the arm and the tracker where there is neither: in the demonstration, in tutorials
and in tests that need to know the truth.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from truearm._core import Chain
from truearm.arrays import as_rows
from truearm.errors import InputError, did_you_mean
from truearm.measurements import Measurements
from truearm.parameters import KINDS
from truearm.robot import Robot
from truearm.rotations import (
    matrix_from_quaternion,
    quaternion_from_matrix,
    quaternion_from_rotation_vector,
    transform_from_parts,
)
from truearm.units import to_si

Floats = NDArray[np.float64]


LENGTHS: Final = ("d", "a")
# The fifteen parameters of the RV-M2 that positions determine, section 6 of the paper; row 0 is BASE.
# fmt: off
PAPER_PARAMETERS: Final = (
    "theta0", "a0", "alpha0", "beta0", "theta1", "d1", "a1", "alpha1",
    "theta2", "a2", "alpha2", "beta2", "theta3", "d3", "a3",
)
# fmt: on
MAJOR_JOINTS: Final = 3
POSES_FOR_MEAN: Final = 2000
UNLIMITED: Final = {"revolute": np.pi, "prismatic": 0.5}
TRACKER_DISTANCE_M: Final = 2.5
TARGET_OFFSET_M: Final = 0.06
# Small enough that what a joint error does to the point is linear, so that one scaling meets the share.
DRAWN_HARMONIC: Final = 1e-4


@dataclass(frozen=True)
class Imperfections:
    """How wrong a virtual arm is, and its instrument.

    Attributes:
        length_mm: Size of the error of each erring d and a; the sign is drawn.
        angle_deg: Size of the error of each erring theta, alpha and beta; the sign is drawn.
        share: Mean of the non-geometric error as a share of the mean geometric one.
        non_geometric: What the harmonics of equation (6) are: an error of the point, in the frame of the
            base ("cartesian"), or of the joints themselves ("joint").
        noise_mm: Standard deviation of a measured coordinate.
        noise_mrad: Standard deviation of a measured orientation about each axis.
    """

    length_mm: float = 0.4
    angle_deg: float = 0.05
    share: float = 0.09
    non_geometric: Literal["cartesian", "joint"] = "cartesian"
    noise_mm: float = 0.04
    noise_mrad: float = 0.1


class VirtualArm:
    """An arm with known errors: constant ones of its parameters, and harmonics of its first joints.

    The harmonics are equation (6) of the paper, e = f1(cos q1, sin q1) + f2(cos q2, sin q2) +
    f3(cos q3, sin q3) with linear f, over the first three revolute joints. Everything drawn follows from
    the seed: the same arguments make the same arm.

    Attributes:
        robot: The arm as it is meant to be.
        imperfections: Sizes of its errors.
        names: Names of the rows' erring parameters: kind and row, where row 0 is the base.
        errors: True minus nominal parameters (rows, 5) in m and rad, theta, d, a, alpha, beta in a row;
            the rows are the base, if the robot file gives it as one, and the links.
        world_from_base: Pose (4, 4) of the base in the frame of the instrument.
        target_in_flange: The measured point (3,) in the flange frame, m.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        seed: int = 0,
        imperfections: Imperfections | None = None,
        parameters: Sequence[str] | None = None,
    ) -> None:
        """Draw an arm.

        Args:
            robot: What it should have been.
            seed: Seed of everything that is drawn.
            imperfections: Sizes of the errors; the paper's by default.
            parameters: Names of the parameters that err, such as "theta1" or "a0"; theta, d, a and alpha
                of all links by default.

        Raises:
            InputError: If a name is not a parameter of this robot.
        """
        self.robot = robot
        self.seed = seed
        self.imperfections = imperfections or Imperfections()
        rng = np.random.default_rng([seed, 0])
        self.names = tuple(_default_parameters(robot) if parameters is None else parameters)
        self.errors = _draw_errors(robot, self.names, self.imperfections, rng)
        self.world_from_base = _random_transform(rng, TRACKER_DISTANCE_M)
        offset = TARGET_OFFSET_M * _direction(rng)
        self.target_in_flange: Floats = robot.tool[:3, 3] + offset
        self._true_table = _nominal_rows(robot) + self.errors
        self._waving = [j for j, kind in enumerate(robot.joints) if kind == "revolute"][:MAJOR_JOINTS]
        outputs = 3 if self.imperfections.non_geometric == "cartesian" else len(self._waving)
        self._harmonics = rng.normal(scale=DRAWN_HARMONIC, size=(2 * len(self._waving), outputs))
        self._harmonics *= self._scale_to_share()

    @classmethod
    def paper(cls, *, seed: int = 0, imperfections: Imperfections | None = None) -> "VirtualArm":
        """The paper's RV-M2: 0.4 mm and 0.05 deg on its fifteen observable parameters, base included."""
        robot = Robot.load("rv-m2")
        return cls(robot, seed=seed, imperfections=imperfections, parameters=PAPER_PARAMETERS)

    def poses(self, n: int, *, seed: int = 0, held: Sequence[int] = ()) -> Floats:
        """Readings (n, N) drawn evenly within the limits.

        A joint without limits turns half a turn to either side, or slides half a metre.

        Args:
            n: How many.
            seed: Seed of the draw, apart from the arm's own.
            held: Joints, counted from 1, that stay at reading zero.
        """
        low, high = _ranges(self.robot)
        readings = np.random.default_rng([self.seed, 1, seed]).uniform(low, high, (n, len(low)))
        readings[:, [joint - 1 for joint in held]] = 0.0
        return readings

    def true_position(self, q: ArrayLike) -> Floats:
        """Where the file's tool point really is, m, in the frame that the robot file's base stands in.

        Args:
            q: Readings (n, N) or (N,).

        Returns:
            (n, 3), or (3,) for one reading. Errors of the base row are part of it.
        """
        rows, single = as_rows(q, self.robot.joint_count, what="joint readings")
        true = self._pose(rows, self.robot.flange @ self.robot.tool)[:, :3, 3]
        return true[0] if single else true

    def measure(self, q: ArrayLike, *, seed: int = 0, orientation: bool = False) -> Measurements:
        """What the instrument says about readings `q` (n, N): the target, in the frame of the instrument.

        Args:
            q: Readings.
            seed: Seed of the noise, apart from the arm's own.
            orientation: Whether the tool's orientation is measured as well.
        """
        return Measurements.from_dataframe(self.measure_table(q, seed=seed, orientation=orientation))

    def measure_table(self, q: ArrayLike, *, seed: int = 0, orientation: bool = False) -> pd.DataFrame:
        """The same as a table with columns q1 ... qN in rad and m, x y z in m, and qw qx qy qz if asked."""
        rows, _ = as_rows(q, self.robot.joint_count, what="joint readings")
        rng = np.random.default_rng([self.seed, 2, seed])
        flange_from_target = np.eye(4)
        flange_from_target[:3, 3] = self.target_in_flange
        poses = self.world_from_base @ self._pose(rows, self.robot.flange @ flange_from_target)
        noise = rng.normal(scale=to_si(self.imperfections.noise_mm, "mm"), size=(len(rows), 3))
        columns: dict[str, Any] = {f"q{j + 1}": rows[:, j] for j in range(rows.shape[1])}
        columns |= dict(zip("xyz", (poses[:, :3, 3] + noise).T, strict=True))
        if orientation:
            turns = rng.normal(scale=1e-3 * self.imperfections.noise_mrad, size=(len(rows), 3))
            columns |= dict(zip(("qw", "qx", "qy", "qz"), _turned(poses, turns).T, strict=True))
        return pd.DataFrame(columns)

    def _pose(self, readings: Floats, end: Floats) -> Floats:
        """Real poses (n, 4, 4) of the frame `end` behind the last link, in the frame of the base."""
        values, wave = self.robot.joints_from_readings(readings), self._wave(readings)
        if self.imperfections.non_geometric == "joint":
            values = values.copy()
            values[:, self._waving] += wave
            return self._chain(end).pose(values)
        poses = self._chain(end).pose(values)
        poses[:, :3, 3] += wave
        return poses

    def _chain(self, end: Floats) -> Chain:
        return _row_chain(self.robot, self._true_table, end)

    def _wave(self, readings: Floats) -> Floats:
        """Harmonics (n, outputs) of the readings, rad or m."""
        turning = readings[:, self._waving]
        return np.hstack([np.cos(turning), np.sin(turning)]) @ self._harmonics

    def _scale_to_share(self) -> float:
        """Factor that brings the harmonics, as drawn, to their share of the mean geometric error."""
        q, end = self.poses(POSES_FOR_MEAN), self.robot.flange @ self.robot.tool
        values = self.robot.joints_from_readings(q)
        geometric = self._chain(end).position(values)
        nominal = _row_chain(self.robot, _nominal_rows(self.robot), end).position(values)
        waved = self._pose(q, end)[:, :3, 3]
        shift = _mean_distance(waved, geometric)
        return self.imperfections.share * _mean_distance(geometric, nominal) / shift if shift > 0.0 else 0.0


def _default_parameters(robot: Robot) -> list[str]:
    return [f"{kind}{row}" for row in range(1, robot.joint_count + 1) for kind in KINDS[:4]]


def _nominal_rows(robot: Robot) -> Floats:
    """Nominal parameters of the base, if given as a row, and of the links."""
    return robot.table if robot.base_row is None else np.vstack([robot.base_row, robot.table])


def _row_chain(robot: Robot, rows: Floats, end: Floats) -> Chain:
    if robot.base_row is None:
        return Chain(robot.convention, list(robot.joints), rows, robot.base, end)
    return Chain(robot.convention, ["fixed", *robot.joints], rows, np.eye(4), end)


def _draw_errors(
    robot: Robot, names: Sequence[str], imperfections: Imperfections, rng: np.random.Generator
) -> Floats:
    """Errors (rows, 5) of stated size and drawn sign of the named parameters, zero elsewhere."""
    errors, places = np.zeros_like(_nominal_rows(robot)), _places(robot)
    for name in names:
        if name not in places:
            raise InputError(
                f'{robot.name} has no parameter "{name}"',
                rule=f"It has theta, d, a, alpha and beta of each row: {next(iter(places))} and so on",
                way_out=did_you_mean(name, list(places)),
            )
        length = name.rstrip("0123456789") in LENGTHS
        size = to_si(imperfections.length_mm, "mm") if length else to_si(imperfections.angle_deg, "deg")
        errors[places[name]] = size * rng.choice([-1.0, 1.0])
    return errors


def _places(robot: Robot) -> dict[str, tuple[int, int]]:
    """Row and column of each parameter by name; rows are counted from 0 where the base is one of them."""
    first = 1 if robot.base_row is None else 0
    rows = range(robot.joint_count + 1 - first)
    return {f"{kind}{row + first}": (row, column) for row in rows for column, kind in enumerate(KINDS)}


def _ranges(robot: Robot) -> tuple[Floats, Floats]:
    reach = np.array([UNLIMITED[kind] for kind in robot.joints])
    low, high = robot.limits.T
    return np.where(np.isfinite(low), low, -reach), np.where(np.isfinite(high), high, reach)


def _direction(rng: np.random.Generator) -> Floats:
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def _random_transform(rng: np.random.Generator, distance_m: float) -> Floats:
    quaternion = rng.normal(size=4)
    return transform_from_parts(distance_m * _direction(rng), quaternion / np.linalg.norm(quaternion))


def _turned(poses: Floats, rotation_vectors: Floats) -> Floats:
    """Quaternions (n, 4) of `poses`, each turned in the world by a rotation vector."""
    turns = matrix_from_quaternion(quaternion_from_rotation_vector(rotation_vectors))
    return quaternion_from_matrix(turns @ poses[:, :3, :3])


def _mean_distance(points: Floats, others: Floats) -> float:
    return float(np.linalg.norm(points - others, axis=1).mean())
