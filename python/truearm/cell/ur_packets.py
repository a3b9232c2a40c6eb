"""The state that a Universal Robots controller streams on its real-time port, as far as it is needed here.

A packet begins with its length (int32) and holds doubles, all big-endian; their places are the same in all
versions of the software since 3.0. Source: Universal Robots, "Realtime client interface", its table.
"""

import struct
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.types import Floats

LENGTH: Final = struct.Struct(">i")
TIME_AT: Final = 4
Q_ACTUAL_AT: Final = 252
QD_ACTUAL_AT: Final = 300
ROBOT_MODE_AT: Final = 756
SAFETY_MODE_AT: Final = 812
SHORTEST: Final = 1044
LONGEST: Final = 4096
PACKET: Final = 1108
SIX: Final = struct.Struct(">6d")
ONE: Final = struct.Struct(">d")
RUNNING: Final = 7.0
NORMAL: Final = 1.0
MOVING_ALLOWED: Final = (1.0, 2.0)
PROTECTIVE_STOP: Final = 3.0
ROBOT_MODES: Final = {
    -1: "without a controller",
    0: "disconnected",
    1: "waiting for its safety settings to be confirmed",
    2: "booting",
    3: "powered off",
    4: "powered on, its brakes not released",
    5: "idle, its brakes not released",
    6: "moved by hand",
    8: "updating its firmware",
}
SAFETY_MODES: Final = {
    3: "protective stop",
    4: "recovery mode",
    5: "safeguard stop",
    6: "system emergency stop",
    7: "robot emergency stop",
    8: "violation",
    9: "fault",
}


@dataclass(frozen=True, eq=False)
class State:
    """What one packet says.

    Attributes:
        time_s: Since the controller was started.
        readings: Joint angles (6,), rad.
        speeds: Joint speeds (6,), rad/s.
        safety_mode: 1 normal, 2 reduced; above that the arm does not move.
        robot_mode: 7 where it runs; in any other mode the arm does not move.
    """

    time_s: float
    readings: Floats
    speeds: Floats
    safety_mode: float
    robot_mode: float = RUNNING


def parse(packet: bytes) -> State:
    """The state of a whole packet."""
    return State(
        time_s=ONE.unpack_from(packet, TIME_AT)[0],
        readings=np.array(SIX.unpack_from(packet, Q_ACTUAL_AT)),
        speeds=np.array(SIX.unpack_from(packet, QD_ACTUAL_AT)),
        safety_mode=ONE.unpack_from(packet, SAFETY_MODE_AT)[0],
        robot_mode=ONE.unpack_from(packet, ROBOT_MODE_AT)[0],
    )


def build(state: State) -> bytes:
    """A packet with a state; what is not in it is zero."""
    packet = bytearray(PACKET)
    LENGTH.pack_into(packet, 0, PACKET)
    ONE.pack_into(packet, TIME_AT, state.time_s)
    SIX.pack_into(packet, Q_ACTUAL_AT, *state.readings)
    SIX.pack_into(packet, QD_ACTUAL_AT, *state.speeds)
    ONE.pack_into(packet, ROBOT_MODE_AT, state.robot_mode)
    ONE.pack_into(packet, SAFETY_MODE_AT, state.safety_mode)
    return bytes(packet)


def last_whole(stream: bytes) -> tuple[bytes | None, bytes]:
    """The last whole packet in a stream of them, and what is left behind it.

    Raises:
        ValueError: If a length is none that a packet has, so that the stream is not understood.
    """
    packet, start = None, 0
    while len(stream) - start >= LENGTH.size:
        (length,) = LENGTH.unpack_from(stream, start)
        if not SHORTEST <= length <= LONGEST:
            raise ValueError(f"a packet of {length} bytes")
        if len(stream) - start < length:
            break
        packet = stream[start : start + length]
        start += length
    return packet, stream[start:]
