"""What else may make an arm show other points than expected: another common scale, or another load."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from truearm.calibration import Calibration
from truearm.doubts.of_results import UPRIGHT
from truearm.fits.identified import IdentifiedArm
from truearm.fits.parameters import A, D
from truearm.types import Floats
from truearm.updating.parts import offset_columns

SCALE: Final = "scale"
LOAD: Final = "load"
SCALE_STD: Final = 1e-3
"""Prior standard deviation of a common scale: of steel that is 80 K warmer; no scale bar errs by so much."""
BENT_RAD: Final = 1e-3
"""The same of what another load bends a joint by where its lever is longest."""
LEAST_LEVER_M: Final = 1e-2
"""Shorter ones bend no joint."""
AGAINST: Final = 3.0
"""Standard errors by which a joint that gives way upwards contradicts that others give way downwards."""


class Cause(ABC):
    """Something that is asked for beside offsets, frames and tools, with c unknowns.

    Attributes:
        name: What it is called in results; "" for nothing.
        std: Prior standard deviations of the unknowns (c,).
        kept: Derivatives (5 L, c) of the chain's parameters by what an update takes along of it.
    """

    name = ""
    std: Floats
    kept: Floats

    @abstractmethod
    def passing(self, arm: IdentifiedArm, readings: Floats) -> Floats:
        """Derivatives (n, 5 L, c) of the chain's parameters at readings (n, N) by what is not taken along."""

    def contradicts(self, _values: Floats, _covariance: Floats) -> bool:
        """Whether values (c,) of a covariance (c, c) are none of this cause."""
        return False


class Nothing(Cause):
    """No cause: the arm's chain has 5 L parameters."""

    def __init__(self, arm: IdentifiedArm) -> None:
        self.std, self.kept = np.zeros(0), np.zeros((arm.table.size, 0))

    def passing(self, arm: IdentifiedArm, readings: Floats) -> Floats:
        """No derivatives."""
        return np.zeros((len(readings), arm.table.size, 0))


class Scale(Cause):
    """All lengths of the arm, a, d and what its rails slide, in proportion: one unknown, the share."""

    name = SCALE

    def __init__(self, arm: IdentifiedArm, *, taken: bool) -> None:
        self.taken = taken
        self.std = np.array([SCALE_STD])
        self.kept = _lengths(arm)[:, None] * taken

    def passing(self, arm: IdentifiedArm, readings: Floats) -> Floats:
        """Of lengths (n, 5 L, 1), where they are not taken along; what rails slide is no constant."""
        found = np.zeros((len(readings), arm.table.size))
        found += _lengths(arm) * (not self.taken)
        values = arm.robot.joints_from_readings(readings)
        for joint, column in enumerate(offset_columns(arm)):
            if arm.robot.joints[joint] == "prismatic":
                found[:, column] += values[:, joint]
        return found[:, :, None]


class Load(Cause):
    """A weight at the flange: each joint turns by its own compliance times the weight's lever about it.

    One unknown for each joint that the weight has a lever about: its turn, rad, downwards, where the lever
    is longest among the readings. `up` is the vertical (3,) in the base frame.
    """

    name = LOAD

    def __init__(self, arm: IdentifiedArm, up: ArrayLike, readings: Floats) -> None:
        self._up = np.array(up, dtype=np.float64)
        levers = np.abs(self._levers(arm, readings)).max(axis=0)
        turns = (levers > LEAST_LEVER_M) & arm.robot.revolute
        self.joints = np.flatnonzero(turns)
        self._longest_m = levers[self.joints]
        self.std = np.full(len(self.joints), BENT_RAD)
        self.kept = np.zeros((arm.table.size, len(self.joints)))

    def passing(self, arm: IdentifiedArm, readings: Floats) -> Floats:
        """Turns (n, 5 L, c) of joints, which give way downwards."""
        columns = np.array(offset_columns(arm))[self.joints]
        found = np.zeros((len(readings), arm.table.size, len(self.joints)))
        turned = -self._levers(arm, readings)[:, self.joints] / self._longest_m
        found[:, columns, np.arange(len(columns))] = turned
        return found

    def contradicts(self, values: Floats, covariance: Floats) -> bool:
        """Whether some joints give way downwards and others upwards, by more than chance."""
        errors = values / np.sqrt(np.maximum(np.diag(covariance), np.finfo(np.float64).tiny))
        return bool(errors.max() > AGAINST and errors.min() < -AGAINST)

    def _levers(self, arm: IdentifiedArm, readings: Floats) -> Floats:
        """How fast each joint lifts the flange (n, N), m/rad."""
        robot = arm.robot
        return np.asarray(self._up @ robot.flange_chain.joint_jacobian(robot.joints_from_readings(readings)))


def causes(calibration: Calibration, readings: Floats, *, take_scale: bool) -> Iterator[Cause]:
    """What is asked for where offsets, frames and tools do not explain what readings (n, N) show.

    Of the weight of the links constants alone leave what bends the arm, and take it for noise: a load cannot
    be told from that.
    """
    yield Scale(calibration.arm, taken=take_scale)
    details = calibration.variable
    if details is not None:
        load = Load(calibration.arm, details.hyper.get("up", UPRIGHT), readings)
        if len(load.joints):
            yield load


def _lengths(arm: IdentifiedArm) -> Floats:
    """The nominal a and d of the arm's links among the chain's parameters (5 L,); zero for all others."""
    found = np.zeros_like(arm.table)
    found[arm.links, D], found[arm.links, A] = arm.table[arm.links, D], arm.table[arm.links, A]
    return found.reshape(-1)
