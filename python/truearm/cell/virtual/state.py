"""What the processes of a virtual cell share: the clock, and where arm and table are and go to."""

import math
import mmap
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import numpy as np

from truearm.cell.virtual.exclusive import exclusive
from truearm.types import Floats

SIZE: Final = 72
MOST_JOINTS: Final = 8
# Places in the shared array.
BEGAN, SPEED, STOPPED, COLLISIONS, CONTACTS, MOTIONS = range(6)
ARM, TABLE = 8, 40
FROM, TO, BEGIN, END, CAME = 0, MOST_JOINTS, 2 * MOST_JOINTS, 2 * MOST_JOINTS + 1, 2 * MOST_JOINTS + 2
LAG: Final = CAME + MOST_JOINTS
# Behind so many lags less than a millionth of what a motion lagged is left.
SETTLES_IN_LAGS: Final = 14.0


class Shared:
    """The shared array, in a file that every process maps.

    Times are of the virtual clock, in seconds; it runs `speed` times as fast as a real one.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("r+b")
        self._map = mmap.mmap(self._file.fileno(), 8 * SIZE)
        self._values = np.frombuffer(self._map, dtype=np.float64)

    @classmethod
    def create(cls, path: Path, speed: float) -> "Shared":
        """A new cell at rest, its clock starting now."""
        path.write_bytes(bytes(8 * SIZE))
        shared = cls(path)
        shared._values[BEGAN], shared._values[SPEED] = time.monotonic(), speed
        return shared

    def close(self) -> None:
        """Let go of the file."""
        self._values = np.empty(0)
        self._map.close()
        self._file.close()

    @property
    def speed(self) -> float:
        """How much faster than a real clock."""
        return float(self._values[SPEED])

    def now(self) -> float:
        """Virtual time, s."""
        return (time.monotonic() - float(self._values[BEGAN])) * self.speed

    @contextmanager
    def locked(self) -> Iterator[Floats]:
        """The array, while no other process changes it."""
        with exclusive(self._file):
            yield self._values

    def count(self, place: int) -> int:
        """Add one at a place; how many there were before."""
        with self.locked() as values:
            before = int(values[place])
            values[place] += 1.0
        return before

    def flag(self, place: int) -> bool:
        """Whether something is set."""
        return bool(self._values[place])

    def set_flag(self, place: int, value: bool) -> None:
        """Set or clear something."""
        with self.locked() as values:
            values[place] = float(value)


class Mover:
    """Something that moves evenly from place to place: the arm's joints, or the carriage of the table.

    Where a motion has a lag, it follows the even motion like a servo of the first order, and creeps to its
    place when that has ended.
    """

    def __init__(self, shared: Shared, offset: int, size: int) -> None:
        self._shared, self._offset, self._size = shared, offset, size

    def at(self, now: float) -> Floats:
        """Where it is at a time (size,)."""
        with self._shared.locked() as values:
            return self._place(values, now)

    def speed(self, now: float) -> Floats:
        """How fast it moves (size,), per second."""
        with self._shared.locked() as values:
            share_per_s = self._progress(values, now)[1]
            return np.asarray(share_per_s * (self._slice(values, TO) - self._slice(values, FROM)))

    def ends(self) -> float:
        """When the motion under way ends, or the last one ended; with what it lags, but for a millionth."""
        with self._shared.locked() as values:
            return float(values[self._offset + END] + SETTLES_IN_LAGS * values[self._offset + LAG])

    def last_direction(self) -> Floats:
        """Signs (size,) of the last motion of each."""
        with self._shared.locked() as values:
            return self._slice(values, CAME).copy()

    def go(self, place: Floats, seconds: float, now: float, lag_s: float = 0.0) -> float:
        """Start a motion; when it is commanded to end, which it follows with a lag."""
        with self._shared.locked() as values:
            if values[STOPPED]:
                return now
            here = self._place(values, now)
            self._slice(values, FROM)[:] = here
            self._slice(values, TO)[:] = place
            came = np.sign(np.round(place - here, 12))
            moved = came != 0.0
            self._slice(values, CAME)[moved] = came[moved]
            values[self._offset + BEGIN], values[self._offset + END] = now, now + seconds
            values[self._offset + LAG] = lag_s
            values[MOTIONS] += 1.0
            return now + seconds

    def halt(self, now: float) -> None:
        """Stand still where it is."""
        with self._shared.locked() as values:
            here = self._place(values, now)
            self._slice(values, FROM)[:] = here
            self._slice(values, TO)[:] = here
            values[self._offset + END] = min(float(values[self._offset + END]), now)
            values[self._offset + LAG] = 0.0

    def _place(self, values: Floats, now: float) -> Floats:
        left = 1.0 - self._progress(values, now)[0]
        place = self._slice(values, TO)
        return np.asarray(place - left * (place - self._slice(values, FROM)))

    def _progress(self, values: Floats, now: float) -> tuple[float, float]:
        """Which share of the way is done, and how fast it grows, per second."""
        begin, end, lag_s = (float(values[self._offset + part]) for part in (BEGIN, END, LAG))
        seconds, since, behind = end - begin, max(0.0, now - begin), max(0.0, now - end)
        if seconds <= 0.0:
            return 1.0, 0.0
        if lag_s <= 0.0:
            return min(1.0, since / seconds), 1.0 / seconds if begin <= now < end else 0.0
        faded = math.exp(-behind / lag_s)
        caught_up = -math.expm1(-min(since, seconds) / lag_s) * faded
        return min(since, seconds) / seconds - caught_up * lag_s / seconds, caught_up / seconds

    def _slice(self, values: Floats, part: int) -> Floats:
        first = self._offset + part
        return values[first : first + self._size]
