"""Virtual devices that talk in lines by the templates of the cell file: a robot, and a tracker."""

import re
from typing import Final

import numpy as np

from truearm.cell.cell_file import SimulateSection
from truearm.cell.line_robot import LineRobot
from truearm.cell.line_sensor import LineSensor
from truearm.cell.patterns import expression_for, filled, numbers_in
from truearm.cell.virtual.state import STOPPED
from truearm.cell.virtual.world import ROOM_C, World
from truearm.errors import InputError, TruearmError
from truearm.types import Floats
from truearm.units import to_si

SPEED_RAD_S: Final = 1.0
PERIOD_S: Final = 0.01


class VirtualLineRobot:
    """Knows the commands `move`, `where` and `stop`, and answers `where` as `joints` expects it.

    The answer is made from the pattern `joints` by putting numbers in place of its groups.
    """

    def __init__(self, world: World, settings: LineRobot.Settings) -> None:
        self._world, self._settings = world, settings
        self._move = expression_for(settings.move)
        self.terminator = settings.terminator
        units = {"revolute": settings.angle_unit, "prismatic": settings.length_unit}
        self._si = np.array([to_si(1.0, units[kind]) for kind in world.cell.arm.joints])

    def restart(self) -> None:
        """See Machine."""
        self._world.arm.halt(self._world.shared.now())

    def received(self, line: str, now: float) -> list[tuple[float, str]]:
        """See Machine."""
        text = line.strip()
        if text == self._settings.where:
            return [(now, self._answer(now))]
        if text == self._settings.stop:
            self._world.arm.halt(now)
        match = self._move.fullmatch(text)
        if match is not None:
            self._go(match, now)
        return []

    def pending(self, now: float) -> list[tuple[float, str]]:
        """See Machine."""
        del now
        return []

    def next_event(self) -> float | None:
        """See Machine."""
        return None

    def _go(self, match: re.Match[str], now: float) -> None:
        target = np.array([float(match[f"q{j + 1}"]) for j in range(len(self._si))]) * self._si
        low, high = self._world.cell.arm.limits.T
        if (target < low).any() or (target > high).any():
            return
        way = float(np.abs(target - self._world.arm.at(now)).max())
        self._world.arm.go(target, way / SPEED_RAD_S, now, self._world.settings.servo_lag_s)
        self._world.watch(now)

    def _answer(self, now: float) -> str:
        numbers = (self._world.arm.at(now) / self._si).tolist()
        return answer_for(self._settings.joints, {f"q{j + 1}": value for j, value in enumerate(numbers)})


class VirtualTracker:
    """Answers each trigger; without one it streams."""

    def __init__(self, world: World, settings: LineSensor.Settings) -> None:
        self._world, self._settings = world, settings
        self.terminator = settings.terminator
        self._missed = line_without_point(settings, world.settings) or ""
        self._next = 0.0

    def restart(self) -> None:
        """See Machine."""

    def received(self, line: str, now: float) -> list[tuple[float, str]]:
        """See Machine."""
        if self._settings.trigger is not None and line.strip() == self._settings.trigger:
            return [(now, self._line(now))]
        return []

    def pending(self, now: float) -> list[tuple[float, str]]:
        """See Machine."""
        if self._settings.trigger is not None or now < self._next:
            return []
        self._next = now + PERIOD_S * self._world.shared.speed
        return [(now, self._line(now))]

    def next_event(self) -> float | None:
        """See Machine."""
        return None if self._settings.trigger is not None else self._next

    def _line(self, now: float) -> str:
        point = self._world.tracked(now)
        if point is None:
            return self._missed
        stopped = self._world.shared.flag(STOPPED)
        return _answer_of(self._settings, self._world.settings, point, ok=not stopped)


def line_without_point(settings: LineSensor.Settings, simulate: SimulateSection) -> str | None:
    """What a virtual tracker says where it does not see its target; None where its lines cannot say that.

    It is a line with `ok` 0, else one that matches `nothing`.
    """
    line = _answer_of(settings, simulate, np.zeros(3), ok=False)
    found = numbers_in(re.compile(settings.answer), line)
    if found is not None and found.get("ok") == 0.0:
        return line
    if settings.nothing is None:
        return None
    line = answer_for(settings.nothing, {})
    return line if re.search(settings.nothing, line) else None


def check_faults(settings: LineSensor.Settings, simulate: SimulateSection, where: str) -> None:
    """See that a virtual tracker can answer, and say that it does not see its target, if it is to.

    Raises:
        InputError: If it cannot.
    """
    missed = simulate.faults.missed
    try:
        line = line_without_point(settings, simulate)
    except TruearmError as error:
        raise error.at(f"{where}, simulate, answer") from None
    if missed > 0.0 and line is None:
        raise InputError(
            f"missed is {missed:g}, and no line of this sensor says that there is no point",
            where=f"{where}, simulate, faults",
            rule="A group ok in `answer`, or a pattern `nothing` that is a plain line, says that",
            way_out="Give one of them in [sensor], or leave out missed",
        )


def _answer_of(settings: LineSensor.Settings, simulate: SimulateSection, point: Floats, *, ok: bool) -> str:
    """The line that tells a point (3,), m."""
    unit_m = to_si(1.0, settings.length_unit)
    values = dict(zip("xyz", (point / unit_m).tolist(), strict=True)) | {
        "sigma": to_si(simulate.tracker_mm, "mm") / unit_m,
        "temperature": ROOM_C,
        "ok": float(ok),
    }
    return answer_for(settings.answer, values) if simulate.answer is None else filled(simulate.answer, values)


GROUP: Final = re.compile(r"\(\?P<(\w+)>(?:[^()\\]|\\.|\[[^\]]*\]|\((?:[^()\\]|\\.)*\))*\)")


def answer_for(pattern: str, values: dict[str, float]) -> str:
    """A line that a simple pattern matches, with numbers for its named groups; blanks for its blanks."""
    line = GROUP.sub(lambda match: f"{values.get(match[1], 0.0):.6f}", pattern)
    line = re.sub(r"\\s[*+]?", " ", line)
    return re.sub(r"\\(.)", r"\1", line).strip("^$")
