"""Whether a driver keeps to the protocols: shipped for the tests of users' own drivers.

    check_robot(lambda: MyRobot(settings, arm), places)
    check_sensor(lambda: MySensor(settings, arm), expected)

Both move the real device between what they are given, so do this with nothing in the way.
"""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.cell.device_errors import DeviceError, StoppedError
from truearm.cell.protocols import Connected, Device, Robot, Sensor
from truearm.cell.reading import Expected
from truearm.errors import TruearmError

Floats = NDArray[np.float64]

THERE_RAD: Final = 2e-3
STOPS_WITHIN_S: Final = 2.0


class ConformanceError(TruearmError):
    """What a driver does otherwise than the protocol says."""


def check_robot(
    factory: Callable[[], Robot],
    places: Sequence[Floats],
    *,
    there: float = THERE_RAD,
    stops_within_s: float = STOPS_WITHIN_S,
) -> list[str]:
    """Try a robot driver; what was found in order, in words.

    Args:
        factory: Makes the driver, not connected, always for the same device.
        places: Two or more different readings (N,) that the arm can move between, slowly enough for a motion
            to be caught by a stop.
        there: How far it may end from where it is sent, rad or m.
        stops_within_s: How long a stop may take.

    Raises:
        ConformanceError: If it does otherwise than the protocol says.
        DeviceError: If the device fails.
    """
    done = _check_device(factory)
    with Connected(robot := factory()):
        for place in places:
            robot.move_joints(place)
            off = np.abs(robot.read_joints() - place).max()
            _require(off <= there, f"after move_joints read_joints is {off:.2g} from the place")
        done.append("move_joints comes back when the arm is there, and read_joints says so")
        before = robot.read_joints()
        _require(np.array_equal(before, robot.read_joints()), "two read_joints of a still arm differ")
        before[:] = np.nan
        _require(bool(np.isfinite(robot.read_joints()).all()), "read_joints gives an array that it keeps")
        done.append("read_joints of a still arm repeats")
        _check_stop(robot, places, stops_within_s)
        done.append("a stop from another thread ends move_joints, and the arm can move again")
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
            reading = sensor.measure()
            if not reading.valid:
                _require(bool(reading.reason), "a reading that is not valid has no reason")
                continue
            point = reading.point_in_world
            _require(point is not None and point.shape == (3,), "a valid reading has no point (3,)")
            _require(reading.sigma_m > 0.0, f"sigma_m is {reading.sigma_m}")
            _require(abs(reading.time_s - time.time()) < 3600.0, "time_s is not the present time")
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


def _check_stop(robot: Robot, places: Sequence[Floats], within_s: float) -> None:
    """Stop a motion from another thread: it has to end, be it with StoppedError or because it was done."""
    outcome: list[BaseException | None] = []

    def go() -> None:
        try:
            for place in places:
                robot.move_joints(place)
            outcome.append(None)
        except Exception as error:  # noqa: BLE001 - judged below
            outcome.append(error)

    mover = threading.Thread(target=go, daemon=True)
    mover.start()
    began = time.monotonic()
    robot.stop()
    mover.join(within_s)
    _require(not mover.is_alive(), f"move_joints went on {time.monotonic() - began:.1f} s after a stop")
    error = outcome[0]
    _require(
        error is None or isinstance(error, StoppedError),
        f"a stop ended move_joints with {error!r}, no StoppedError",
    )
    for place in places:
        robot.move_joints(place)


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
