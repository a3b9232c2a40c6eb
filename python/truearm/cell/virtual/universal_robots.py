"""A virtual controller of Universal Robots: takes URScript lines, streams its state."""

import re
from typing import Final

import numpy as np

from truearm.cell import ur_packets
from truearm.cell.virtual.faults import Faults
from truearm.cell.virtual.state import STOPPED
from truearm.cell.virtual.wires import Wire
from truearm.cell.virtual.world import World
from truearm.inverse import Inverse
from truearm.rotations import quaternion_from_rotation_vector, rigid_inverse, transform_from_parts
from truearm.types import Floats

NUMBER: Final = r"[+-]?\d+\.?\d*(?:[eE][+-]?\d+)?"
MOVEJ: Final = re.compile(rf"movej\((p?)\[({NUMBER}(?:,{NUMBER}){{5}})\], a=({NUMBER}), v=({NUMBER})\)")
STOPJ: Final = re.compile(rf"stopj\({NUMBER}\)")
EMERGENCY: Final = 7.0
PERIOD_S: Final = 0.008


class VirtualUr:
    """Takes movej and stopj; a line it cannot read does nothing, as with the real one."""

    terminator = b"\n"

    def __init__(self, world: World) -> None:
        self._world = world

    def restart(self) -> None:
        """See Machine."""
        self._world.arm.halt(self._world.shared.now())

    def received(self, line: str, now: float) -> list[tuple[float, str]]:
        """See Machine."""
        text = line.strip()
        match = MOVEJ.fullmatch(text)
        if match is not None:
            self._move(match, now)
        elif STOPJ.fullmatch(text):
            self._world.arm.halt(now)
        return []

    def pending(self, now: float) -> list[tuple[float, str]]:
        """See Machine."""
        del now
        return []

    def next_event(self) -> float | None:
        """See Machine."""
        return None

    def _move(self, match: re.Match[str], now: float) -> None:
        numbers = np.array([float(part) for part in match[2].split(",")])
        here, arm = self._world.arm.at(now), self._world.cell.arm
        target = self._readings(numbers, here) if match[1] else numbers
        low, high = arm.limits.T
        acceleration, speed = float(match[3]), float(match[4])
        if target is None or (target < low).any() or (target > high).any() or min(acceleration, speed) <= 0.0:
            return
        way = float(np.abs(target - here).max())
        if way > 0.0:
            lag_s = self._world.settings.servo_lag_s
            self._world.arm.go(target, way / speed + speed / acceleration, now, lag_s)
            self._world.watch(now)

    def _readings(self, numbers: Floats, here: Floats) -> Floats | None:
        pose = transform_from_parts(numbers[:3], quaternion_from_rotation_vector(numbers[None, 3:])[0])
        arm = self._world.cell.arm
        found = Inverse(arm).near_or_nan(pose @ rigid_inverse(arm.tool), here)
        return None if np.isnan(found).any() else found


class VirtualUrStream:
    """The state at 125 Hz, whatever the speed of the virtual clock."""

    period_s = PERIOD_S

    def __init__(self, world: World, wire: Wire, faults: Faults) -> None:
        self.wire, self._world, self._faults = wire, world, faults

    def packet(self, now: float) -> bytes:
        """See Stream. A packet that is lost or late is not sent at all: the next one is as good."""
        mode = EMERGENCY if self._world.shared.flag(STOPPED) else ur_packets.NORMAL
        arm = self._world.arm
        packet = ur_packets.build(ur_packets.State(now, arm.at(now), arm.speed(now), mode))
        copies = [copy for late_s, copy in self._faults.carried(packet) if late_s == 0.0]
        return b"".join(copy if copy == packet else b"" for copy in copies[:1])
