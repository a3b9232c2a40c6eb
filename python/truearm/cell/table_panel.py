"""Driver of an x-y-z table that carries a touch panel: the pin on the tool touches, the panel sees where.

The line protocol is described in docs/reference/cell-protocols.md. Every request is numbered and summed, so
that a lost, damaged, late or doubled line does no harm: a request that had no answer is sent again with its
number, and the table does it once.

The world is the table's frame.
"""

import math
import threading
import time
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field, model_validator

from truearm.cell.device_errors import (
    DeviceError,
    DeviceRestartedError,
    DeviceSilentError,
    EmergencyStopError,
    RefusedError,
    StoppedError,
    silent,
)
from truearm.cell.framing import framed, unframed
from truearm.cell.line_port import LinePort, PortSection
from truearm.cell.panel import Panel
from truearm.cell.protocols import Managed
from truearm.cell.reading import Expected, Reading
from truearm.cell.schema import Positive, Section, Vector2, Vector3
from truearm.robot import Robot
from truearm.types import Floats
from truearm.units import MM_PER_METRE, to_si

Axis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]

SENDINGS: Final = 5
STANDOFF_MARGIN_M: Final = 0.005
ANSWER_NUMBERS: Final = 6
MOTION_MARGIN: Final = 1.5


class PanelSection(Section):
    """Keys of [sensor.panel]: the touch panel on the carriage."""

    area_mm: Vector2 = (133.0, 80.0)
    counts: Vector2 = (512.0, 256.0)
    offset_mm: Vector3 = (0.0, 0.0, 0.0)
    normal: Axis = "+z"
    u: Axis = "+x"
    least_angle_deg: Annotated[float, Field(ge=0.0, lt=90.0)] = 15.0

    @model_validator(mode="after")
    def _across(self) -> "PanelSection":
        if self.normal[1] == self.u[1]:
            raise ValueError(f"normal {self.normal} and u {self.u} are along the same axis")
        return self

    def geometry(self) -> Panel:
        """The panel in SI units."""
        return Panel.of(
            to_si(np.array(self.area_mm), "mm"),
            np.array(self.counts),
            to_si(np.array(self.offset_mm), "mm"),
            self.normal,
            self.u,
            float(np.radians(self.least_angle_deg)),
        )


