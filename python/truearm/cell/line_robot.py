"""Driver of any robot that takes commands in lines, by templates and patterns of the cell file."""

import contextlib
import math
import re
import threading
import time
from typing import Final

import numpy as np
from pydantic import field_validator

from truearm.cell.device_errors import DeviceError, DeviceSilentError, RefusedError
from truearm.cell.line_port import LinePort, LineSection
from truearm.cell.patterns import check_template, expression, filled, numbers_in, pattern_of
from truearm.cell.protocols import Managed
from truearm.cell.schema import Positive
from truearm.errors import InputError, TruearmError
from truearm.robot import Robot
from truearm.rotations import quaternion_from_matrix
from truearm.types import Floats
from truearm.units import AngleUnit, StatedLengthUnit, to_si

SENDINGS: Final = 4
ASKS_EVERY_S: Final = 0.02
# Answers of which the median is taken where the last digits flicker.
AGREEING: Final = 5
POSE: Final = ("x", "y", "z", "qw", "qx", "qy", "qz")


class LineRobot(Managed):
    """A robot that is told `move` and asked `where`; units and texts stand in the cell file.

    The command is sent, then the robot is asked where it is until it is there and still; nothing else is
    believed, but a line that fits `refused`.
    """

    class Settings(LineSection):
        """Keys of [robot] with driver "line"."""

        driver: str = "line"
        motion_timeout_s: Positive = 60.0
        angle_unit: AngleUnit = "deg"
        length_unit: StatedLengthUnit = "mm"
        move: str
        move_pose: str | None = None
        where: str
        joints: str
        stop: str
        refused: str | None = None
        tolerance_deg: Positive = 0.02
        tolerance_mm: Positive = 0.05
        starts_within_s: Positive = 0.5
        still_s: Positive = 0.2

        @field_validator("joints")
        @classmethod
        def _joints(cls, value: str) -> str:
            pattern_of(value, ("q1",))
            return value

        @field_validator("refused")
        @classmethod
        def _refused(cls, value: str | None) -> str | None:
            return None if value is None else expression(value)

    def __init__(self, settings: Settings, arm: Robot) -> None:
        self._settings, self._arm = settings, arm
        self._names = tuple(f"q{j + 1}" for j in range(arm.joint_count))
        self._joints = _checked(settings, self._names)
        self._refused = None if settings.refused is None else re.compile(settings.refused)
        units = {"revolute": settings.angle_unit, "prismatic": settings.length_unit}
        self._si = np.array([to_si(1.0, units[kind]) for kind in arm.joints])
        turned, slid = to_si(settings.tolerance_deg, "deg"), to_si(settings.tolerance_mm, "mm")
        self._tolerance = np.where(arm.revolute, turned, slid)
        self._port = LinePort.of(self.name, settings, terminator=settings.terminator)
        self._busy = threading.RLock()
        self._refusal = ""

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
        """See Robot.

        Raises:
            RefusedError: If the robot answers with a line that fits `refused`.
        """
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
        values = dict(zip(POSE, [*point, *turn], strict=True))
        with self._busy:
            self._drive(filled(template, values), None)

    def read_joints(self) -> Floats:
        """See Robot. Two equal answers in a row, as one alone may be late or damaged.

        Of a robot whose last digits flicker, the median of some in a row that agree within the tolerances.
        """
        with self._busy:
            until, asked, answers = time.monotonic() + self._settings.timeout_s, 0, [self._where()]
            while asked < 2 * AGREEING or time.monotonic() < until:
                self._port.pause(ASKS_EVERY_S)
                now, asked = self._where(), asked + 1
                if np.array_equal(now, answers[-1]):
                    return now
                answers = [*answers, now] if self._agree(now, answers[0]) else [now]
                if len(answers) == AGREEING:
                    return np.asarray(np.median(answers, axis=0))
        raise DeviceError(
            "what it says of its joints keeps changing",
            where=self._port.where,
            rule=f"{AGREEING} answers in a row must agree within {self._allowed}",
        )

    def stop(self) -> None:
        """See Device."""
        self._port.interrupt()
        try:
            if self._port.is_open:
                self._port.send(self._settings.stop)
        finally:
            with self._busy:
                self._port.resume()

    def close(self) -> None:
        """See Device."""
        self._port.close()

    @property
    def _allowed(self) -> str:
        return f"{self._settings.tolerance_deg:g} deg (tolerance_deg), {self._settings.tolerance_mm:g} mm"

    def _agree(self, one: Floats, other: Floats) -> bool:
        return bool((np.abs(one - other) <= self._tolerance).all())

    def _drive(self, command: str, target: Floats | None) -> None:
        self._port.drain()
        self._refusal = ""
        for _ in range(SENDINGS):
            self._port.begin(command)
            if self._arrives(target):
                return
        raise DeviceError(
            f"the robot did not get there ({SENDINGS} tries)",
            where=self._port.where,
            rule=f"It must come within {self._allowed} of {command}, and begin to move within "
            f"{self._settings.starts_within_s:g} s (starts_within_s)",
        )

    def _arrives(self, target: Floats | None) -> bool:
        """Ask until the robot is there and still; False once it stands elsewhere.

        A robot that waits before it moves is given time; one that is there has to be so for a shorter time.
        """
        rests_at = self._where()
        since = time.monotonic()
        until = since + self._settings.motion_timeout_s
        while time.monotonic() < until:
            self._port.pause(ASKS_EVERY_S)
            # An answer that is late is of some time behind the question.
            asked = time.monotonic()
            now = self._where()
            if self._refusal:
                # What it answers to a stop may look like a refusal.
                self._port.pause(0.0)
                raise RefusedError(f'it answers "{self._refusal}"', where=self._port.where)
            if not self._agree(now, rests_at):
                rests_at, since = now, time.monotonic()
            still_s = asked - since
            there = target is not None and self._agree(now, target)
            if there and still_s >= self._settings.still_s:
                return True
            if still_s >= self._settings.starts_within_s and not there:
                return target is None
        raise DeviceSilentError(
            f"the motion did not end within {self._settings.motion_timeout_s:g} s (motion_timeout_s)",
            where=self._port.where,
            rule=f"What it says of its joints must stay within {self._allowed} for "
            f"{self._settings.still_s:g} s (still_s)",
        )

    def _where(self) -> Floats:
        """Where the robot says that it is; a refusal that comes before is kept."""
        for _ in range(SENDINGS - 1):
            with contextlib.suppress(DeviceSilentError):
                return self._asked()
        return self._asked()

    def _asked(self) -> Floats:
        for line in self._port.drain():
            self._notice(line)
        self._port.send(self._settings.where)
        return self._port.answer(self._readings_in, doing="say where it is", key="joints")

    def _readings_in(self, line: str) -> Floats | None:
        numbers = numbers_in(self._joints, line)
        values = [] if numbers is None else [numbers.get(name, math.nan) for name in self._names]
        if not values or not all(map(math.isfinite, values)):
            self._notice(line)
            return None
        return np.asarray(np.array(values) * self._si)

    def _notice(self, line: str) -> None:
        if self._refused is not None and self._refused.search(line):
            self._refusal = line


def _checked(settings: LineRobot.Settings, names: tuple[str, ...]) -> re.Pattern[str]:
    """The pattern of the joints, once it and the templates are known to fit the arm.

    Raises:
        InputError: If one does not.
    """
    key = "move"
    try:
        check_template(settings.move, names, names)
        if settings.move_pose is not None:
            key = "move_pose"
            check_template(settings.move_pose, POSE)
    except TruearmError as error:
        raise error.at(f"robot, {key}") from None
    try:
        return pattern_of(settings.joints, names)
    except ValueError as error:
        raise InputError(str(error), where="robot, joints") from None
