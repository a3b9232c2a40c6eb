"""What goes wrong on the way to and from a virtual device, drawn from a seed."""

from typing import Final

import numpy as np

from truearm.cell.cell_file import FaultsSection

PRINTABLE: Final = (33, 127)


class Faults:
    """Faults of the messages of one device."""

    def __init__(self, settings: FaultsSection, seed: int, device: int) -> None:
        self.settings = settings
        self._rng = np.random.default_rng([seed, device])

    def carried(self, message: bytes) -> list[tuple[float, bytes]]:
        """What becomes of a message: copies of it, each with the seconds that it is late."""
        settings, drawn = self.settings, self._rng.uniform()
        for share, kind in (
            (settings.lost, self._lost),
            (settings.delayed, self._delayed),
            (settings.duplicated, self._duplicated),
            (settings.garbled, self._garbled),
        ):
            if drawn < share:
                return kind(message)
            drawn -= share
        return [(0.0, message)]

    def restarts(self) -> bool:
        """Whether the device loses its power now."""
        return bool(self._rng.uniform() < self.settings.restart)

    def stops(self) -> bool:
        """Whether somebody presses the emergency stop now."""
        return bool(self._rng.uniform() < self.settings.emergency_stop)

    def _lost(self, message: bytes) -> list[tuple[float, bytes]]:
        del message
        return []

    def _delayed(self, message: bytes) -> list[tuple[float, bytes]]:
        return [(self.settings.delay_s, message)]

    def _duplicated(self, message: bytes) -> list[tuple[float, bytes]]:
        return [(0.0, message), (0.0, message)]

    def _garbled(self, message: bytes) -> list[tuple[float, bytes]]:
        """One to three characters become others; the end of the line stays."""
        damaged = bytearray(message)
        for _ in range(int(self._rng.integers(1, 4))):
            if damaged:
                damaged[int(self._rng.integers(len(damaged)))] = int(self._rng.integers(*PRINTABLE))
        return [(0.0, bytes(damaged))]