class TablePanel(Managed):
    """The table and its panel as a sensor; see the module."""

    class Settings(PortSection):
        """Keys of [sensor] with driver "table-panel"."""

        driver: str = "table-panel"
        baud: int = 19200
        ranges_mm: Vector3 = (800.0, 560.0, 580.0)
        speed_mm_s: Positive = 100.0
        touch_speed_mm_s: Positive = 20.0
        sigma_mm: Positive = 0.06
        panel: PanelSection = PanelSection()

    def __init__(self, settings: Settings, arm: Robot) -> None:
        del arm
        self._settings, self.panel = settings, settings.panel.geometry()
        self.ranges_m = to_si(np.array(settings.ranges_mm), "mm")
        self._most_m = self.ranges_m.tolist()
        self._sigma_m = to_si(settings.sigma_mm, "mm")
        self._port = LinePort.of(self.name, settings)
        self._number = 0
        self._travel_m = 0.0
        self._carriage: Floats | None = None
        self._placed: tuple[Expected, Floats] | None = None
        self._busy = threading.RLock()

    @property
    def name(self) -> str:
        """See Device."""
        return "table"

    @property
    def address(self) -> str:
        """See Device."""
        return self._settings.port

    def connect(self) -> None:
        """Open the port, greet the table, and learn where its carriage is."""
        with self._busy, self._port.opened():
            self._number = 0
            self._ask("HELLO", self._port.limit_s)
            self._carriage = self._seen_carriage()

    def carriage_for(self, expected: Expected) -> Floats:
        """Where the carriage (3,) stands before it touches near an expected point, m.

        Raises:
            RefusedError: If the panel cannot be there, is too small for what is expected, or the pin would
                touch it at too small an angle.
        """
        if self._placed is None or self._placed[0] is not expected:
            self._placed = expected, self._carriage_for(expected)
        return self._placed[1]

    def _carriage_for(self, expected: Expected) -> Floats:
        panel, standoff = self.panel, expected.radius_m + STANDOFF_MARGIN_M
        if 2.0 * expected.radius_m > panel.shorter_m:
            across, along = (MM_PER_METRE * panel.area_m).tolist()
            raise RefusedError(
                f"the point may be {MM_PER_METRE * expected.radius_m:.0f} mm off",
                where=self._port.where,
                rule=f"The panel of {across:g} x {along:g} mm must catch it",
            )
        self._check_angle(expected)
        carriage = panel.carriage_under(expected.point_in_world, standoff)
        touching = carriage + (standoff + expected.radius_m) * panel.normal
        if not (self._holds(carriage) and self._holds(touching)):
            place = ", ".join(f"{MM_PER_METRE * value:.0f}" for value in carriage)
            raise RefusedError(
                f"the carriage would have to be at {place} mm",
                where=self._port.where,
                rule=f"It moves from 0, 0, 0 to {self._settings.ranges_mm} mm",
            )
        return carriage

    def _check_angle(self, expected: Expected) -> None:
        """Raise RefusedError unless the pin meets the panel at the least angle, however it may be turned."""
        angle, least = self.panel.angle(expected.pointing_in_world), self.panel.least_angle_rad
        if angle >= least + expected.turned_rad:
            return
        by = f", and it may be turned by {np.degrees(expected.turned_rad):.1f}" if expected.turned_rad else ""
        raise RefusedError(
            f"the pin meets the panel at {np.degrees(angle):.1f} deg",
            where=self._port.where,
            rule=f"At least {np.degrees(least):g} deg are needed{by}",
        )

    def _holds(self, carriage: Floats) -> bool:
        """Whether a place (3,) is within the table's ranges; plain numbers are quicker for so few."""
        return all(0.0 <= at <= most for at, most in zip(carriage.tolist(), self._most_m, strict=True))

    def prepare(self, expected: Expected) -> None:
        """See Sensor. The panel waits under the point, out of reach of what is expected."""
        carriage = self.carriage_for(expected)
        with self._busy:
            self._travel_m = 2.0 * expected.radius_m + 2.0 * STANDOFF_MARGIN_M
            self._move(carriage)

    def go_to(self, carriage: Floats) -> None:
        """Move the carriage to a place (3,), m."""
        with self._busy:
            self._move(carriage)

    def measure(self) -> Reading:
        """See Sensor. The panel comes up until it is touched, and goes back to where it waited."""
        seconds = 2.0 * MM_PER_METRE * self._travel_m / self._settings.touch_speed_mm_s
        with self._busy:
            answer = self._ask(f"TOUCH {MM_PER_METRE * self._travel_m:.3f}", self._limit(seconds))
        now, sigma_m = time.time(), self._sigma_m
        if answer == "NONE":
            return Reading(None, sigma_m, now, False, answer, "no contact")
        *place, u, v, temperature_c = _numbers(answer, ANSWER_NUMBERS, self._port.where)
        point = self.panel.point([value / MM_PER_METRE for value in place], u, v)
        return Reading(point, sigma_m, now, True, answer, temperature_c=temperature_c)

    def release(self) -> None:
        """See Sensor. The panel goes back along its normal to the end of the table's range."""
        with self._busy:
            if self._carriage is not None:
                self._move(self.released(self._carriage))

    def released(self, carriage: Floats) -> Floats:
        """Where the carriage (3,) is once it is out of the arm's way, coming from a place (3,)."""
        across = 1.0 - np.abs(self.panel.normal)
        end = np.where(self.panel.normal > 0.0, 0.0, self.ranges_m)
        return np.asarray(np.where(across > 0.0, carriage, end))

    def lowered(self, carriage: Floats, depth_m: float) -> Floats:
        """Where the carriage (3,) is when it goes back by `depth_m` from a place (3,), as far as it can."""
        back = carriage - depth_m * self.panel.normal
        return np.asarray(np.minimum(np.maximum(back, 0.0), self.ranges_m))

    @property
    def carriage(self) -> Floats | None:
        """Where the carriage is (3,), m; None while it is not connected."""
        return self._carriage

    def stop(self) -> None:
        """See Device."""
        self._port.interrupt()
        with self._busy:
            self._port.resume()
            if self._port.is_open:
                self._ask("STOP", self._port.limit_s)
                self._carriage = self._seen_carriage()

    def close(self) -> None:
        """See Device."""
        self._port.close()
        self._carriage = None

    def _move(self, carriage: Floats) -> None:
        if self._carriage is None:
            raise DeviceError("not connected", where=self._port.where, way_out="Connect it first")
        x, y, z = place = (MM_PER_METRE * carriage).tolist()
        way_mm = math.dist(place, (MM_PER_METRE * self._carriage).tolist())
        self._ask(f"MOVE {x:.3f} {y:.3f} {z:.3f}", self._limit(way_mm / self._settings.speed_mm_s))
        self._carriage = carriage

    def _seen_carriage(self) -> Floats:
        return _point(self._ask("WHERE", self._port.limit_s), self._port.where)

    def _limit(self, seconds: float) -> float:
        return self._port.limit_s + MOTION_MARGIN * seconds

    def _ask(self, text: str, limit_s: float) -> str:
        """Send a request until it is answered; what stands behind OK, or NONE."""
        number, self._number = self._number, self._number + 1
        line = framed(number, text)
        for _ in range(SENDINGS):
            self._port.send(line)
            answer = self._answer(number, limit_s)
            if answer is not None:
                return self._accepted(answer, text)
        raise silent(
            self.name, self.address, limit_s, doing=f"{text.split(maxsplit=1)[0]} ({SENDINGS} times)"
        )

    def _answer(self, number: int, limit_s: float) -> str | None:
        """The answer with this number; None if it is late or something was damaged on the way."""
        until = time.monotonic() + limit_s
        while True:
            try:
                line = self._port.receive(max(0.0, until - time.monotonic()))
            except DeviceSilentError:
                return None
            received = unframed(line)
            if received is None or received[1] == "ERR DAMAGED":
                return None
            if received[0] == number:
                return received[1]

    def _accepted(self, answer: str, text: str) -> str:
        word, _, rest = answer.partition(" ")
        if word == "OK":
            return rest
        if word == "NONE":
            return answer
        code, _, words = rest.partition(" ")
        where, what = self._port.where, f"{text.split(maxsplit=1)[0]}: {words or code}"
        if code == "ESTOP":
            raise EmergencyStopError(
                what, where=where, way_out="Release the button and start again: the session continues"
            )
        if code == "HELLO":
            raise DeviceRestartedError(what, where=where, way_out="Connect it again")
        if code == "STOPPED":
            raise StoppedError(what, where=where)
        if code in ("RANGE", "SYNTAX"):
            raise RefusedError(what, where=where)
        raise DeviceError(what, where=where)


def _numbers(text: str, count: int, where: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise DeviceError(f'"{text}" was answered', where=where, rule=f"{count} numbers were expected")
    return numbers


def _point(text: str, where: str) -> Floats:
    return to_si(np.array(_numbers(text, 3, where)), "mm")
