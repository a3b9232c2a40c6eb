"""A virtual x-y-z table with a touch panel: the other side of docs/reference/cell-protocols.md."""

from collections.abc import Callable
from typing import Final

import numpy as np

from truearm.cell.framing import framed, unframed
from truearm.cell.table_panel import TablePanel
from truearm.cell.virtual.state import STOPPED
from truearm.cell.virtual.world import ROOM_C, World
from truearm.types import Floats
from truearm.units import MM_PER_METRE, to_si

Answers = list[tuple[float, str]]

SETTLING_S: Final = 0.05
NUMBERS: Final = {"MOVE": 3, "TOUCH": 1}


class VirtualTablePanel:
    """Answers numbered requests, each done once."""

    terminator = b"\n"

    def __init__(self, world: World, settings: TablePanel.Settings) -> None:
        self._world, self._settings = world, settings
        self._panel = settings.panel.geometry()
        self.restart()

    def restart(self) -> None:
        """See Machine. The carriage stays where it is."""
        self._greeted = False
        self._answered: dict[int, str] = {}
        self._running: tuple[int, float, str] | None = None

    def received(self, line: str, now: float) -> Answers:
        """See Machine."""
        request = unframed(line)
        if request is None:
            return [(now, framed(0, "ERR DAMAGED"))]
        number, text = request
        if text == "HELLO":
            self.restart()
            self._greeted = True
        if number in self._answered:
            return [(now, framed(number, self._answered[number]))]
        if self._running is not None and self._running[0] == number:
            return []
        return self._begin(number, text, now)

    def pending(self, now: float) -> Answers:
        """See Machine."""
        if self._running is None or now < self._running[1]:
            return []
        number, due, text = self._running
        self._running = None
        stopped = self._world.shared.flag(STOPPED)
        return self._answer(number, "ERR ESTOP emergency stop" if stopped else text, due)

    def next_event(self) -> float | None:
        """See Machine."""
        return None if self._running is None else self._running[1]

    def _begin(self, number: int, text: str, now: float) -> Answers:
        word, *parts = text.split()
        if not self._greeted:
            return self._answer(number, "ERR HELLO the table was started anew", now)
        at_once: dict[str, Callable[[], str]] = {
            "HELLO": lambda: "OK truearm-table 1",
            "WHERE": lambda: f"OK {_listed(self._world.table.at(now))}",
            "STOP": lambda: self._stop(now),
        }
        if word in at_once:
            return self._answer(number, at_once[word](), now)
        numbers = _numbers(parts)
        problem = self._problem(word, numbers)
        if problem or numbers is None:
            return self._answer(number, f"ERR {problem}", now)
        return self._move(number, numbers, now) if word == "MOVE" else self._touch(number, numbers, now)

    def _problem(self, word: str, numbers: Floats | None) -> str:
        """Why a motion cannot begin; empty if it can."""
        if numbers is None or len(numbers) != NUMBERS.get(word, -1):
            return "SYNTAX there is no such request"
        if self._world.shared.flag(STOPPED):
            return "ESTOP emergency stop"
        return "" if self._running is None else "BUSY another motion is under way"

    def _move(self, number: int, numbers: Floats, now: float) -> Answers:
        place = to_si(numbers, "mm")
        if (place < -1e-9).any() or (place > to_si(np.array(self._settings.ranges_mm), "mm") + 1e-9).any():
            return self._answer(number, "ERR RANGE that is beyond the ranges", now)
        way_mm = MM_PER_METRE * float(np.linalg.norm(place - self._world.table.at(now)))
        end = self._world.table.go(place, SETTLING_S + way_mm / self._settings.speed_mm_s, now)
        self._world.watch(now)
        self._running = (number, end, "OK")
        return []

    def _touch(self, number: int, numbers: Floats, now: float) -> Answers:
        travel_m = to_si(float(numbers[0]), "mm")
        touch = self._world.touch(travel_m, now)
        way_m = travel_m if touch is None else touch.way_m
        seconds = SETTLING_S + 2.0 * MM_PER_METRE * way_m / self._settings.touch_speed_mm_s
        carriage = self._world.table.at(now)
        text = "NONE"
        if touch is not None:
            at = carriage + way_m * self._panel.normal
            text = f"OK {_listed(at)} {touch.counts[0]:.1f} {touch.counts[1]:.1f} {ROOM_C:.2f}"
        self._running = (number, now + seconds, text)
        return []

    def _stop(self, now: float) -> str:
        self._world.table.halt(now)
        if self._running is not None:
            self._answered[self._running[0]] = "ERR STOPPED the motion was stopped"
            self._running = None
        return "OK"

    def _answer(self, number: int, text: str, due: float) -> Answers:
        self._answered[number] = text
        if len(self._answered) > REMEMBERED:
            self._answered.pop(next(iter(self._answered)))
        return [(due, framed(number, text))]


REMEMBERED: Final = 32


def _numbers(parts: list[str]) -> Floats | None:
    try:
        return np.array([float(part) for part in parts])
    except ValueError:
        return None


def _listed(place: Floats) -> str:
    return " ".join(f"{MM_PER_METRE * value:.3f}" for value in place)
