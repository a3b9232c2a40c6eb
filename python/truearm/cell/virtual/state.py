"""What the processes of a virtual cell share: the clock, and where arm and table are and go to."""

import mmap
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.cell.virtual.exclusive import exclusive

Floats = NDArray[np.float64]

SIZE: Final = 64
MOST_JOINTS: Final = 8
# Places in the shared array.
BEGAN, SPEED, STOPPED, COLLISIONS, CONTACTS, MOTIONS = range(6)
ARM, TABLE = 8, 40
FROM, TO, BEGIN, END, CAME = 0, MOST_JOINTS, 2 * MOST_JOINTS, 2 * MOST_JOINTS + 1, 2 * MOST_JOINTS + 2


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
    """Something that moves evenly from place to place: the arm's joints, or the carriage of the table."""

    def __init__(self, shared: Shared, offset: int, size: int) -> None:
        self._shared, self._offset, self._size = shared, offset, size

    def at(self, now: float) -> Floats:
        """Where it is at a time (size,)."""
        with self._shared.locked() as values:
            return self._place(values, now)

    def speed(self, now: float) -> Floats:
        """How fast it moves (size,), per second."""
        with self._shared.locked() as values:
            begin, end = values[self._offset + BEGIN], values[self._offset + END]
            if not begin <= now < end:
                return np.zeros(self._size)
            return np.asarray((self._slice(values, TO) - self._slice(values, FROM)) / (end - begin))

    def ends(self) -> float:
        """When the motion under way ends, or the last one ended."""
        with self._shared.locked() as values:
            return float(values[self._offset + END])

    def last_direction(self) -> Floats:
        """Signs (size,) of the last motion of each."""
        with self._shared.locked() as values:
            return self._slice(values, CAME).copy()

    def go(self, place: Floats, seconds: float, now: float) -> float:
        """Start a motion; when it will end."""
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
            values[MOTIONS] += 1.0
            return now + seconds

    def halt(self, now: float) -> None:
        """Stand still where it is."""
        with self._shared.locked() as values:
            here = self._place(values, now)
            self._slice(values, FROM)[:] = here
            self._slice(values, TO)[:] = here
            values[self._offset + END] = min(float(values[self._offset + END]), now)

    def _place(self, values: Floats, now: float) -> Floats:
        begin, end = float(values[self._offset + BEGIN]), float(values[self._offset + END])
        if now >= end:
            return self._slice(values, TO).copy()
        share = max(0.0, (now - begin) / (end - begin))
        start = self._slice(values, FROM)
        return np.asarray(start + share * (self._slice(values, TO) - start))

    def _slice(self, values: Floats, part: int) -> Floats:
        first = self._offset + part
        return values[first : first + self._size]
