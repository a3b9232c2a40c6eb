"""A recorded measurement file that plays the part of the robot and of the sensor."""

import time
from collections import Counter
from pathlib import Path
from typing import Final

import numpy as np

from truearm.cell.device_errors import DeviceError, RefusedError
from truearm.cell.protocols import Managed
from truearm.cell.reading import Expected, Reading
from truearm.cell.schema import Positive, Section
from truearm.errors import InputError
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.rotations import transform_from_parts
from truearm.tables.columns import APPROACH
from truearm.types import Floats
from truearm.units import to_si

SAME_RAD: Final = 1e-6


class PlaybackRobot(Managed):
    """A robot that is at once where it is told to be."""

    class Settings(Section):
        """Keys of [robot] with driver "playback"."""

        driver: str = "playback"

    def __init__(self, settings: Settings, arm: Robot) -> None:
        del settings
        self._arm = arm
        self._readings: Floats | None = None

    @property
    def name(self) -> str:
        """See Device."""
        return "playback robot"

    @property
    def address(self) -> str:
        """See Device."""
        return "playback"

    def connect(self) -> None:
        """Be at zero, or as near to it as the limits allow."""
        if self._readings is not None:
            raise DeviceError("connected already", where=self.name)
        low, high = self._arm.limits.T
        self._readings = np.clip(np.zeros(self._arm.joint_count), low, high)

    def move_joints(self, readings: Floats) -> None:
        """See Robot."""
        self.read_joints()
        low, high = self._arm.limits.T
        if (readings < low).any() or (readings > high).any():
            raise RefusedError("the readings are beyond the limits of the arm", where=self.name)
        self._readings = np.array(readings, dtype=np.float64)

    def move_pose(self, base_from_tool: Floats) -> None:
        """See Robot. A recording knows readings only."""
        raise RefusedError("a recording cannot move to a pose", where=self.name)

    def read_joints(self) -> Floats:
        """See Robot."""
        if self._readings is None:
            raise DeviceError("not connected", where=self.name)
        return self._readings.copy()

    def stop(self) -> None:
        """See Device. It never moves."""

    def close(self) -> None:
        """See Device."""
        self._readings = None


class PlaybackSensor(Managed):
    """A sensor that says what a measurement file says about the readings it is prepared for."""

    class Settings(Section):
        """Keys of [sensor] with driver "playback"."""

        driver: str = "playback"
        file: Path
        sigma_mm: Positive = 0.05

    def __init__(self, settings: Settings, arm: Robot) -> None:
        self._settings, self._arm = settings, arm
        self._data: Measurements | None = None
        self._rows = np.empty(0, dtype=np.int64)
        self._told: Counter[int] = Counter()

    @property
    def name(self) -> str:
        """See Device."""
        return "playback sensor"

    @property
    def address(self) -> str:
        """See Device."""
        return str(self._settings.file)

    def connect(self) -> None:
        """Read the file."""
        if self._data is not None:
            raise DeviceError("connected already", where=self.name)
        data = Measurements.read_csv(self._settings.file, joints=self._arm.joints)
        if data.target_count == 0:
            raise InputError("it has no positions", where=str(self._settings.file))
        self._data = data

    def prepare(self, expected: Expected) -> None:
        """See Sensor. Find the rows of the expected readings, of those the ones approached from that side.

        Raises:
            RefusedError: If the recording does not have them.
        """
        data = self._recorded()
        off = np.abs(data.readings - expected.readings).max(axis=1)
        self._rows = np.flatnonzero(off <= SAME_RAD)
        sides = data.features.get(APPROACH)
        if expected.approach and sides is not None:
            same_side = self._rows[sides[self._rows] == expected.approach]
            self._rows = same_side if same_side.size else self._rows
        if not self._rows.size:
            raise RefusedError(
                f"the nearest recorded readings are {off.min():.3g} rad away",
                where=f"{self.name} at {self.address}",
                rule="Only recorded poses can be played back",
            )

    def measure(self) -> Reading:
        """See Sensor. The rows of the same readings come in turn, also when they are come back to."""
        data = self._recorded()
        if not self._rows.size:
            raise DeviceError("it is not prepared", where=self.name)
        first = int(self._rows[0])
        row = int(self._rows[self._told[first] % len(self._rows)])
        self._told[first] += 1
        point = data.targets[row, 0]
        valid = bool(np.isfinite(point).all())
        pose = None
        if data.orientations is not None and np.isfinite(data.orientations[row]).all() and valid:
            pose = transform_from_parts(point, data.orientations[row])
        sigma = np.nan if data.sigma_m is None else float(data.sigma_m[row])
        return Reading(
            point if valid else None,
            sigma if np.isfinite(sigma) else to_si(self._settings.sigma_mm, "mm"),
            time.time(),
            valid,
            f"row {data.rows[row]}",
            "" if valid else "nothing was recorded",
            pose_in_world=pose,
        )

    def release(self) -> None:
        """See Sensor."""

    def stop(self) -> None:
        """See Device."""

    def close(self) -> None:
        """See Device."""
        self._data = None

    def _recorded(self) -> Measurements:
        if self._data is None:
            raise DeviceError("not connected", where=self.name)
        return self._data
