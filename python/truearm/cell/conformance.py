"""Whether a driver keeps to the protocols: shipped for the tests of users' own drivers.

    check_robot(lambda: MyRobot(settings, arm), places)
    check_sensor(lambda: MySensor(settings, arm), expected)

Both move the real device between what they are given, so do this with nothing in the way.
"""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from operator import itemgetter
from typing import Final

import numpy as np

from truearm.cell.device_errors import DeviceError, MalformedReadingError, StoppedError
from truearm.cell.protocols import Connected, Device, Robot, Sensor
from truearm.cell.reading import Expected, Reading, checked_reading
from truearm.errors import TruearmError
from truearm.types import Floats

THERE_RAD: Final = 2e-3
STOPS_WITHIN_S: Final = 2.0
STOP_AT: Final = 0.3
"""Part of a motion after which it is stopped."""
PRESENT_S: Final = 3600.0
SHORTEST_S: Final = 0.3
"""A motion that takes less cannot be caught in its middle."""


class ConformanceError(TruearmError):
    """What a driver does otherwise than the protocol says."""


def check_robot(
    factory: Callable[[], Robot],
    places: Sequence[Floats],
    *,
    there: float = THERE_RAD,
    stops_within_s: float | None = STOPS_WITHIN_S,
) -> list[str]:
    """Try a robot driver; what was found in order, in words.

    Args:
        factory: Makes the driver, not connected, always for the same device.
        places: Two or more different readings (N,) that the arm can move between, far enough apart for a
            motion to be stopped in its middle.
        there: How far it may end from where it is sent, rad or m.
        stops_within_s: How long a stop may take; None for what is at once where it is told to be, so that
            there is nothing to stop.

    Raises:
        ConformanceError: If it does otherwise than the protocol says.
        DeviceError: If the device fails.
    """
    done = _check_device(factory)
    with Connected(robot := factory()):
        for place in places:
            robot.move_joints(place)
            off = np.abs(_joints(robot, len(place)) - place).max()
            _require(off <= there, f"after move_joints read_joints is {off:.2g} from the place")
        done.append("move_joints comes back when the arm is there, and read_joints says so")
        before = robot.read_joints()
        apart = np.abs(robot.read_joints() - before).max()
        _require(apart <= there, f"two read_joints of a still arm differ by {apart:.2g}")
        before[:] = np.nan
        _require(bool(np.isfinite(robot.read_joints()).all()), "read_joints gives an array that it keeps")
        done.append("read_joints of a still arm repeats")
        if stops_within_s is not None:
            _check_stop(robot, places, there, stops_within_s)
            done.append("a stop from another thread ends move_joints on the way, and the arm can move again")
    return done


def check_sensor(factory: Callable[[], Sensor], expected: Expected) -> list[str]:
    """Try a sensor driver; what was found in order, in words.

    Args:
        factory: Makes the driver, not connected, always for the same device.
        expected: Where the target is now, so that it can be measured.

    Raises:
        ConformanceError: If it does otherwise than the protocol says.
        DeviceError: If the device fails.
    """
    done = _check_device(factory)
    with Connected(sensor := factory()):
        sensor.release()
        sensor.prepare(expected)
        for _ in range(2):
            reading = _reading(sensor)
            if not reading.valid:
                _require(bool(reading.reason), "a reading that is not valid has no reason")
                continue
            _require(abs(reading.time_s - time.time()) < PRESENT_S, "time_s is not the present time")
            _require(bool(reading.raw), "raw is empty")
        done.append("measure gives a point with sigma, time and raw record, or a reason")
        sensor.stop()
        sensor.prepare(expected)
        done.append("it can be prepared again after a stop")
        sensor.release()
        done.append("release works, first and last")
    return done


def _check_device(factory: Callable[[], Device]) -> list[str]:
    device = factory()
    _require(bool(device.name and device.address), "name or address is empty")
    device.stop()
    device.close()
    done = ["it has a name and an address", "stop and close work when it is not connected"]
    device.connect()
    try:
        with _raises(DeviceError, "connecting twice"):
            device.connect()
        device.stop()
        device.stop()
    finally:
        device.close()
        device.close()
    done += ["connecting twice is a DeviceError", "stop and close work twice"]
    device.connect()
    device.close()
    done.append("it can be connected again after close")
    return done


def _reading(sensor: Sensor) -> Reading:
    try:
        return checked_reading(sensor.measure())
    except MalformedReadingError as error:
        raise ConformanceError(str(error)) from None


def _joints(robot: Robot, count: int) -> Floats:
    found: object = robot.read_joints()
    _require(
        isinstance(found, np.ndarray) and found.shape == (count,) and found.dtype == np.float64,
        f"read_joints gives {found!r}, no array ({count},) of float64",
    )
    return np.asarray(found)


def _check_stop(robot: Robot, places: Sequence[Floats], there: float, within_s: float) -> None:
    """Stop a motion in its middle from another thread: StoppedError ends it, and the arm stays on its way."""
    start, goal, takes_s = _longest_motion(robot, places)
    _require(
        takes_s >= SHORTEST_S,
        f"the longest motion takes {takes_s:.2g} s, too short to be stopped in its middle: give places "
        "farther apart, or a slower speed",
    )
    robot.move_joints(start)
    outcome: list[BaseException | None] = []

    def go() -> None:
        try:
            robot.move_joints(goal)
            outcome.append(None)
        except Exception as error:  # noqa: BLE001 - judged below
            outcome.append(error)

    mover = threading.Thread(target=go, daemon=True)
    mover.start()
    time.sleep(STOP_AT * takes_s)
    began = time.monotonic()
    robot.stop()
    mover.join(within_s)
    _require(not mover.is_alive(), f"move_joints went on {time.monotonic() - began:.1f} s after a stop")
    error = outcome[0]
    _require(error is not None, "move_joints came back after a stop as if nothing had been: no StoppedError")
    _require(isinstance(error, StoppedError), f"a stop ended move_joints with {error!r}, no StoppedError")
    # Until a motion that nothing stopped would have ended.
    time.sleep(max(0.0, takes_s - (time.monotonic() - began)))
    off = np.abs(robot.read_joints() - goal).max()
    _require(bool(off > there), "the arm went on to its place in spite of a stop")
    for place in places:
        robot.move_joints(place)


def _longest_motion(robot: Robot, places: Sequence[Floats]) -> tuple[Floats, Floats, float]:
    """The motion from a place to the next that takes longest: from where, where to, how long, s."""
    robot.move_joints(places[0])
    timed = []
    for start, goal in pairwise(places):
        began = time.monotonic()
        robot.move_joints(goal)
        timed.append((time.monotonic() - began, start, goal))
    takes_s, start, goal = max(timed, key=itemgetter(0))
    return start, goal, takes_s


@contextmanager
def _raises(kind: type[Exception], doing: str) -> Iterator[None]:
    try:
        yield
    except kind:
        return
    raise ConformanceError(f"{doing} is no {kind.__name__}")


def _require(fulfilled: bool, otherwise: str) -> None:
    if not fulfilled:
        raise ConformanceError(otherwise)
