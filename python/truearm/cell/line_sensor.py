"""Driver of any instrument that tells points in lines: when asked, or in a stream as laser trackers do."""

import contextlib
import re
import threading
import time
from typing import Annotated, Final

import numpy as np
from pydantic import Field, field_validator

from truearm.cell.channels import tcp_place
from truearm.cell.device_errors import DeviceError, DeviceSilentError
from truearm.cell.line_port import LinePort, LineSection
from truearm.cell.patterns import expression, numbers_in, pattern_of
from truearm.cell.protocols import Managed
from truearm.cell.reading import Expected, Reading, is_column
from truearm.cell.schema import Positive
from truearm.robot import Robot
from truearm.types import Floats
from truearm.units import MM_PER_METRE, StatedLengthUnit, to_si

Numbers = dict[str, float]

XYZ: Final = ("x", "y", "z")
KNOWN: Final = (*XYZ, "sigma", "ok", "temperature")
SENDINGS: Final = 3
READ_EVERY_S: Final = 0.05
ENDS_WITHIN_S: Final = 1.0
NO_POINT: Final = ", or give `nothing`, which lines that mean that there is no point fit"


class LineSensor(Managed):
    """An instrument whose lines match `answer`, a pattern with groups x, y, z; sigma, ok, temperature if any.

    With `trigger` it is asked for every line; without, it streams, and the lines that come after the arm has
    settled are averaged. Lines are read all the time then, so that none grows old on the way. Answers that a
    former measurement has not waited for are waited for by the next one, and forgotten.

    A group `ok` must be 1 for the point to count. All other groups become features. A line that matches
    `nothing` says that there is no point, as where a tracker does not see its target.
    """

    class Settings(LineSection):
        """Keys of [sensor] with driver "line"."""

        driver: str = "line"
        length_unit: StatedLengthUnit = "mm"
        answer: str
        nothing: str | None = None
        trigger: str | None = None
        setup: tuple[str, ...] = ()
        average: Annotated[int, Field(ge=1)] = 1
        settle_s: Annotated[float, Field(ge=0.0)] = 0.5
        spread_mm: Positive = 0.2
        sigma_mm: Positive = 0.02

        @field_validator("answer")
        @classmethod
        def _answer(cls, value: str) -> str:
            taken = [
                name for name in pattern_of(value, XYZ).groupindex if name not in KNOWN and is_column(name)
            ]
            if taken:
                raise ValueError(
                    f"group (?P<{taken[0]}>...) would be a feature, and measurement files have a column of "
                    "that name already; it needs another name"
                )
            return value

        @field_validator("nothing")
        @classmethod
        def _nothing(cls, value: str | None) -> str | None:
            return None if value is None else expression(value)

    def __init__(self, settings: Settings, arm: Robot) -> None:
        del arm
        self._settings = settings
        self._answer = pattern_of(settings.answer, XYZ)
        self._nothing = None if settings.nothing is None else re.compile(settings.nothing)
        self._port = LinePort.of(self.name, settings, terminator=settings.terminator)
        self._busy = threading.RLock()
        self._late = _Late(settings.timeout_s)
        self._closed = threading.Event()
        self._idle: threading.Thread | None = None

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
        if tcp_place(self.address) is not None:
            self._late.forget()
        with self._busy, self._port.opened():
            for line in self._settings.setup:
                self._port.send(line)
        if self._settings.trigger is None:
            self._closed.clear()
            self._idle = threading.Thread(target=self._read_on, daemon=True)
            self._idle.start()

    def prepare(self, expected: Expected) -> None:
        """See Sensor. Nothing to do: the instrument follows its target."""

    def measure(self) -> Reading:
        """See Sensor. The mean of `average` lines; not valid if they spread, or the instrument says so."""
        lines: list[tuple[str, Numbers]] = []
        with self._busy:
            self._wait_for_late()
            self._port.pass_over(self._settings.settle_s)
            while len(lines) < self._settings.average:
                line, numbers = self._line()
                if not numbers:
                    return Reading(None, self._stated_m, time.time(), False, line, f'it says "{line}"')
                lines.append((line, numbers))
        return self._reading(lines)

    def release(self) -> None:
        """See Sensor. Nothing to do."""

    def stop(self) -> None:
        """See Device."""
        self._port.end_waits(self._busy)

    def close(self) -> None:
        """See Device."""
        self._closed.set()
        idle, self._idle = self._idle, None
        if idle is not None:
            idle.join(ENDS_WITHIN_S)
        self._port.close()

    def _read_on(self) -> None:
        """Forget the lines of a stream while nothing is measured; the next reading tells what ended it."""
        with contextlib.suppress(DeviceError):
            while not self._closed.wait(READ_EVERY_S):
                with self._busy:
                    self._port.drain()

    def _wait_for_late(self) -> None:
        """Forget answers that were asked for by a former measurement, where the arm stood elsewhere."""
        while self._late.owed and (left := self._late.until_s - time.monotonic()) > 0.0:
            try:
                self._port.answer(self._meaning, doing="measure", key="answer", limit_s=left)
            except DeviceSilentError:
                break
            self._late.answered()
        self._late.forget()

    def _line(self) -> tuple[str, Numbers]:
        """The next line that says a point, or that there is none; asked for, and again where it is lost."""
        if self._settings.trigger is not None:
            for _ in range(SENDINGS - 1):
                with contextlib.suppress(DeviceSilentError):
                    return self._asked(self._settings.trigger)
            return self._asked(self._settings.trigger)
        return self._next()

    def _asked(self, trigger: str) -> tuple[str, Numbers]:
        for line in self._port.drain():
            if self._meaning(line) is not None:
                self._late.answered()
        self._port.send(trigger)
        self._late.asked()
        found = self._next()
        self._late.answered()
        return found

    def _next(self) -> tuple[str, Numbers]:
        return self._port.answer(self._meaning, doing="measure", key="answer", way_out=NO_POINT)

    def _meaning(self, line: str) -> tuple[str, Numbers] | None:
        """A line with its numbers; with none where it says that there is no point."""
        if self._nothing is not None and self._nothing.search(line):
            return line, {}
        numbers = numbers_in(self._answer, line)
        return None if numbers is None or not numbers.keys() >= set(XYZ) else (line, numbers)

    @property
    def _stated_m(self) -> float:
        return to_si(self._settings.sigma_mm, "mm")

    def _sigma_m(self, told: Floats) -> float:
        """Mean of what lines (n,) say of sigma, that of the cell file where none says what one can be."""
        believed = told[np.isfinite(told) & (told > 0.0)]
        return to_si(float(believed.mean()), self._settings.length_unit) if believed.size else self._stated_m

    def _reading(self, lines: list[tuple[str, Numbers]]) -> Reading:
        names = dict.fromkeys(name for _, each in lines for name in each)
        numbers = {name: np.array([each.get(name, np.nan) for _, each in lines]) for name in names}
        points = to_si(np.column_stack([numbers.pop(axis) for axis in XYZ]), self._settings.length_unit)
        sigma_m = self._sigma_m(numbers.pop("sigma", np.zeros(0)))
        vouched = bool(np.all(numbers.pop("ok", np.ones(1)) == 1.0))
        means = {name: _mean(values) for name, values in numbers.items()}
        reason = self._doubt(points, vouched=vouched)
        return Reading(
            points.mean(axis=0) if np.isfinite(points).all() else None,
            sigma_m,
            time.time(),
            not reason,
            "; ".join(line for line, _ in lines),
            reason,
            temperature_c=means.pop("temperature", None),
            features={name: value for name, value in means.items() if value is not None},
        )

    def _doubt(self, points: Floats, *, vouched: bool) -> str:
        """Why points (n, 3) of one reading do not count; empty where they do."""
        if not vouched:
            return "the instrument does not vouch for it"
        if not np.isfinite(points).all():
            return "a coordinate is no number"
        spread_m = float(np.ptp(points, axis=0).max())
        if spread_m > to_si(self._settings.spread_mm, "mm"):
            return f"the lines spread by {MM_PER_METRE * spread_m:.2f} mm"
        return ""


class _Late:
    """How many answers are still owed, and until when they may come.

    One that was lost never comes. One that is late takes about as long as the first one took at the most.
    """

    def __init__(self, limit_s: float) -> None:
        self._limit_s = limit_s
        self._first_s = self._last_s = self._took_s = 0.0
        self.owed = 0

    @property
    def until_s(self) -> float:
        """Time, of the monotonic clock, at which what has not come is lost."""
        return self._last_s + self._took_s + self._limit_s

    def asked(self) -> None:
        """A trigger was sent."""
        self._last_s = time.monotonic()
        if not self.owed:
            self._first_s = self._last_s
        self.owed += 1
        self._took_s = SENDINGS * self._limit_s

    def answered(self) -> None:
        """An answer has come."""
        self.owed = max(0, self.owed - 1)
        self._took_s = time.monotonic() - self._first_s

    def forget(self) -> None:
        """Nothing is owed any more."""
        self.owed = 0


def _mean(values: Floats) -> float | None:
    """Mean of those that are finite; None where none is."""
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else None
