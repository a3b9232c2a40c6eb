"""A virtual Movemaster controller."""

from collections import deque
from typing import Final

import numpy as np

from truearm.cell import movemaster
from truearm.cell.rv_m2 import RvM2
from truearm.cell.virtual.state import STOPPED
from truearm.cell.virtual.world import World
from truearm.types import Floats
from truearm.units import RADIANS_PER_DEGREE

SETTLING_S: Final = 0.1
ORIGIN_SPEED: Final = 3


class VirtualRvM2:
    """Does one command after another; moves by increments; tells its nominal position, rounded."""

    terminator = movemaster.TERMINATOR

    def __init__(self, world: World, settings: RvM2.Settings) -> None:
        self._world, self._arm = world, world.cell.arm
        self._origin = np.array(settings.origin_deg) * RADIANS_PER_DEGREE
        self._kept: dict[int, Floats] = {}
        self.restart()

    def restart(self) -> None:
        """See Machine. The arm stays where it is, and the controller does not know where that is."""
        self._queue: deque[str] = deque()
        self._busy_until = 0.0
        self._speed, self._error = 3, movemaster.NO_ERROR
        self._at: Floats | None = None

    def received(self, line: str, now: float) -> list[tuple[float, str]]:
        """See Machine."""
        self._queue.append(line)
        return self.pending(now)

    def pending(self, now: float) -> list[tuple[float, str]]:
        """See Machine."""
        answers = []
        while self._queue and now >= self._busy_until:
            answer = self._do(self._queue.popleft().strip(), now)
            if answer is not None:
                answers.append((now, answer))
        return answers

    def next_event(self) -> float | None:
        """See Machine."""
        return self._busy_until if self._queue else None

    def _do(self, line: str, now: float) -> str | None:
        word, numbers = line[:2], line[2:].strip()
        if self._world.shared.flag(STOPPED):
            self._at = None
        if word == "WH":
            return self._where()
        if word == "ER" and not numbers:
            return movemaster.HARDWARE_ERROR if self._world.shared.flag(STOPPED) else self._error
        if word == "RS" and not numbers:
            self._error = movemaster.NO_ERROR
        elif self._world.shared.flag(STOPPED):
            return None
        elif self._error == movemaster.NO_ERROR and not self._move(word, numbers, now):
            self._error = movemaster.COMMAND_ERROR
        return None

    def _where(self) -> str:
        if self._at is None:
            return movemaster.listed([0] * movemaster.JOINTS)
        where = movemaster.whereabouts(self._arm, self._at)
        return movemaster.listed([round(10.0 * value) for value in where])

    def _move(self, word: str, numbers: str, now: float) -> bool:
        """Do a command that moves or sets something; whether it could be done."""
        if word == "NT" and not numbers:
            self._go(self._origin, ORIGIN_SPEED, now)
            return True
        if word == "SP":
            return self._set_speed(numbers)
        if self._at is None:
            return False
        if word in ("HE", "MO"):
            return self._kept_place(word, numbers, now)
        target = self._target(word, numbers, self._at)
        if target is None:
            return False
        self._go(target, self._speed, now)
        return True

    def _set_speed(self, numbers: str) -> bool:
        if not (numbers.isdigit() and int(numbers) < len(movemaster.SPEEDS_DEG_S)):
            return False
        self._speed = int(numbers)
        return True

    def _kept_place(self, word: str, numbers: str, now: float) -> bool:
        if not numbers.isdigit() or self._at is None:
            return False
        if word == "HE":
            self._kept[int(numbers)] = self._at
            return True
        if int(numbers) not in self._kept:
            return False
        self._go(self._kept[int(numbers)], self._speed, now)
        return True

    def _target(self, word: str, numbers: str, at: Floats) -> Floats | None:
        """Readings that MJ or MP leads to; None if it cannot be done."""
        parsed = movemaster.parse_numbers(numbers)
        if parsed is None or word not in ("MJ", "MP"):
            return None
        if word == "MJ":
            target: Floats | None = at + movemaster.readings_of(parsed)
        else:
            target = movemaster.readings_near(self._arm, [0.1 * each for each in parsed], at)
        low, high = self._arm.limits.T
        if target is None or (target < low - 1e-9).any() or (target > high + 1e-9).any():
            return None
        return target

    def _go(self, target: Floats, speed: int, now: float) -> None:
        way = float(np.abs(target - self._world.arm.at(now)).max()) / RADIANS_PER_DEGREE
        seconds = SETTLING_S + way / movemaster.SPEEDS_DEG_S[speed]
        self._busy_until = self._world.arm.go(target, seconds, now)
        self._at = target
        self._world.watch(now)
