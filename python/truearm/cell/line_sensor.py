"""Driver of any instrument that tells points in lines: when asked, or in a stream as laser trackers do."""

import threading
import time
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from truearm.cell.device_errors import DeviceSilentError, silent
from truearm.cell.line_port import LinePort, LineSection
from truearm.cell.patterns import numbers_in, pattern_of
from truearm.cell.reading import Expected, Reading
from truearm.cell.schema import Positive
from truearm.robot import Robot
from truearm.units import MM_PER_METRE, LengthUnit, to_si

Floats = NDArray[np.float64]

XYZ: Final = ("x", "y", "z")


class LineSensor:
    """An instrument whose lines match `answer`, a pattern with groups x, y, z; sigma, ok, temperature if any.

    With `trigger` it is asked for every line; without, it streams, and the lines that come after the arm has
    settled are averaged. A group `ok` must be 1 for the point to count. All other groups become features.
    """

    class Settings(LineSection):
        """Keys of [sensor] with driver "line"."""

        driver: str = "line"
        length_unit: LengthUnit = "mm"
        answer: str
        trigger: str | None = None
        setup: tuple[str, ...] = ()
        average: Annotated[int, Field(ge=1)] = 1
        settle_s: Annotated[float, Field(ge=0.0)] = 0.5
        spread_mm: Positive = 0.2
        sigma_mm: Positive = 0.02

        @field_validator("answer")
        @classmethod
        def _answer(cls, value: str) -> str:
            pattern_of(value, XYZ)
            return value

    def __init__(self, settings: Settings, arm: Robot) -> None:
        del arm
        self._settings = settings
        self._answer = pattern_of(settings.answer, XYZ)
        self._port = LinePort.of(self.name, settings, terminator=settings.terminator)
        self._busy = threading.RLock()

    @property
    def name(self) -> str:
        """See Device."""
        return "instrument"

    @property
    def address(self) -> str:
        """See Device."""
        return self._settings.port

    def connect(self) -> None:
        """Open the port and send the lines of `setup`."""
        with self._busy, self._port.opened():
            for line in self._settings.setup:
                self._port.send(line)

    def prepare(self, expected: Expected) -> None:
        """See Sensor. Nothing to do: the instrument follows its target."""

    def measure(self) -> Reading:
        """See Sensor. The mean of `average` lines; not valid if they spread, or the instrument says so."""
        with self._busy:
            time.sleep(self._settings.settle_s)
            self._port.drain()
            until = time.monotonic() + self._settings.timeout_s * self._settings.average
            lines: list[tuple[str, dict[str, float]]] = []
            while len(lines) < self._settings.average:
                if time.monotonic() > until:
                    raise silent(self.name, self.address, self._settings.timeout_s, doing="measure")
                line = self._line()
                numbers = None if line is None else numbers_in(self._answer, line)
                if line is not None and numbers is not None and numbers.keys() >= set(XYZ):
                    lines.append((line, numbers))
        return self._reading(lines)

    def release(self) -> None:
        """See Sensor. Nothing to do."""

    def stop(self) -> None:
        """See Device."""
        self._port.end_waits(self._busy)

    def close(self) -> None:
        """See Device."""
        self._port.close()

    def _line(self) -> str | None:
        if self._settings.trigger is not None:
            self._port.drain()
            self._port.send(self._settings.trigger)
        try:
            return self._port.receive(doing="measure")
        except DeviceSilentError:
            if self._settings.trigger is None:
                raise
            return None

    def _reading(self, lines: list[tuple[str, dict[str, float]]]) -> Reading:
        names = dict.fromkeys(name for _, each in lines for name in each)
        numbers = {name: np.array([each.get(name, np.nan) for _, each in lines]) for name in names}
        unit = self._settings.length_unit
        points = to_si(np.column_stack([numbers.pop(axis) for axis in XYZ]), unit)
        sigma = numbers.pop("sigma", None)
        stated = to_si(self._settings.sigma_mm, "mm")
        sigma_m = stated if sigma is None else to_si(float(np.nanmean(sigma)), unit)
        temperature = numbers.pop("temperature", None)
        reason = ""
        if not np.all(numbers.pop("ok", np.ones(1)) == 1.0):
            reason = "the instrument does not vouch for it"
        elif np.ptp(points, axis=0).max() > to_si(self._settings.spread_mm, "mm"):
            reason = f"the lines spread by {MM_PER_METRE * np.ptp(points, axis=0).max():.2f} mm"
        return Reading(
            points.mean(axis=0),
            sigma_m,
            time.time(),
            not reason,
            "; ".join(line for line, _ in lines),
            reason,
            temperature_c=None if temperature is None else float(np.nanmean(temperature)),
            features={name: float(np.nanmean(values)) for name, values in numbers.items()},
        )
