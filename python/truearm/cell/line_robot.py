"""Driver of any robot that takes commands in lines, by templates and patterns of the cell file."""

import threading
import time
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import field_validator

from truearm.cell.device_errors import DeviceError, DeviceSilentError
from truearm.cell.line_port import LinePort, LineSection
from truearm.cell.patterns import filled, numbers_in, pattern_of
from truearm.cell.schema import Positive
from truearm.errors import InputError
from truearm.robot import Robot
from truearm.rotations import quaternion_from_matrix
from truearm.units import AngleUnit, LengthUnit, to_si

Floats = NDArray[np.float64]

SENDINGS: Final = 4


class LineRobot:
    """A robot that is told `move` and asked `where`; units and texts stand in the cell file.

    The command is sent, then the robot is asked where it is until it is there; nothing else is believed.
    """

    class Settings(LineSection):
        """Keys of [robot] with driver "line"."""

        driver: str = "line"
        motion_timeout_s: Positive = 60.0
        angle_unit: AngleUnit = "deg"
        length_unit: LengthUnit = "mm"
        move: str
        move_pose: str | None = None
        where: str
        joints: str
        stop: str
        tolerance_deg: Positive = 0.02

        @field_validator("joints")
        @classmethod
        def _joints(cls, value: str) -> str:
            pattern_of(value, ("q1",))
            return value

    def __init__(self, settings: Settings, arm: Robot) -> None:
        self._settings, self._arm = settings, arm
        self._names = tuple(f"q{j + 1}" for j in range(arm.joint_count))
        try:
            self._joints = pattern_of(settings.joints, self._names)
        except ValueError as error:
            raise InputError(str(error), where="robot, joints") from None
        units = {"revolute": settings.angle_unit, "prismatic": settings.length_unit}
        self._si = np.array([to_si(1.0, units[kind]) for kind in arm.joints])
        self._port = LinePort.of(self.name, settings, terminator=settings.terminator)
        self._busy = threading.RLock()

    @property
    def name(self) -> str:
        """See Device."""
        return "robot"

    @property
    def address(self) -> str:
        """See Device."""
        return self._settings.port

    def connect(self) -> None:
        """Open the port and ask where the robot is."""
        with self._busy, self._port.opened():
            self._where()

    def move_joints(self, readings: Floats) -> None:
        """See Robot."""
        target = np.asarray(readings, dtype=np.float64)
        values = dict(zip(self._names, (target / self._si).tolist(), strict=True))
        with self._busy:
            self._drive(filled(self._settings.move, values), target)

    def move_pose(self, base_from_tool: Floats) -> None:
        """See Robot.

        Raises:
            InputError: If the cell file has no command for it.
        """
        template = self._settings.move_pose
        if template is None:
            raise InputError("there is no command for it", where="robot, move_pose")
        point = base_from_tool[:3, 3] / to_si(1.0, self._settings.length_unit)
        turn = quaternion_from_matrix(base_from_tool[:3, :3])
        values = dict(zip(("x", "y", "z", "qw", "qx", "qy", "qz"), [*point, *turn], strict=True))
        with self._busy:
            self._drive(filled(template, values), None)

    def read_joints(self) -> Floats:
        """See Robot. Two answers in a row must agree, as one may be late or damaged."""
        with self._busy:
            before = self._where()
            for _ in range(2 * SENDINGS):
                now = self._where()
                if np.array_equal(before, now):
                    return now
                before = now
        raise DeviceError("what it says of its joints keeps changing", where=self._port.where)

    def stop(self) -> None:
        """See Device."""
        self._port.interrupt()
        if self._port.is_open:
            self._port.send(self._settings.stop)
        with self._busy:
            self._port.resume()

    def close(self) -> None:
        """See Device."""
        self._port.close()

    def _drive(self, command: str, target: Floats | None) -> None:
        for _ in range(SENDINGS):
            self._port.send(command)
            if self._arrives(target):
                return
        raise DeviceError(
            f"the robot did not get there ({SENDINGS} tries)",
            where=self._port.where,
            rule=f"It must come within {self._settings.tolerance_deg:g} deg of {command}",
        )

    def _arrives(self, target: Floats | None) -> bool:
        """Ask until the robot is there; False once it stands elsewhere."""
        still, last = 0, self._where()
        until = time.monotonic() + self._settings.motion_timeout_s
        while time.monotonic() < until:
            if target is not None and np.abs(last - target).max() <= np.radians(self._settings.tolerance_deg):
                return True
            now = self._where()
            still = still + 1 if np.array_equal(now, last) else 0
            if still >= STANDS_AFTER:
                return target is None
            last = now
        raise DeviceSilentError(
            f"the motion did not end within {self._settings.motion_timeout_s:g} s", where=self._port.where
        )

    def _where(self) -> Floats:
        for _ in range(SENDINGS):
            self._port.drain()
            self._port.send(self._settings.where)
            try:
                numbers = numbers_in(self._joints, self._port.receive(doing="say where it is"))
            except DeviceSilentError:
                continue
            if numbers is not None and set(self._names) <= set(numbers):
                return np.asarray(np.array([numbers[name] for name in self._names]) * self._si)
        raise DeviceSilentError(
            f"no answer to {self._settings.where} that fits the pattern within {self._port.limit_s:g} s, "
            f"{SENDINGS} times",
            where=self._port.where,
            way_out="Check the port, and `joints` of the cell file against what the robot says",
        )


STANDS_AFTER: Final = 10
