"""A virtual arm with known errors, and what an instrument says about it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from truearm._core import Chain
from truearm.arrays import as_rows, read_only
from truearm.errors import InputError, UsageError
from truearm.files import parsed
from truearm.kinds import count, required, whole_numbers
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.simulation import arm_file
from truearm.simulation.drawing import (
    default_parameters,
    direction,
    draw_errors,
    joint_ranges,
    nominal_rows,
    random_transform,
    row_chain,
    stated_rows,
    turned,
)
from truearm.simulation.imperfections import Conditions, Imperfections, approach_in_sequence
from truearm.simulation.joint_errors import check_joints, joint_errors, sagging
from truearm.types import Floats
from truearm.units import to_si

# The fifteen parameters of the RV-M2 that positions determine, section 6 of the paper; row 0 is BASE.
# fmt: off
PAPER_PARAMETERS: Final = (
    "theta0", "a0", "alpha0", "beta0", "theta1", "d1", "a1", "alpha1",
    "theta2", "a2", "alpha2", "beta2", "theta3", "d3", "a3",
)
# fmt: on
MAJOR_JOINTS: Final = 3
POSES_FOR_MEAN: Final = 2000
TRACKER_DISTANCE_M: Final = 2.5
TARGET_OFFSET_M: Final = 0.06
# Small enough that what a joint error does to the point is linear, so that one scaling meets the share.
DRAWN_HARMONIC: Final = 1e-4


class VirtualArm:
    """An arm with known errors: constant ones of its parameters, and harmonics of its first joints.

    The harmonics are equation (6) of the paper, e = f1(cos q1, sin q1) + f2(cos q2, sin q2) +
    f3(cos q3, sin q3) with linear f, over the first three revolute joints. Joints that err by themselves,
    that give way under weight, and growth with temperature come on top where the imperfections name them.
    Everything drawn follows from the seed: the same arguments make the same arm.

    Attributes:
        robot: The arm as it is meant to be.
        imperfections: Sizes of its errors.
        names: Names of the rows' erring parameters: kind and row, where row 0 is the base.
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
            InputError: If a name is not a parameter of this robot, or a joint or link is not of it.
            UsageError: If the seed is no whole number from zero on.
        """
        self.robot = required(robot, Robot, "the robot")
        self.seed = count(seed, "the seed")
        given = Imperfections() if imperfections is None else imperfections
        self.imperfections = required(given, Imperfections, "the imperfections")
        check_joints(robot, self.imperfections.joint_errors, self.imperfections.deflection)
        rng = np.random.default_rng([seed, 0])
        self.names = tuple(default_parameters(robot) if parameters is None else parameters)
        self._errors = read_only(draw_errors(robot, self.names, self.imperfections, rng))
        self.world_from_base = random_transform(rng, TRACKER_DISTANCE_M)
        offset = TARGET_OFFSET_M * direction(rng)
        self.target_in_flange: Floats = robot.tool[:3, 3] + offset
        self._true_table = nominal_rows(robot) + self.errors
        thermal = self.imperfections.thermal
        self._drift = None if thermal is None else stated_rows(robot, thermal.drift_per_k)
        self._waving = np.flatnonzero(robot.revolute)[:MAJOR_JOINTS].tolist()
        outputs = 3 if self.imperfections.non_geometric == "cartesian" else len(self._waving)
        self._harmonics = rng.normal(scale=DRAWN_HARMONIC, size=(2 * len(self._waving), outputs))
        self._harmonics *= self._scale_to_share()

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__ |= state | {"_errors": read_only(state["_errors"])}

    @property
    def errors(self) -> Floats:
        """True minus nominal parameters (rows, 5) in m and rad, theta, d, a, alpha, beta in a row; the rows
        are the base, if the robot file gives it as one, and the links. They are as drawn, and read-only.
        """
        return self._errors

    def __repr__(self) -> str:
        return f"<VirtualArm of {self.robot.name}: seed {self.seed}, {len(self.names)} erring parameters>"

    @classmethod
    def paper(cls, *, seed: int = 0, imperfections: Imperfections | None = None) -> "VirtualArm":
        """The paper's RV-M2: 0.4 mm and 0.05 deg on its fifteen observable parameters, base included."""
        robot = Robot.load("rv-m2")
        return cls(robot, seed=seed, imperfections=imperfections, parameters=PAPER_PARAMETERS)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any], *, where: str = "virtual arm") -> "VirtualArm":
        """The arm that `to_dict` described.

        Raises:
            InputError: If a key is not known or a value breaks a rule; names the key.
        """
        return cls(**arm_file.arguments(content, where=where))

    @classmethod
    def from_toml(cls, text: str, *, where: str = "virtual arm") -> "VirtualArm":
        """An arm from the text of a TOML file; `where` names it in messages.

        Raises:
            InputError: If the text is no TOML, a key is not known or a value breaks a rule.
        """
        return cls.from_dict(parsed(text, where=where), where=where)

    def to_dict(self) -> dict[str, Any]:
        """JSON values that `from_dict` makes the same arm of."""
        return arm_file.describe(self.robot, self.seed, self.imperfections, self.names)

    def to_toml(self) -> str:
        """The text of a TOML file that `from_toml` makes the same arm of."""
        return arm_file.write(self.to_dict())

    def poses(self, n: int, *, seed: int = 0, held: Sequence[int] = ()) -> Floats:
        """Readings (n, N) drawn evenly within the limits.

        A joint without limits turns half a turn to either side, or slides half a metre.

        Args:
            n: How many.
            seed: Seed of the draw, apart from the arm's own.
            held: Joints, counted from 1, that stay at reading zero.

        Raises:
            UsageError: If the arm has no such joint, or `n` or the seed is no whole number from zero on.
        """
        number, draw = count(n, "the number of poses"), count(seed, "the seed")
        joints = whole_numbers(held, "held")
        for joint in joints:
            if not 1 <= joint <= self.robot.joint_count:
                raise UsageError(
                    f"there is no joint {joint} to hold", rule=f"Joints are 1 to {self.robot.joint_count}"
                )
        low, high = joint_ranges(self.robot)
        readings = np.random.default_rng([self.seed, 1, draw]).uniform(low, high, (number, len(low)))
        readings[:, [joint - 1 for joint in joints]] = 0.0
        return readings

    def true_position(self, q: ArrayLike, *, conditions: Conditions | None = None) -> Floats:
        """Where the file's tool point really is, m, in the frame that the robot file's base stands in.

        Args:
            q: Readings (n, N) or (N,).
            conditions: What the poses are reached under.

        Returns:
            (n, 3), or (3,) for one reading. Errors of the base row are part of it.
        """
        return np.asarray(self.true_pose(q, conditions=conditions)[..., :3, 3])

    def true_pose(
        self, q: ArrayLike, *, tool: Floats | None = None, conditions: Conditions | None = None
    ) -> Floats:
        """Where the tool's frame really is, in the frame that the robot file's base stands in.

        Args:
            q: Readings (n, N) or (N,).
            tool: Transform (4, 4) from flange to tool; the robot file's by default.
            conditions: What the poses are reached under.

        Returns:
            (n, 4, 4), or (4, 4) for one reading.
        """
        rows, single = as_rows(q, self.robot.joint_count, what="joint readings")
        end = self.robot.flange @ (self.robot.tool if tool is None else tool)
        true = self._pose(rows, end, conditions or Conditions())
        return true[0] if single else true

    def measure(
        self,
        q: ArrayLike,
        *,
        seed: int = 0,
        orientation: bool = False,
        conditions: Conditions | None = None,
    ) -> Measurements:
        """What the instrument says about readings `q` (n, N): the target, in the frame of the instrument.

        All that it measures is of one set-up, also where several are put together.

        Args:
            q: Readings.
            seed: Seed of the noise, apart from the arm's own.
            orientation: Whether the tool's orientation is measured as well.
            conditions: What the poses are reached under; without them one after another, unloaded.
        """
        table = self.measure_table(q, seed=seed, orientation=orientation, conditions=conditions)
        return replace(Measurements.from_dataframe(table), default_group=None)

    def measure_table(
        self,
        q: ArrayLike,
        *,
        seed: int = 0,
        orientation: bool = False,
        conditions: Conditions | None = None,
    ) -> pd.DataFrame:
        """What `measure` gives, as columns q1 ... qN in rad and m, x y z in m, and qw qx qy qz if asked.

        Where the conditions say so, payload_kg and temperature_c are further columns.

        Raises:
            UsageError: If the seed is no whole number from zero on.
        """
        rows, _ = as_rows(q, self.robot.joint_count, what="joint readings")
        met = Conditions(approach=approach_in_sequence(rows)) if conditions is None else conditions
        draw = count(seed, "the seed")
        rng = np.random.default_rng([self.seed, 2, draw])
        flange_from_target = np.eye(4)
        flange_from_target[:3, 3] = self.target_in_flange
        visit = np.random.default_rng([self.seed, 3, draw])
        poses = self.world_from_base @ self._pose(rows, self.robot.flange @ flange_from_target, met, visit)
        noise = rng.normal(scale=to_si(self.imperfections.noise_mm, "mm"), size=(len(rows), 3))
        columns: dict[str, Any] = {f"q{j + 1}": rows[:, j] for j in range(rows.shape[1])}
        columns |= dict(zip("xyz", (poses[:, :3, 3] + noise).T, strict=True))
        if orientation:
            turns = rng.normal(scale=1e-3 * self.imperfections.noise_mrad, size=(len(rows), 3))
            columns |= dict(zip(("qw", "qx", "qy", "qz"), turned(poses, turns).T, strict=True))
        return pd.DataFrame(columns | _condition_columns(met, len(rows)))

    def _pose(
        self, readings: Floats, end: Floats, met: Conditions, visit: np.random.Generator | None = None
    ) -> Floats:
        """Real poses (n, 4, 4) of the frame `end` behind the last link, in the frame of the base.

        `visit` draws what differs from one visit to the next; without it nothing does.
        """
        values, wave = self._joint_values(readings, met), self._wave(readings)
        if self.imperfections.non_geometric == "joint":
            values[:, self._waving] += wave
        if visit is not None:
            scale = self._joint_scatter()
            values += scale * visit.normal(size=values.shape)
        poses = self._chain(end).pose(values, self._grown(met, len(values)))
        if self.imperfections.non_geometric == "cartesian":
            poses[:, :3, 3] += wave
        if visit is not None:
            scatter = to_si(self.imperfections.repeatability_mm, "mm")
            poses[:, :3, 3] += scatter * visit.normal(size=(len(poses), 3))
        return poses

    def _joint_values(self, readings: Floats, met: Conditions) -> Floats:
        """Denavit-Hartenberg joint values (n, N) with the errors of joints and what gives way."""
        imperfections = self.imperfections
        erring = readings + joint_errors(imperfections.joint_errors, readings, met.approach)
        values = self.robot.joints_from_readings(erring)
        if imperfections.deflection is None:
            if np.any(np.asarray(met.payload_kg) != 0.0):
                raise InputError(
                    "there is a payload, but no deflection", rule="A payload acts on joints that give way"
                )
            return values
        links = self.robot.joint_count
        values += sagging(imperfections.deflection, self._chain_to, links, values, met.payload_kg)
        return values

    def _chain_to(self, link: int, end: Floats) -> Chain:
        """The chain that ends `end` behind a link (from 1), or behind the flange with one more than N."""
        first = len(self._true_table) - self.robot.joint_count
        if link > self.robot.joint_count:
            return self._chain(self.robot.flange @ end)
        return row_chain(self.robot, self._true_table[: first + link], end)

    def _joint_scatter(self) -> Floats:
        size = self.imperfections.repeatability_deg
        units = ["deg" if kind == "revolute" else "mm" for kind in self.robot.joints]
        return np.array([to_si(size, unit) for unit in units])

    def _grown(self, met: Conditions, count: int) -> Floats | None:
        """Parameters (n, rows, 5) at the temperature; None where it is that of reference."""
        thermal = self.imperfections.thermal
        if met.temperature_c is None:
            return None
        if thermal is None or self._drift is None:
            raise InputError("there is a temperature, but nothing that grows", rule='Give "thermal" as well')
        warmer = np.broadcast_to(np.asarray(met.temperature_c, dtype=np.float64), count) - thermal.reference_c
        rate = self._drift.copy()
        rate[:, 1:3] += thermal.growth_per_k * self._true_table[:, 1:3]
        return np.asarray(self._true_table + warmer[:, None, None] * rate)

    def _chain(self, end: Floats) -> Chain:
        return row_chain(self.robot, self._true_table, end)

    def _wave(self, readings: Floats) -> Floats:
        """Harmonics (n, outputs) of the readings, rad or m."""
        turning = readings[:, self._waving]
        return np.hstack([np.cos(turning), np.sin(turning)]) @ self._harmonics

    def _scale_to_share(self) -> float:
        """Factor that brings the harmonics, as drawn, to their share of the mean geometric error."""
        q, end = self.poses(POSES_FOR_MEAN), self.robot.flange @ self.robot.tool
        values = self.robot.joints_from_readings(q)
        geometric = self._chain(end).pose(values)[:, :3, 3]
        nominal = row_chain(self.robot, nominal_rows(self.robot), end).position(values)
        if self.imperfections.non_geometric == "joint":
            moved = np.array(values)
            moved[:, self._waving] += self._wave(q)
            shift = _mean_distance(self._chain(end).position(moved), geometric)
        else:
            shift = float(np.linalg.norm(self._wave(q), axis=1).mean())
        return self.imperfections.share * _mean_distance(geometric, nominal) / shift if shift > 0.0 else 0.0


def _condition_columns(met: Conditions, count: int) -> dict[str, Floats]:
    stated = {"payload_kg": np.asarray(met.payload_kg, dtype=np.float64)}
    if met.temperature_c is not None:
        stated["temperature_c"] = np.asarray(met.temperature_c, dtype=np.float64)
    return {
        name: np.array(np.broadcast_to(value, count))
        for name, value in stated.items()
        if name != "payload_kg" or np.any(value != 0.0)
    }


def _mean_distance(points: Floats, others: Floats) -> float:
    return float(np.linalg.norm(points - others, axis=1).mean())
